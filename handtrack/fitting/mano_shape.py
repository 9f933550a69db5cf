"""A subject's shape in MANO's own shape space, from the joints of a sequence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.files.long_arrays import evenly
from handtrack.fitting.fit import fit_batch
from handtrack.hand.limits import DEFAULT_LIMITS, Limits
from handtrack.hand.mano import MANO
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import PALM
from handtrack.sequences.sequence import Sequence

Array = NDArray[np.float64]

_MIN_FRAMES, _SEEN = 3, 10
# frames that are looked at, and rounds of poses and shape in turn
_FRAMES, _ROUNDS = 120, 60
# joints are never better than this, whatever the residual [m]
_LEAST_NOISE = 3e-4
# what a hand of hinges cannot follow is much the same from frame to frame: all frames together
# say no more than so many independent ones
_INDEPENDENT = 10


@dataclass(frozen=True, eq=False)
class ManoShape:
    """What a sequence says of a hand's shape.

    Attributes:
        betas: (S,) shape coefficients.
        deviation: (S,) standard deviation of each given the sequence, for poses as fitted; 1,
            MANO's own, where it says nothing.
        model: MANO's hand of that shape.
        error: mean distance of the observed joints to the fitted ones [m].
        frames: how many frames were used.
    """

    betas: Array
    deviation: Array
    model: HandModel
    error: float
    frames: int


def mano_shape(mano: MANO, sequence: Sequence, limits: Limits | str = DEFAULT_LIMITS) -> ManoShape:
    """The shape coefficients of the hand in a sequence, one for all frames.

    Poses and shape are found in turn: with the poses' rotations held, joints are linear in the
    coefficients (and the translation), so that each half is solved exactly and the sum of
    squares and of the prior, MANO's unit normal, does not rise.

    Args:
        mano: the user's MANO, of the sequence's hand.
        sequence: joints may be missing.
        limits: of the angles, or their name.

    Raises:
        InputError: the sequence is of the other hand, or fewer than three frames have ten
            joints.
    """
    where = sequence.source or None
    if sequence.hand != mano.hand:
        raise InputError(f"is a {sequence.hand} hand, the MANO file a {mano.hand} one", where)
    seen = np.isfinite(sequence.joints[..., 0]).sum(1)
    good = np.flatnonzero(seen >= _SEEN)
    if len(good) < _MIN_FRAMES:
        raise InputError(f"{len(good)} frames have {_SEEN} joints, {_MIN_FRAMES} are needed", where)
    # evenly over the sequence
    good = evenly(good, _FRAMES)
    joints = sequence.joints[good]
    betas = np.zeros(mano.shape_basis.shape[-1])
    for _ in range(_ROUNDS):
        model = mano.model(betas, limits)
        fits = fit_batch(model, joints)
        new, deviation, error = _shape(mano, model, joints, fits.angles, fits.rotation)
        step, betas = float(np.abs(new - betas).max()), new
        if step < 1e-4:
            break
    return ManoShape(betas, deviation, mano.model(betas, limits), error, len(good))


def _shape(
    mano: MANO, model: HandModel, joints: Array, angles: Array, rotation: Array
) -> tuple[Array, Array, float]:
    """Coefficients, their deviations and the mean distance [m], for given rotations."""
    parts = model.rotations(angles)
    template = _posed(parts, mano.joint_template[..., None])[..., 0]
    basis = _posed(parts, mano.joint_basis)  # (N, 21, 3, S)
    observed = np.einsum("nji,nkj->nki", rotation, joints)  # in the root frame
    known = np.isfinite(observed[..., 0])
    miss = np.where(known[..., None], observed - template, 0.0)
    basis = np.where(known[..., None, None], basis, 0.0)
    # the translation that is best for any shape: differences to each frame's mean
    mean = known / known.sum(1, keepdims=True)
    miss -= known[..., None] * np.einsum("nk,nki->ni", mean, miss)[:, None]
    basis -= known[..., None, None] * np.einsum("nk,nkis->nis", mean, basis)[:, None]
    a, b = basis.reshape(-1, basis.shape[-1]), miss.ravel()
    share = min(1.0, _INDEPENDENT / len(joints))
    normal, right = share * (a.T @ a), share * (a.T @ b)
    betas = np.linalg.solve(normal + _LEAST_NOISE**2 * np.eye(len(normal)), right)
    noise = _LEAST_NOISE
    for _ in range(3):  # the residual says how far the prior counts
        left = b - a @ betas
        noise = max(float(np.sqrt(left @ left / (3 * known.sum()))), _LEAST_NOISE)
        betas = np.linalg.solve(normal + noise**2 * np.eye(len(normal)), right)
    deviation = np.sqrt(np.diag(np.linalg.inv(normal / noise**2 + np.eye(len(normal)))))
    distance = np.linalg.norm((b - a @ betas).reshape(miss.shape), axis=-1)[known]
    return np.asarray(betas), np.asarray(deviation), float(distance.mean())


def _posed(parts: Array, rest: Array) -> Array:
    """Rest joints (21, 3, C), or offsets of them, posed by rotations (N, 16, 3, 3): (N, 21, 3, C).

    Li et al. 2021 eq. 5, which is linear in the rest joints.
    """
    out = np.empty((len(parts), *rest.shape))
    out[:, PALM] = rest[PALM]
    for f in range(5):
        for i in range(3):
            k = 4 * f + 1 + i
            bone = np.einsum("nij,jc->nic", parts[:, 1 + 3 * f + i], rest[k + 1] - rest[k])
            out[:, k + 1] = out[:, k] + bone
    return out
