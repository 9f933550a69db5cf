"""The methods of the study: each turns a case's joints into an estimate."""

from __future__ import annotations

import json
from collections.abc import Callable
from collections.abc import Sequence as Many
from typing import Any, NamedTuple

import numpy as np

import handtrack as ht
from handtrack.errors import SettingsError
from handtrack.evaluation.metrics import pa_mpjpe
from tools.bench.oracles import savgols
from tools.bench.rendered.bones import learnt_offsets, moved_by
from tools.bench.rendered.cases import Case
from tools.bench.rendered.layout import Array
from tools.bench.rendered.pictured import seen_by_cameras, seen_in_picture
from tools.bench.rendered.profiles import Profiles

WINDOWS = (3, 5, 7, 9, 11, 13, 15, 19, 25)
"""Windows of the Savitzky-Golay filter that are tried on clips [frames]."""


class Estimate(NamedTuple):
    """joints (T, 21, 3) [m], angles (T, 20) [rad] or None, and a note, to be read."""

    joints: Array
    angles: Array | None
    note: str = ""


Method = Callable[[Case], Estimate]

RAW = "raw"


def raw(case: Case) -> Estimate:
    """The detections as they are; of several cameras triangulated as clips were made with."""
    return Estimate(case.raw, None)


def triangulated(case: Case) -> Estimate:
    """What methods are given of several cameras: as handtrack triangulates today."""
    if case.stored is None:
        return Estimate(np.full_like(case.joints, np.nan), None, "not of several cameras")
    return Estimate(case.joints, None)


def best_savgol(case: Case) -> Estimate:
    """Savitzky-Golay with the window and degree that suit the clip's truth best."""
    tried = [Estimate(best.joints, None, best.parameters) for best in savgols(case.joints, WINDOWS)]
    seen = np.isfinite(pa_mpjpe(case.joints, case.clip.truth_joints))

    def error(one: Estimate) -> float:
        pa = pa_mpjpe(one.joints, case.clip.truth_joints)[seen]
        # a smoother that leaves frames out is not compared on the easy ones
        return float(pa.mean()) if np.isfinite(pa).mean() > 0.98 else np.inf

    def filled(one: Estimate) -> Estimate:
        return one._replace(joints=np.where(np.isnan(one.joints), case.joints, one.joints))

    return min([filled(one) for one in tried], key=error)


class Tracking:
    """`handtrack.track` in its ways; the calibration of a case is made once for all filters.

    Tracking again on the hand that was found, taken as it is, equals calibrating again.
    """

    def __init__(self) -> None:
        self._case: Case | None = None
        self._plain: ht.Track | None = None

    def plain(self, case: Case) -> ht.Track:
        """Calibrated, fitted, not filtered."""
        if self._plain is None or self._case is not case:
            self._case, self._plain = case, ht.track(case.sequence)
        return self._plain

    def calibrated(self, **settings: Any) -> Method:
        """On the hand calibrated in the case itself."""

        def method(case: Case) -> Estimate:
            plain = self.plain(case)
            if not settings:
                return _of(plain)
            return _of(ht.track(case.sequence, plain.model, calibrate="none", **settings))

        return method

    def louder(self, times: float, **settings: Any) -> Method:
        """The same, told a multiple of the noise that the plain fit leaves."""

        def method(case: Case) -> Estimate:
            plain = self.plain(case)
            left = np.nanmedian(plain.objective[plain.status == "fitted"])
            noise_mm = times * 1e3 * float(np.sqrt(left / (3 * 21 - 26)))
            told = self.calibrated(noise_mm=noise_mm, **settings)
            return told(case)._replace(note=f"{noise_mm:.1f} mm")

        return method


def with_settings(settings: dict[str, Any]) -> Method:
    """`handtrack.track` with those settings and nothing else."""
    return lambda case: _of(ht.track(case.sequence, **settings))


def template(**settings: Any) -> Method:
    """On the default hand, only scaled."""
    return with_settings({"calibrate": False, **settings})


def on_true_hand(**settings: Any) -> Method:
    """On the true subject's hand, only scaled: an oracle."""

    def method(case: Case) -> Estimate:
        if case.model is None:
            return Estimate(np.full_like(case.joints, np.nan), None, "no true hand")
        return _of(ht.track(case.sequence, case.model, calibrate=False, **settings))

    return method


def _of(track: ht.Track) -> Estimate:
    return Estimate(track.filtered_joints, track.angles)


