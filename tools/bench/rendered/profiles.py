"""Detector profiles of the bench's clips: what ships, and each subject's from the others."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from collections.abc import Sequence as Many
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.detectors.profile import IN_SPACE, Profile, save_profile
from handtrack.detectors.profile import ONE_CAMERA as ONE
from handtrack.errors import InputError
from handtrack.evaluation.landmarks import Seen, estimate_profile
from tools.bench.rendered.cases import ONE_CAMERA, TRIANGULATED, Case

NAMES = {ONE_CAMERA: "mediapipe", TRIANGULATED: "mediapipe-3d"}
"""The profiles that ship, by the bench's inputs."""
_VIEW = np.array([0.0, 0.0, 1.0])


def seen_of(case: Case) -> Seen:
    """The frames of a case with all joints."""
    view = _VIEW if case.centred else None
    return Seen.of(case.sequence, case.clip.truth_joints, case.model, view)


def profile_of(cases: Many[Case], name: str, seen: Many[Seen]) -> Profile:
    """The profile that clips of one input show; `seen` is `seen_of` each."""
    first = cases[0]
    kind = ONE if first.centred else IN_SPACE
    found = estimate_profile(seen, name, first.clip.detector or "mediapipe", kind)
    subjects = len({c.clip.subject for c in cases})
    return replace(found, evidence={**found.evidence, "subjects": subjects})


class Profiles:
    """For each case a profile that does not know its subject, as a file or by its name.

    Args:
        cases: of all clips, and of others to learn from.
        shipped: take the profiles that ship, whose subjects are none of these.
    """

    def __init__(self, cases: Many[Case], shipped: bool = False) -> None:
        self._cases, self._shipped = cases, shipped
        self._made: dict[tuple[str, str], str] = {}
        self._seen: dict[tuple[str, str], Seen] = {}

    @cached_property
    def _folder(self) -> tempfile.TemporaryDirectory[str]:
        return tempfile.TemporaryDirectory()

    def __call__(self, case: Case) -> str:
        """What `detector` is for a case.

        Raises:
            InputError: no other subject is there.
        """
        if self._shipped:
            return NAMES.get(case.input, "none")
        key = case.input, case.clip.subject
        if key not in self._made:
            others = [
                c
                for c in self._cases
                if c.input == case.input and c.clip.subject != case.clip.subject
            ]
            if not others:
                raise InputError(f"{case.clip.name}: no other subject to learn a profile from")
            path = Path(self._folder.name) / f"{NAMES.get(case.input, 'own')}-{key[1]}.json"
            save_profile(profile_of(others, path.stem, [self._of(c) for c in others]), path)
            self._made[key] = str(path)
        return self._made[key]

    def _of(self, case: Case) -> Seen:
        key = case.input, case.clip.name
        if key not in self._seen:
            self._seen[key] = seen_of(case)
        return self._seen[key]


def make_shipped(cases: Many[Case], folder: Path, say: Callable[[str], None]) -> None:
    """Write the profiles that ship, with their evidence.

    Args:
        cases: of the clips to tune on and to learn from.
        folder: handtrack/detectors/data.
        say: told what was found.
    """
    for given, name in NAMES.items():
        mine = [c for c in cases if c.input == given]
        seen = [seen_of(c) for c in mine]
        found = profile_of(mine, name, seen)
        evidence: dict[str, Any] = {
            **found.evidence,
            "from": "tools/bench/rendered, clips to tune on and to learn from: drawn hands,"
            " MediaPipe in video mode; corrected_mm of people left out",
        }
        save_profile(replace(found, evidence=evidence), folder / f"{name}.json")
        say(f"{name}: {evidence}")
