"""A round of calibration: some frames of each clip, and the hand in all of them at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.bundle import Clip, Poses, Solution, solve
from handtrack.calibration.chains import SIZE, Chains
from handtrack.calibration.fading import ALL_LASTS, FADES_S, Lasts, lasts
from handtrack.calibration.freedoms import DRIFT, Freedoms, by_constants, shape
from handtrack.calibration.material import Material, poses_of
from handtrack.calibration.split import residuals
from handtrack.detectors.profile import Noise
from handtrack.fitting import solver
from handtrack.hand.model import HandModel

# errors of an unknown detector that are not new in every frame are taken to be constant, and twice
# what is seen of them (variances): poses and bones give way to the rest
_UNSEEN = 2.0
# no hand is more rigid than this: what is left of one that is nearly found is no error [m]
_RIGID = 1e-3

MOST_STRETCHES = 4
"""Errors that fade depend on the pose too, and poses come back, with their errors: no clip is worth
more stretches than these."""


def worth_of(
    frames: int,
    span_s: float,
    deviation: float,
    left: float,
    noise: Noise | None,
    seen: Lasts = ALL_LASTS,
) -> float:
    """Information of a clip on its subject's constants, over what as many unrelated frames have.

    A mean over frames of errors with a constant part c, a fading part f and a white part w has
    the variance c^2 + f^2 / n_f + w^2 / n, with n_f = span / (2 tau) independent stretches.

    Args:
        frames: n, how many are looked at; span_s: from the first to the last [s].
        deviation: of the joints from what the hand explains, per coordinate [m].
        left: white noise among that [m].
        noise: the detector's; where it is not known, what is not white is taken to last as far as
            residuals do not show that it fades.
        seen: what they show.

    Returns:
        In 0..1; 1 where all errors are white.
    """
    n = max(frames, 1)
    if noise is None:
        unseen = _UNSEEN * max(deviation**2 - left**2 - _RIGID**2, 0.0)
        constant = seen.constant_of(unseen)
        fading, fades, most = unseen - constant, FADES_S, n
        white = min(left, deviation) ** 2
        total = max(deviation**2, white)
    else:
        constant, fading, white = (
            float(np.square(part).mean()) for part in (noise.constant, noise.fading, noise.white)
        )
        fades, most = noise.fades_s, MOST_STRETCHES
        total = constant + fading + white
    stretches = min(max(span_s / (2.0 * fades), 1.0), n, most) if fades > 0 else n
    together = constant + fading / stretches + white / n
    if not together > 0:
        return 1.0
    return float(min(total / n / together, 1.0))


Array = NDArray[np.float64]

# joints are not better known than this [m], nor hands more rigid
_FLOOR = 3e-4
# strays begin at so many median distances, and not below [m]
_STRAYS, _STRAYS_LEAST = 4.0, 5e-3
# median distance of three normal coordinates; coordinates a frame has, and is left
_MEDIAN_DISTANCE = 1.5382
_FREE_SHARE = 37.0 / 63.0


def _lasts(model: HandModel, material: Material, fits: solver.Results) -> Lasts:
    """What a clip's residuals show of how long its errors last."""
    good = np.isfinite(fits.objective)
    away = np.where(material.weights[..., None] > 0, material.joints - fits.joints, np.nan)[good]
    turn = fits.roots[good, :9].reshape(-1, 3, 3)
    return lasts(residuals(model, fits.angles[good], turn, away), material.time_ns[good])


