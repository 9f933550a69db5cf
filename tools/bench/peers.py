"""Our hand in other solvers, for benchmark.py: mink (MuJoCo) and pymomentum (Python >= 3.12).

The same joints, axes and bones; the limits are boxes, as neither knows the saddle's ellipse.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ANGLE_JOINT, N_ANGLES, N_JOINTS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Peer:
    """A solver, in two steps, of which the first one is what it takes.

    Attributes:
        solve: from joints (21, 3) [m], angles (20,) and root (12,) to start from, to its own pose.
        read: from that and the root to angles (20,), rotation (3, 3) and translation (3,) [m].
    """

    solve: Callable[[Array, Array, Array], Array]
    read: Callable[[Array, Array], tuple[Array, Array, Array]]


ITERATIONS, TOLERANCE = 100, 1e-5
"""At most so many; and enough once one improves the objective by less than this share."""


def peers() -> dict[str, Callable[[HandModel], Peer]]:
    """The solvers that are installed, by name."""
    found = {"mink": mink, "pymomentum": pymomentum}
    return {name: make for name, make in found.items() if importlib.util.find_spec(name)}


def beyond(angle: int) -> int:
    """The joint that an angle's bone leads to."""
    return int(ANGLE_JOINT[angle]) + 1


def mink(model: HandModel) -> Peer:
    """Its differential kinematics, solved to convergence: a QP with limits for each step."""
    import mink as library
    import mujoco

    rest = model.rest_joints

    def text(x: Any) -> str:
        return " ".join(f"{v:.17g}" for v in np.ravel(x))

    def joint(angle: int) -> str:
        low, high = model.limits.lower[angle], model.limits.upper[angle]
        limits = f'limited="true" range="{text((low, high))}"'
        return f'<joint type="hinge" axis="{text(model.axes[angle])}" {limits}/>'

    def site(k: int, parent: int) -> str:
        return f'<site name="j{k}" pos="{text(rest[k] - rest[parent])}"/>'

    inertia = '<inertial pos="0 0 0" mass="0.01" diaginertia="1e-4 1e-4 1e-4"/>'
    body = f'<freejoint/>{inertia}<site name="j0" pos="{text(rest[0])}"/>'
    for f in range(5):
        k, a = 4 * f + 1, 4 * f
        inner = ""
        for i in (2, 1):
            inner = (
                f'<body pos="{text(rest[k + i] - rest[k + i - 1])}">{joint(a + 1 + i)}{inertia}'
                f"{site(k + i + 1, k + i)}{inner}</body>"
            )
        base = f"{joint(a)}{joint(a + 1)}{inertia}{site(k, k)}{site(k + 1, k)}"
        body += f'<body pos="{text(rest[k])}">{base}{inner}</body>'
    xml = f'<mujoco><compiler angle="radian"/><worldbody><body>{body}</body></worldbody></mujoco>'
    hand = mujoco.MjModel.from_xml_string(xml)
    tasks = [
        library.FrameTask(f"j{k}", "site", position_cost=1.0, orientation_cost=0.0)
        for k in range(N_JOINTS)
    ]
    limits = [library.ConfigurationLimit(hand)]

    def solve(joints: Array, angles: Array, root: Array) -> Array:
        low, high = model.limits.lower, model.limits.upper
        start = Rotation.from_matrix(root[:9].reshape(3, 3)).as_quat(scalar_first=True)
        pose = library.Configuration(hand)
        pose.update(np.concatenate([root[9:], start, np.clip(angles, low + 1e-9, high - 1e-9)]))
        best, at = np.inf, pose.q.copy()
        for _ in range(ITERATIONS):
            places = pose.data.site_xpos
            cost = float(np.square(places - joints).sum())
            if cost < best:
                at = pose.q.copy()
            if not cost < best * (1 - TOLERANCE):
                break
            best = cost
            for k, task in enumerate(tasks):
                # as it is turned now: only the place counts
                turn = library.SO3.from_matrix(pose.data.site_xmat[k].reshape(3, 3))
                task.set_target(library.SE3.from_rotation_and_translation(turn, joints[k]))
            step = library.solve_ik(pose, tasks, 1.0, "daqp", damping=1e-9, limits=limits)
            pose.integrate_inplace(step, 1.0)
        return np.asarray(at)

    def read(at: Array, root: Array) -> tuple[Array, Array, Array]:
        return at[7:], Rotation.from_quat(at[3:7], scalar_first=True).as_matrix(), at[:3]

    return Peer(solve, read)


