"""Whether a hand stays a hand: bone lengths, joint limits, fingers that pass through others."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from handtrack.errors import InputError, SettingsError
from handtrack.evaluation.arrays import (
    Array,
    lengths,
    nan_mean,
    points,
    sequence_of_points,
)
from handtrack.files.long_arrays import ROWS, Growing, blocks
from handtrack.hand.capsules import FINGER_RADII, contact_depths
from handtrack.hand.limits import Limits
from handtrack.hand.skeleton import BONES, N_ANGLES, N_JOINTS


def bone_lengths(x: ArrayLike, bones: Many[tuple[int, int]] = BONES) -> Array:
    """Lengths (..., B) of the bones (parent, child) of joints (..., J, 3), in their unit."""
    x = points(x)
    parents, children = np.array(bones).T
    if max(parents.max(), children.max()) >= x.shape[-2]:
        raise InputError(f"{x.shape[-2]} joints cannot hold a bone to joint {children.max()}")
    return lengths(x[..., children, :] - x[..., parents, :])


def bone_length_drift(x: ArrayLike, bones: Many[tuple[int, int]] = BONES) -> Array:
    """How much each bone's length varies over time, relative to its mean length.

    Args:
        x: (T, J, 3) joints, NaN = missing.
        bones: (parent, child) pairs.

    Returns:
        (B,) standard deviation over frames / mean; 0 for a hand of constant bones, NaN for a
        bone that was never seen.
    """
    x = sequence_of_points(x)
    first = nan_mean(bone_lengths(x[:ROWS], bones), 0)
    # about what it is in the first frames, where it is known: squares are of what varies only
    first = np.where(np.isnan(first), 0.0, first)
    count, total, squares = np.zeros(len(bones)), np.zeros(len(bones)), np.zeros(len(bones))
    for part in blocks(len(x)):
        off = bone_lengths(x[part], bones) - first
        known = ~np.isnan(off)
        off = np.where(known, off, 0.0)
        count += known.sum(0)
        total += off.sum(0)
        squares += (off**2).sum(0)
    seen = np.where(count > 0, count, np.nan)
    apart = total / seen
    mean, std = first + apart, np.sqrt(np.maximum(squares / seen - apart**2, 0.0))
    return np.asarray(std / np.where(mean > 0, mean, np.nan))


@dataclass(frozen=True, eq=False)
class LimitViolations:
    """How far angles leave their limits.

    Attributes:
        share: part of the frames in which any angle does, 0..1; NaN without frames.
        share_per_angle: (20,) the same for each angle.
        mean_deg: mean violation over all angles and frames, zeros included [degrees].
        max_deg: greatest violation [degrees].
        degrees: (T, 20) distance of each angle to its nearest valid value [degrees].
    """

    share: float
    share_per_angle: Array
    mean_deg: float
    max_deg: float
    degrees: Array


def limit_violations(
    angles: ArrayLike, limits: Limits, tolerance_deg: float = 1e-3
) -> LimitViolations:
    """How often and by how much angles leave their limits (intervals and saddle ellipses).

    Args:
        angles: (T, 20) [rad]; frames with NaN are left out.
        limits: the limits.
        tolerance_deg: a violation up to this counts as none in the shares [degrees].

    Raises:
        InputError: angles are not (T, 20).
    """
    whole = Growing((N_ANGLES,))
    found = _violations(angles, limits, tolerance_deg, whole.append)
    return replace(found, degrees=whole.whole())


def share_outside(angles: ArrayLike, limits: Limits, tolerance_deg: float = 1e-3) -> float:
    """`limit_violations`' share of the frames, without what it is in each of them."""
    return _violations(angles, limits, tolerance_deg, lambda degrees: None).share


def _violations(
    angles: ArrayLike, limits: Limits, tolerance_deg: float, keep: Callable[[Array], None]
) -> LimitViolations:
    """As `limit_violations`, without `degrees`, which are given away block by block."""
    angles = np.asarray(angles, dtype=np.float64)
    if angles.ndim != 2 or angles.shape[1] != N_ANGLES:
        raise InputError(f"angles have shape {angles.shape}, expected (frames, 20)")
    n, total, greatest, any_over = 0, 0.0, 0.0, 0
    over = np.zeros(N_ANGLES, np.int64)
    for part in blocks(len(angles)):
        some = angles[part]
        present = ~np.isnan(some).any(1)
        degrees = np.full(some.shape, np.nan)
        degrees[present] = seen = np.rad2deg(limits.violation(some[present]))
        n, total = n + len(seen), total + float(seen.sum())
        greatest = max(greatest, float(seen.max(initial=0.0)))
        any_over += int((seen > tolerance_deg).any(1).sum())
        over += (seen > tolerance_deg).sum(0)
        keep(degrees)
    nan = float("nan")
    return LimitViolations(
        share=any_over / n if n else nan,
        share_per_angle=over / n if n else np.full(N_ANGLES, nan),
        mean_deg=total / (n * N_ANGLES) if n else nan,
        max_deg=greatest if n else nan,
        degrees=np.empty((0, N_ANGLES)),
    )


def angle_error(a: ArrayLike, b: ArrayLike) -> Array:
    """Mean absolute difference of angles per frame, the short way round the circle.

    Args:
        a, b: (..., N) [rad], NaN = missing.

    Returns:
        (...) [rad].
    """
    a = np.asarray(a, dtype=np.float64)
    b = np.asarray(b, dtype=np.float64)
    if a.shape != b.shape or a.ndim < 1:
        raise InputError(f"the estimate has shape {a.shape}, the reference {b.shape}")
    return nan_mean(np.abs((a - b + np.pi) % (2 * np.pi) - np.pi))


def self_intersection(x: ArrayLike, radii: ArrayLike = FINGER_RADII) -> Array:
    """How deep the bones of different fingers sink into each other, per frame.

    Each finger bone is a capsule (Li et al. 2021): a segment with a radius. The depth of two
    is the sum of their radii minus the distance of the segments. Bones of one finger and the
    palm are not tested. Fingers that lie against each other reach 1-2 mm.

    Args:
        x: (T, 21, 3) joints [m] (or any unit that `radii` have), NaN = missing.
        radii: (5, 3) radius of each finger's bones, base to tip.

    Returns:
        (T,) greatest depth, 0 where nothing touches, in the unit of x; NaN where no pair of
        bones is complete.
    """
    x = sequence_of_points(x)
    if x.shape[1] != N_JOINTS:
        raise InputError(f"{x.shape[1]} joints, expected 21")
    radii = np.asarray(radii, dtype=np.float64)
    if radii.shape != (5, 3) or not (radii >= 0).all():
        raise SettingsError(f"radii have shape {radii.shape}, expected (5, 3), none negative")
    first, second = np.triu_indices(15, 1)
    other = first // 3 != second // 3
    first, second = first[other], second[other]
    reach = radii.ravel()[first] + radii.ravel()[second]
    return deepest_contact(x, np.column_stack([first, second, reach]))


def deepest_contact(x: Array, pairs: Array) -> Array:
    """(T,) greatest depth of pairs of capsules, as `self_intersection` has it.

    Args:
        x: (T, 21, 3) joints, NaN = missing.
        pairs: as `hand.capsules.contacts` gives them.
    """
    out = np.empty(len(x))
    for start in range(0, len(x), 2000):  # 90 pairs a frame: keep the temporaries small
        depth = contact_depths(x[start : start + 2000], pairs)
        known = ~np.isnan(depth)
        deepest = np.where(known, np.maximum(depth, 0.0), 0.0).max(1)
        out[start : start + 2000] = np.where(known.any(1), deepest, np.nan)
    return out
