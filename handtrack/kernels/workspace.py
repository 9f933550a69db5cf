"""The records of a frame: what it is fitted in, what is told of it, what the next one is given.

Every field has its name, every axis of the workspace its own.

Five fingers lie side by side: the last axis of most fields are eight *lanes*, of which 0-4 are
the fingers, thumb first, so that a loop over the lanes is a loop over fingers that the compiler
turns into vector instructions. Lane 5 carries the wrist as the base joint of a finger without
bones; lanes 6 and 7 stay zero.

Quantities are in the root frame unless said otherwise. The root's six unknowns are a turn omega
and a shift v: the world rotation and translation R, t become R exp(omega), t + R v. Symbols and
equation numbers are those of the theory page (tools/docs/theory.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

LANES, FINGERS, WRIST = 8, 5, 5

# a finger's angles; a saddle's own directions on its ellipse take the place of the first two
FLEXION, ABDUCTION, HINGE_1, HINGE_2 = range(4)
NORMAL, TANGENT = 0, 1
ANGLES = 4
# its joints, from the base to the tip, and the bones between them
BASE, TIP = 0, 3
JOINTS, BONES = 4, 3
# the root's unknowns: a turn (3), a shift (3); behind them the gradient
TURN, SHIFT, GRADIENT = 0, 3, 6
ROOT = 6
# a pose: 20 angles by fingers, then the root
N_ANGLES, N_POSE = 20, 26

# what `state` says
CONVERGED, LIMIT, STALLED, TOO_FEW, UNDERDETERMINED = range(5)

# pairs of 19 capsules; numbers of a pair that may meet (see `hand.capsules.contacts`)
MAX_CONTACTS, PAIR = 171, 5

_XYZ = 3
_FIELDS: list[tuple[str, str, tuple[int, ...]]] = [
    # the hand at rest: bones, unit axes of the angles, unit first bone; limits; what the thumb
    # turns about its first bone for each radian of its abduction
    ("rest_bone", "f8", (BONES, _XYZ, LANES)),
    ("rest_axis", "f8", (ANGLES, _XYZ, LANES)),
    ("rest_along", "f8", (_XYZ, LANES)),
    ("lower", "f8", (ANGLES, LANES)),
    ("upper", "f8", (ANGLES, LANES)),
    ("twist", "f8", (LANES,)),
    # landmarks from their joints at rest, and whether there are any
    ("rest_offset", "f8", (JOINTS, _XYZ, LANES)),
    ("offset", "i8", ()),
    # the frame: weights w_j and targets in the world
    ("weight", "f8", (JOINTS, LANES)),
    ("target", "f8", (JOINTS, _XYZ, LANES)),
    # the pose: angles phi, R and t
    ("angle", "f8", (ANGLES, LANES)),
    ("rotation", "f8", (3, 3)),
    ("translation", "f8", (_XYZ,)),
    # what follows from it: joints x_j (the bases never move), axes u_a, the first bone
    ("joint", "f8", (JOINTS, _XYZ, LANES)),
    # landmarks l_j, which the targets are of: the joints, or beside them
    ("mark", "f8", (JOINTS, _XYZ, LANES)),
    ("axis", "f8", (ANGLES, _XYZ, LANES)),
    ("along", "f8", (_XYZ, LANES)),
    # targets y_j; weights under the loss; each finger's part of the objective
    ("seen", "f8", (JOINTS, _XYZ, LANES)),
    ("pull", "f8", (JOINTS, LANES)),
    ("cost", "f8", (LANES,)),
    # for the derivatives: w_j r_j and m_j; about each joint that turns: torque, T_p and c_p
    ("force", "f8", (JOINTS, _XYZ, LANES)),
    ("aim", "f8", (JOINTS, _XYZ, LANES)),
    ("torque", "f8", (BONES, _XYZ, LANES)),
    ("moment", "f8", (BONES, 3, 3, LANES)),
    ("lever", "f8", (BONES, _XYZ, LANES)),
    # the derivatives. Of each angle: its coupling to the root's unknowns, its gradient;
    # the fingers' Hessians, and the diagonal of Gauss-Newton's
    ("row", "f8", (ANGLES, ROOT + 1, LANES)),
    ("hessian", "f8", (ANGLES, ANGLES, LANES)),
    ("diagonal", "f8", (ANGLES, LANES)),
    # each finger's share of the root's gradient and Hessian
    ("root_gradient", "f8", (ROOT, LANES)),
    ("root_moment", "f8", (3, 3, LANES)),
    ("root_lever", "f8", (_XYZ, LANES)),
    ("root_weight", "f8", (LANES,)),
    # the active face: free (1) or held (0) by NORMAL, TANGENT, hinges; the unit normal of the
    # saddle's ellipse, and the boundary's curvature
    ("free", "f8", (ANGLES, LANES)),
    ("normal", "f8", (2, LANES)),
    ("curvature", "f8", (LANES,)),
    # the factored face L D L^T: 1/D and L; its rows through L^-1, and each finger's share of the
    # Schur complement
    ("pivot", "f8", (ANGLES, LANES)),
    ("factor", "f8", (ANGLES, ANGLES, LANES)),
    ("face_row", "f8", (ANGLES, ROOT + 1, LANES)),
    ("schur", "f8", (ROOT, ROOT + 1, LANES)),
    # one finger's model in absolute angles: its slope where they are zero
    ("origin_slope", "f8", (ANGLES,)),
    # the root's equations: six unknowns, the gradient, the least sound pivot
    ("system", "f8", (ROOT, LANES)),
    ("root_change", "f8", (ROOT + 1,)),
    # the step, and the pose before it
    ("step", "f8", (ANGLES, LANES)),
    ("root_step", "f8", (ROOT,)),
    ("angle_before", "f8", (ANGLES, LANES)),
    ("rotation_before", "f8", (3, 3)),
    ("translation_before", "f8", (_XYZ,)),
    # a finger bent the other way, and what that adds to the objective
    ("trial", "f8", (ANGLES, LANES)),
    ("rise", "f8", (LANES,)),
    # the covariance as a sum of outer products: what each unknown has of the root's six, and an
    # angle of its own finger's four; a line of the fingers' answers
    ("shared", "f8", (ROOT, N_POSE)),
    ("own", "f8", (ANGLES, ANGLES, LANES)),
    ("line", "f8", (ANGLES, LANES)),
    # settings of the solvers
    ("max_sweeps", "f8", ()),
    ("max_steps", "f8", ()),
    ("tolerance", "f8", ()),
    ("spread2", "f8", ()),
    ("loss", "i8", ()),
    ("cold", "i8", ()),
    ("full", "i8", ()),
    # their results; dense ones by angles, then the root, as a pose has them
    ("objective", "f8", ()),
    ("sweeps", "f8", ()),
    ("steps", "f8", ()),
    ("state", "i8", ()),
    ("variance", "f8", (N_ANGLES,)),
    ("covariance", "f8", (N_POSE, N_POSE)),
    ("gradient", "f8", (N_POSE,)),
    ("information", "f8", (N_POSE, N_POSE)),
    # how many pairs of capsules may meet, and the numbers of each
    ("contacts", "i8", ()),
    ("contact", "f8", (MAX_CONTACTS, PAIR)),
]

WORK = np.dtype(_FIELDS, align=True)

LENS = np.dtype(
    [
        ("fx", "f8"),
        ("skew", "f8"),
        ("cx", "f8"),
        ("fy", "f8"),
        ("cy", "f8"),
        # k1 k2 p1 p2 k3 k4 k5 k6
        ("distortion", "f8", (8,)),
        ("rotation", "f8", (3, 3)),
        ("translation", "f8", (_XYZ,)),
    ],
    align=True,
)
"""A camera (see `cameras.Camera`)."""

RESULT = np.dtype(
    [
        # the pose: angles [rad]; rotation by rows and translation [m], in one; the rotation's
        # quaternion; joints [m]
        ("angles", "f8", (N_ANGLES,)),
        ("root", "f8", (12,)),
        ("quaternion", "f8", (4,)),
        ("joints", "f8", (21, 3)),
        # the objective [m^2], and the variance of the joints per coordinate [m^2]
        ("objective", "f8"),
        ("noise", "f8"),
        # joints with a weight; how the solve ended; how long it took
        ("seen", "i8"),
        ("state", "i8"),
        ("sweeps", "i8"),
        ("steps", "i8"),
        # variances of the angles [rad^2]; greatest distance of a joint to its fitted landmark [m]
        ("variance", "f8", (N_ANGLES,)),
        ("worst", "f8"),
        # 1 where what was before means nothing, which is for others to say
        ("anew", "i8"),
    ],
    align=True,
)
"""What is told of a frame."""


Records = NDArray[np.void]
"""Of one of the types here, or of a filter's (see `filter_state`)."""


def _unfitted() -> Records:
    row = np.zeros((), RESULT)
    for name in ("angles", "root", "quaternion", "joints", "objective", "noise", "worst"):
        row[name] = np.nan
    row["variance"] = np.inf
    row.setflags(write=False)
    return row


UNFITTED = _unfitted()
"""() RESULT where nothing is fitted."""
_UNFITTED = np.frombuffer(UNFITTED.tobytes(), np.uint8)


def unfitted(n: int) -> Records:
    """(n,) of them."""
    rows = np.empty(n, RESULT)
    # bytes, as NumPy takes 10 us to see how records are copied
    rows.view(np.uint8).reshape(n, RESULT.itemsize)[:] = _UNFITTED
    return rows


KEEP = np.dtype(
    [("angles", "f8", (N_ANGLES,)), ("root", "f8", (12,)), ("memory", "i8")], align=True
)
"""What is kept from frame to frame: the last fitted pose, and whether it means anything."""
# nothing was fitted before; the frame before was lost; it was fitted
NEW, LOST, FITTED = range(3)
