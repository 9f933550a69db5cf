"""Tables of the accuracy page: what each step brings, and errors over what is said of them."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Sequence as Many
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import handtrack as ht
from handtrack.detectors.profile import load_profile, save_profile
from tools.bench.rendered.bones import aligned
from tools.bench.rendered.cases import ONE_CAMERA, TRIANGULATED, Case
from tools.bench.rendered.layout import Array
from tools.bench.rendered.measures import measure, summary
from tools.bench.rendered.methods import (
    Estimate,
    Method,
    raw,
    with_cameras,
    with_picture,
    with_settings,
)
from tools.bench.rendered.profiles import Profiles
from tools.make.sample import motion

FILTERS = {"fit": "none", "kalman": "kalman", "fixed-lag": "fixed-lag", "rts": "rts"}
WHITE_M = 0.002
WHITE_CLIPS = 3

Table = dict[str, Any]


def ladder(measured: Many[Case], others: Many[Case]) -> Table:
    """`rts` with one thing more in each row, against raw and against the row before.

    Args:
        measured: clips to tune on.
        others: more to learn profiles from; a subject's own clips are never learnt from.
    """
    profiles = Profiles([*measured, *others])
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for given in (ONE_CAMERA, TRIANGULATED):
            mine = [case for case in measured if case.input == given]
            base = [_measured(raw, case) for case in mine]
            before = base
            for name, method in _steps(given, profiles, Path(folder)).items():
                found = [_measured(method, case) for case in mine]
                rows.append([given, name, *_cells(found, base, before)])
                before = found
    head = ["input", "rts", "of raw", "of the row before", "moving, of raw"]
    return {
        "head": [*head, "acc., m/s²", "jitter (truth's), m/s³", "angles, degrees"],
        "rows": rows,
    }


def _steps(given: str, profiles: Profiles, folder: Path) -> dict[str, Method]:
    def without_correction(case: Case) -> Estimate:
        path = folder / Path(profiles(case)).name
        if not path.exists():
            save_profile(replace(load_profile(profiles(case)), correction=None), path)
        return with_settings({"filter": "rts", "detector": str(path)})(case)

    def corrected(case: Case) -> Estimate:
        return with_settings({"filter": "rts", "detector": profiles(case)})(case)

    last: dict[str, Method] = (
        {"joints and picture (default of a video)": with_picture(profiles, "rts", lens=False)}
        if given == ONE_CAMERA
        else {"all pictures (default of several cameras)": with_cameras(profiles, "rts")}
    )
    return {
        "template, only scaled": with_settings({"filter": "rts", "calibrate": False}),
        "calibrated": with_settings({"filter": "rts"}),
        "profile: offsets and noise": without_correction,
        "profile: correction": corrected,
        **last,
    }


def _measured(method: Method, case: Case) -> dict[str, float]:
    found = method(case)
    return measure(found.joints, found.angles, case)


def _cells(
    found: list[dict[str, float]], base: list[dict[str, float]], before: list[dict[str, float]]
) -> list[str]:
    mine, step = summary(found, base), summary(found, before)
    return [
        *("{:.3f} [{:.3f}, {:.3f}]".format(*one["pa_mm_ratio"]) for one in (mine, step)),
        f"{mine['moving_mm_ratio'].value:.2f}",
        f"{mine['acceleration'].value:.2f}",
        f"{mine['jitter'].value:.0f} ({mine['jitter_truth'].value:.0f})",
        f"{mine['angle_deg'].value:.1f}",
    ]


def uncertainty(measured: Many[Case], others: Many[Case], held: Many[Case]) -> Table:
    """Errors over the deviations that tracks say, root mean square: angles / joints.

    Args:
        measured: clips to tune on.
        others: more to learn profiles from; a subject's own clips are never learnt from.
        held: clips held out, measured with the profiles that ship.
    """
    rows = [["white noise", *(_white(filter) for filter in FILTERS.values())]]
    for said, some, profiles in (
        ("{}, profile", measured, Profiles([*measured, *others])),
        ("held out, {}", held, Profiles([], shipped=True)),
    ):
        for given in (ONE_CAMERA, TRIANGULATED):
            mine = [case for case in some if case.input == given]
            cells = [_ratio([_of(c, profiles(c), f) for c in mine]) for f in FILTERS.values()]
            rows.append([said.format(given), *cells])
    return {"head": ["", *FILTERS], "rows": rows}


def _of(case: Case, detector: str, filter: str) -> tuple[float, float]:
    track = ht.track(case.sequence, detector=detector, filter=filter)
    truth = case.clip.truth_joints
    found = aligned(track.filtered_joints, truth) if case.centred else track.filtered_joints
    return _standardised(track, found, truth, case.angles)


def _white(filter: str) -> str:
    """White noise on the sample's movement of the default hand."""
    model, pairs = ht.HandModel.default("right"), []
    for seed in range(WHITE_CLIPS):
        rng = np.random.default_rng([seed, 17])
        angles, rotation, translation = motion(10.0, 30.0, rng)
        truth = model.joints(angles, rotation, translation)
        seen = truth + rng.normal(0, WHITE_M, truth.shape)
        time_ns = np.rint(np.arange(len(truth)) * 1e9 / 30).astype(np.int64)
        track = ht.track(ht.Sequence(time_ns, seen, hand="right"), filter=filter)
        pairs.append(_standardised(track, track.filtered_joints, truth, angles))
    return _ratio(pairs)


def _standardised(
    track: ht.Track, joints: Array, truth: Array, angles: Array | None
) -> tuple[float, float]:
    fitted = track.status == "fitted"
    off = ((joints - truth) / track.joint_deviation()[..., None])[fitted]
    if angles is None:
        return np.nan, float(np.sqrt(np.nanmean(off**2)))
    # an angle that is held at its limit is said to be exact
    variance = np.where(track.angle_variance > 0, track.angle_variance, np.nan)
    turned = ((track.angles - angles) ** 2 / variance)[fitted]
    return float(np.sqrt(np.nanmean(turned))), float(np.sqrt(np.nanmean(off**2)))


def _ratio(pairs: list[tuple[float, float]]) -> str:
    turned, off = np.sqrt(np.mean(np.square(pairs), axis=0))
    return f"{turned:.2f} / {off:.2f}"


def write_table(found: Table, path: Path) -> None:
    """As the documentation keeps tables of a run."""
    path.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n")
