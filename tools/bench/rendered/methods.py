"""The methods of the study: each turns a case's joints into an estimate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

import handtrack as ht
from handtrack.evaluation.metrics import pa_mpjpe
from tools.bench.oracles import savgol
from tools.bench.rendered.bones import learnt_offsets, moved_by
from tools.bench.rendered.cases import Case
from tools.bench.rendered.layout import Array

WINDOWS = (3, 5, 7, 9, 11, 13, 15, 19, 25)
ORDERS = (0, 2, 4)


class Estimate(NamedTuple):
    """joints (T, 21, 3) [m], angles (T, 20) [rad] or None, and a note, to be read."""

    joints: Array
    angles: Array | None
    note: str = ""


Method = Callable[[Case], Estimate]

RAW = "raw"


def raw(case: Case) -> Estimate:
    """The detections as they are."""
    return Estimate(case.joints, None)


def best_savgol(case: Case) -> Estimate:
    """Savitzky-Golay with the window and degree that suit the clip's truth best."""
    tried = [
        Estimate(savgol(case.joints, window, order), None, f"window {window}, degree {order}")
        for order in ORDERS
        for window in WINDOWS
        if order < window <= len(case.joints)
    ]
    seen = np.isfinite(pa_mpjpe(case.joints, case.clip.truth_joints))

    def error(one: Estimate) -> float:
        pa = pa_mpjpe(one.joints, case.clip.truth_joints)[seen]
        # a smoother that leaves frames out is not compared on the easy ones
        return float(pa.mean()) if np.isfinite(pa).mean() > 0.98 else np.inf

    def filled(one: Estimate) -> Estimate:
        return one._replace(joints=np.where(np.isnan(one.joints), case.joints, one.joints))

    return min([filled(one) for one in tried], key=error)


def tracked(case: Case, settings: Mapping[str, Any], model: ht.HandModel | None = None) -> Estimate:
    """`handtrack.track` with its defaults, or with some settings."""
    track = ht.track(case.sequence, model, **settings)
    return Estimate(track.filtered_joints, track.angles)


def with_settings(settings: Mapping[str, Any]) -> Method:
    """`tracked` with those settings."""
    return lambda case: tracked(case, settings)


def louder(times: float, settings: Mapping[str, Any]) -> Method:
    """Tracked with a multiple of the noise that the plain fit leaves."""

    def method(case: Case) -> Estimate:
        plain = ht.track(case.sequence)
        left = np.nanmedian(plain.objective[plain.status == "fitted"])
        noise_mm = times * 1e3 * float(np.sqrt(left / (63 - 26)))
        return tracked(case, {**settings, "noise_mm": noise_mm})._replace(note=f"{noise_mm:.1f} mm")

    return method


def on_true_hand(settings: Mapping[str, Any]) -> Method:
    """Tracked on the true subject's hand, only scaled: an oracle."""

    def method(case: Case) -> Estimate:
        if case.model is None:
            return Estimate(np.full_like(case.joints, np.nan), None, "no true hand")
        return tracked(case, {"calibrate": False, **settings}, case.model)

    return method


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


def standard(all_cases: list[Case]) -> dict[str, Method]:
    """The rows of the study's table, by name; raw first."""
    rows: dict[str, Method] = {RAW: raw, "savitzky-golay, oracle": best_savgol}
    rows["fit, calibrated"] = with_settings({})
    rows["fit, template"] = with_settings({"calibrate": False})
    for name in ("one-euro", "kalman", "fixed-lag", "rts"):
        rows[name] = with_settings({"filter": name})
    rows["rts, template"] = with_settings({"filter": "rts", "calibrate": False})
    rows["rts, 3 x noise"] = louder(3.0, {"filter": "rts"})
    rows["rts, true hand (oracle)"] = on_true_hand({"filter": "rts"})
    rows["constant offsets, no fit"] = offsets(all_cases)
    return rows