class Round:
    """Chosen frames of each clip, and the hand's poses in them to start from."""

    def __init__(
        self,
        chains: Chains,
        start: HandModel,
        materials: list[Material],
        picks: list[NDArray[np.int64]],
        noises: list[float],
        detector: Noise | None = None,
    ):
        self.chains, self.frames = chains, sum(map(len, picks))
        self._detector = detector
        self._targets: list[Array] = []
        self._weights: list[Array] = []
        self._poses: list[Poses] = []
        self._noise: list[float] = []
        self._spread: list[float] = []
        self._worth: list[float] = []
        for material, pick, noise in zip(materials, picks, noises, strict=True):
            fits = material.fitted(start)
            off = np.linalg.norm(fits.joints - material.joints, axis=-1)
            seen = ALL_LASTS if detector else _lasts(start, material, fits)
            self._targets.append(np.nan_to_num(material.joints[pick]))
            self._weights.append(material.weights[pick])
            self._poses.append(poses_of(start, fits, pick))
            self._noise.append(max(_FLOOR, material.left, noise))
            span = 1e-9 * float(material.time_ns[-1] - material.time_ns[0])
            self._worth.append(worth_of(len(pick), span, noise, material.left, detector, seen))
            self._spread.append(max(_STRAYS_LEAST, _STRAYS * float(np.nanmedian(off))))

    def _clips(self, moves: Freedoms) -> tuple[list[Clip], Array]:
        """The clips, each with a drift of its own where there are several, and the prior."""
        n, clips = moves.n, len(self._targets)
        drift, _ = shape(self.chains)
        m = drift.shape[1] if clips > 1 else 0
        precision = np.zeros((n + m * clips,) * 2)
        precision[:n, :n] = moves.precision
        k = np.arange(n, n + m * clips)
        precision[k, k] = 1.0 / DRIFT**2
        made = []
        for i in range(clips):
            basis = np.zeros((5 * SIZE, n + m * clips))
            basis[:, :n] = moves.basis
            if m:
                basis[:, n + i * m : n + (i + 1) * m] = drift
            made.append(
                Clip(
                    self.chains,
                    self._targets[i],
                    self._weights[i],
                    np.zeros((5, SIZE)),
                    basis,
                    self._noise[i],
                    self._spread[i],
                    self._worth[i],
                )
            )
        return made, precision

    def solve(
        self, moves: Freedoms, free: Array, max_steps: int = 40, tolerance: float = 2e-4
    ) -> Solution:
        """The bundle adjustment from the last poses, and from `free` (n,) without drift."""
        clips, precision = self._clips(moves)
        start = np.zeros(len(precision))
        start[: moves.n] = free
        solution = solve(clips, precision, start, self._poses, max_steps, tolerance)
        self._poses = solution.poses
        return solution

    def misfits(self, moves: Freedoms, solution: Solution) -> list[float]:
        """How far joints are from what the hand explains, as a noise per coordinate [m]."""
        clips, _ = self._clips(moves)
        out = []
        for clip, poses in zip(clips, solution.poses, strict=True):
            d = clip.distances(solution.free, poses)[clip.weights > 0]
            out.append(float(np.median(d)) / _MEDIAN_DISTANCE / np.sqrt(_FREE_SHARE))
        return out

    def constants(self, moves: Freedoms, solution: Solution) -> Array:
        """(100,) constants of the subject: what is shared, and what clips have most alike beside.

        What the prior draws all clips' drifts for the hand's own would else stay in them.
        """
        own = moves.basis @ solution.free[: moves.n]
        clips = len(self._targets)
        if clips == 1:
            return own
        drift, _ = shape(self.chains)
        each = solution.free[moves.n :].reshape(clips, -1)
        return np.asarray(own + drift @ np.median(each, axis=0))

    def rest_covariance(self, moves: Freedoms, solution: Solution) -> Array:
        """(63, 63) of rest joints [m^2], of what the frames leave open."""
        _, precision = self._clips(moves)
        said = solution.information
        if self._detector is not None:
            # they fit better than the detector is near: bones give way to its errors
            off = float(np.square(self._detector.total).mean())
            said = said * min(1.0, float(np.square(self._noise).mean()) / max(off, _FLOOR**2))
        left = np.linalg.inv(precision + said)[: moves.n, : moves.n]
        rest = by_constants() @ moves.basis
        return np.asarray(rest @ left @ rest.T)

    def drifts(self, moves: Freedoms, solution: Solution) -> tuple[float, ...]:
        clips, _ = self._clips(moves)
        if len(clips) == 1:
            return (0.0,)

        def lengths(shared: Array) -> Array:
            bones = self.chains.constants(shared.reshape(5, SIZE))[1]
            return np.asarray(np.linalg.norm(bones, axis=-1))

        own = lengths(moves.basis @ solution.free[: moves.n])
        return tuple(
            float(np.abs(lengths(clip.basis @ solution.free) - own).max()) for clip in clips
        )