def offsets(all_cases: list[Case]) -> Method:
    """Constant landmark offsets learnt on the other subjects' clips, put on; no fit."""

    def method(case: Case) -> Estimate:
        others = [
            (c.joints, c.clip.truth_joints, c.clip.hand)
            for c in all_cases
            if c.input == case.input and c.clip.subject != case.clip.subject
        ]
        if not others:
            return Estimate(np.full_like(case.joints, np.nan), None, "no other subject")
        return Estimate(moved_by(case.joints, learnt_offsets(others), case.clip.hand), None)

    return method


def profiled(profiles: Profiles, **settings: Any) -> Method:
    """With a detector profile that does not know the subject."""
    return lambda case: _of(ht.track(case.sequence, detector=profiles(case), **settings))


def true_hand_profiled(profiles: Profiles, **settings: Any) -> Method:
    """The same on the true subject's hand, only scaled: an oracle."""

    def method(case: Case) -> Estimate:
        if case.model is None:
            return Estimate(np.full_like(case.joints, np.nan), None, "no true hand")
        wanted = {"calibrate": False, "detector": profiles(case), **settings}
        return _of(ht.track(case.sequence, case.model, **wanted))

    return method


def with_picture(profiles: Profiles, filter: str, lens: bool = True) -> Method:
    """One camera's joints and picture together; of other inputs nothing.

    Without the lens it is what `handtrack.track` does with a video by default.
    """

    def method(case: Case) -> Estimate:
        track = seen_in_picture(case, profiles, filter, lens)
        if track is None:
            return Estimate(np.full_like(case.joints, np.nan), None, "not of one camera")
        return _of(track)

    return method


def with_cameras(profiles: Profiles, filter: str) -> Method:
    """The pictures of several cameras, as `track --camera` follows them; of others nothing."""

    def method(case: Case) -> Estimate:
        track = seen_by_cameras(case, profiles, filter)
        if track is None:
            return Estimate(np.full_like(case.joints, np.nan), None, "not of several cameras")
        return _of(track)

    return method


def standard(
    all_cases: list[Case], shipped: bool = False, others: Many[Case] = ()
) -> dict[str, Method]:
    """The rows of the study's table, by name; raw first.

    Args:
        all_cases: profiles and offsets are learnt from the other subjects among them.
        shipped: use the profiles that ship instead.
        others: more to learn profiles from.
    """
    rows: dict[str, Method] = {RAW: raw, "triangulated anew": triangulated}
    rows["savitzky-golay, oracle"] = best_savgol
    tracking = Tracking()
    rows["fit, calibrated"] = tracking.calibrated()
    rows["fit, template"] = template()
    for name in ("one-euro", "kalman", "fixed-lag", "rts"):
        rows[name] = tracking.calibrated(filter=name)
    rows["rts, template"] = template(filter="rts")
    rows["rts, 3 x noise"] = tracking.louder(3.0, filter="rts", noise_colour="white")
    rows["rts, true hand (oracle)"] = on_true_hand(filter="rts")
    rows["constant offsets, no fit"] = offsets(all_cases)
    profiles = Profiles([*all_cases, *others], shipped)
    rows["fit, template, profile"] = profiled(profiles, calibrate=False)
    rows["fit, calibrated, profile"] = profiled(profiles)
    for name in ("fixed-lag", "rts"):
        rows[f"{name}, calibrated, profile"] = profiled(profiles, filter=name)
    for name in ("none", "fixed-lag", "rts"):
        said = "fit" if name == "none" else name
        rows[f"{said}, default of a video, profile"] = with_picture(profiles, name, lens=False)
        rows[f"{said}, default of several cameras, profile"] = with_cameras(profiles, name)
    rows["rts, picture and its lens, profile"] = with_picture(profiles, "rts")
    rows["rts, true hand, profile (oracle)"] = true_hand_profiled(profiles, filter="rts")
    return rows


def chosen(
    all_cases: list[Case],
    only: Many[str] = (),
    also: Many[tuple[str, str]] = (),
    shipped: bool = False,
    others: Many[Case] = (),
) -> dict[str, Method]:
    """The standard rows of which a name holds one of some words, and rows of one's own; raw first.

    Args:
        all_cases, shipped, others: as for `standard`.
        only: words; all rows without any.
        also: name, and settings of `handtrack.track` as a JSON object.

    Raises:
        SettingsError: settings are no JSON object.
    """
    rows = standard(all_cases, shipped, others)
    if only:
        rows = {n: m for n, m in rows.items() if n == RAW or any(word in n for word in only)}
    for name, text in also:
        try:
            settings = json.loads(text)
        except json.JSONDecodeError as error:
            raise SettingsError(f"{name}: {text} is no JSON ({error})") from None
        if not isinstance(settings, dict):
            raise SettingsError(f"{name}: {text}, expected an object of settings of ht.track")
        rows[name] = with_settings(settings)
    return rows