def pymomentum(model: HandModel) -> Peer:
    """Gauss-Newton in single precision; limits are penalties, in centimetres as its users have."""
    import pymomentum.geometry as geometry
    import pymomentum.solver2 as solvers

    rest, cm = model.rest_joints, 100.0
    # a joint for each angle turns about its own x axis, which `frames` bring to the angle's
    frames = [Rotation.align_vectors(axis[None], [[1.0, 0, 0]])[0] for axis in model.axes]
    joints = [geometry.Joint("root", -1, np.array([0, 0, 0, 1.0]), np.zeros(3))]
    parents, offsets = [0], [cm * rest[0]]
    for a in range(N_ANGLES):
        first = a % 4 == 0
        k, outer = int(ANGLE_JOINT[a]), Rotation.identity() if first else frames[a - 1]
        before = np.zeros(3) if first else rest[int(ANGLE_JOINT[a - 1])]
        turn = (outer.inv() * frames[a]).as_quat()
        place = cm * outer.inv().apply(rest[k] - before)
        joints.append(geometry.Joint(f"a{a}", 0 if first else a, turn, place))
        if first:
            parents.append(0)
            offsets.append(cm * rest[k])
        if a % 4:
            parents.append(a + 1)
            offsets.append(cm * frames[a].inv().apply(rest[beyond(a)] - rest[k]))
    skeleton = geometry.Skeleton(joints)
    matrix = np.zeros((7 * len(joints), 26), dtype=np.float32)
    matrix[:6, :6] = np.eye(6)
    for a in range(N_ANGLES):
        matrix[7 * (a + 1) + 3, 6 + a] = 1.0
    names = [f"p{i}" for i in range(26)]
    transform = geometry.ParameterTransform(names, skeleton, matrix)
    boxes = [
        geometry.ParameterLimit.create_minmax(
            6 + a, float(model.limits.lower[a]), float(model.limits.upper[a])
        )
        for a in range(N_ANGLES)
    ]
    hand = geometry.Character("hand", skeleton, transform).with_parameter_limits(boxes)
    position = solvers.PositionErrorFunction(hand)
    soft = solvers.LimitErrorFunction(hand, weight=10.0)
    function = solvers.SkeletonSolverFunction(hand, [position, soft])
    options = solvers.GaussNewtonSolverQROptions()
    options.max_iterations, options.min_iterations = ITERATIONS, 2
    options.threshold, options.regularization = 10.0, 1e-5
    options.do_line_search = True
    solver = solvers.GaussNewtonSolverQR(function, options)
    owners, places = np.array(parents, np.int32), np.array(offsets, np.float32)

    def solve(joints: Array, angles: Array, root: Array) -> Array:
        # seen from the start's root, so that its Euler angles stay small
        turn, shift = root[:9].reshape(3, 3), root[9:]
        targets = np.asarray(cm * (joints - shift) @ turn, dtype=np.float32)
        position.clear_constraints()
        position.add_constraints(owners, target=targets, offset=places)
        start = np.zeros(26, dtype=np.float32)
        start[6:] = angles
        return np.asarray(solver.solve(start))

    def read(pose: Array, root: Array) -> tuple[Array, Array, Array]:
        found, turn = pose.astype(np.float64), root[:9].reshape(3, 3)
        r = turn @ Rotation.from_euler("xyz", found[3:6]).as_matrix()
        return found[6:], r, root[9:] + turn @ found[:3] / cm

    return Peer(solve, read)
