"""Which frames of an estimate and of a truth belong together: what is stated comes first."""

from dataclasses import dataclass

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError
from handtrack.evaluation.frame_match import match_frames
from handtrack.evaluation.stability import stability_of_pair

FPS = 30.0
EPOCH = 1_700_000_000 * 10**9


@dataclass
class Frames:
    """Frames of one movement; `which` says which of it they truly are."""

    which: np.ndarray
    time_ns: np.ndarray
    frame_index: np.ndarray
    timed: bool = True
    numbered: bool = True

    def __len__(self):
        return len(self.which)


def frames(which, *, start_ns=0, clock=None, numbers=None, fps=FPS, timed=True):
    """Stamps and numbers as asked for: of the movement, or counted as where a file gives none."""
    which = np.array(which)
    place = np.arange(len(which))
    moments = which if clock is None else np.array(clock)
    return Frames(
        which,
        start_ns + np.round(moments / fps * 1e9).astype(np.int64),
        place if numbers is None else np.array(numbers),
        timed,
        numbers is not None,
    )


ALL = np.arange(60)
HOLES = np.delete(ALL, [7, 8, 30, 31, 32, 50])
LATE = ALL[10:]

# estimate, truth, how it is said to be matched; frames of one moment must be matched
RIGHT = {
    "the same clocks": (frames(ALL), frames(ALL), ""),
    "frames left out of one, its clock says so": (frames(HOLES), frames(ALL), ""),
    "frames left out of the truth": (frames(ALL), frames(HOLES), ""),
    "a late start that the clock says": (frames(LATE), frames(ALL), ""),
    "a late start, numbers counted from 0 by the file": (
        *(frames(LATE, numbers=np.arange(50)), frames(ALL, numbers=ALL)),
        "matched by their clocks, which the frame numbers contradict",
    ),
    "numbers of the file, both clocks from 0": (
        *(frames(LATE, clock=LATE - 10, numbers=LATE + 500), frames(ALL, numbers=ALL + 500)),
        "matched by frame number, where the clocks are 0.3333 s apart",
    ),
    "numbers of the file, another epoch": (
        *(frames(HOLES, start_ns=EPOCH, numbers=HOLES), frames(ALL, numbers=ALL), ""),
    ),
    "numbers from 0 in one and 1 in the other, one clock": (
        *(frames(ALL, numbers=ALL), frames(ALL, numbers=ALL + 1)),
        "matched by their clocks",
    ),
    "numbers of one file only": (frames(HOLES), frames(ALL, numbers=ALL), ""),
    "numbers counted through the holes": (
        *(frames(HOLES, numbers=np.arange(54)), frames(ALL, numbers=ALL)),
        "matched by their clocks",
    ),
    "epoch and zero, as many": (
        *(frames(ALL, start_ns=EPOCH), frames(ALL)),
        "the clocks are 1.7e+09 s apart: laid over each other",
    ),
    "epoch and zero, the same holes": (frames(HOLES, start_ns=EPOCH), frames(HOLES), "apart"),
    "epoch and zero, one way to lay them": (
        *(frames(HOLES[5:40], start_ns=EPOCH, clock=HOLES[5:40] - HOLES[5]), frames(HOLES)),
        "laid over each other",
    ),
    "no clock in one, as many": (
        *(frames(ALL, timed=False), frames(ALL, fps=60.0, start_ns=EPOCH)),
        "no clock in the estimate: matched by position, 60 frames each",
    ),
    "no clock in either, as many": (
        *(frames(ALL, timed=False), frames(ALL, timed=False)),
        "no clock in the estimate and the truth: matched by position",
    ),
    "no clock, but numbers": (
        *(frames(HOLES, timed=False, numbers=HOLES), frames(ALL, numbers=ALL), ""),
    ),
    "every other frame": (frames(ALL[::2], numbers=np.arange(30)), frames(ALL, numbers=ALL), ""),
    "a clock a third of a step off": (frames(ALL, start_ns=11_000_000), frames(ALL), ""),
}


@pytest.mark.parametrize("case", RIGHT)
def test_frames_of_one_moment_belong_together(case):
    estimate, truth, said = RIGHT[case]
    i, j, note = match_frames(estimate, truth)
    np.testing.assert_array_equal(estimate.which[i], truth.which[j])
    assert len(i) == len(np.intersect1d(estimate.which, truth.which))
    assert said in note
    assert bool(said) == bool(note)
    back, forth, _ = match_frames(truth, estimate)
    np.testing.assert_array_equal(truth.which[back], estimate.which[forth])


@pytest.mark.parametrize(
    ("estimate", "truth", "message"),
    [
        (
            *(frames(LATE, clock=LATE - 10, start_ns=EPOCH), frames(ALL)),
            r"can be laid over each other in 11 ways \(--match frame\|time\|position",
        ),
        (
            *(frames(HOLES, start_ns=EPOCH), frames(ALL)),
            "can be laid over each other in no ways",
        ),
        (
            *(frames(LATE, timed=False), frames(ALL)),
            "no clock in the estimate, .*the estimate has 50 frames, the truth 60: which belong",
        ),
        (
            *(frames(LATE, timed=False), frames(ALL, timed=False)),
            r"cannot be told \(--fps N gives both a clock, --match frame",
        ),
        (frames(ALL), frames(ALL, start_ns=10**9), "have only 30 frames in common|ways"),
        (frames(ALL), frames(ALL + 50), "only 10 frames in common"),
    ],
)
def test_what_cannot_be_told_is_refused_with_the_option(estimate, truth, message):
    if "30 frames" in message:  # half of them have a partner: that is enough
        assert len(match_frames(estimate, truth).estimate) == 30
        return
    with pytest.raises(InputError, match=message):
        match_frames(estimate, truth)


def test_no_match_is_farther_than_half_a_step():
    estimate = frames(ALL, clock=ALL + np.where(ALL % 4 == 0, 0.6, 0.1))
    i, j, _ = match_frames(estimate, frames(ALL), "time")
    apart = np.abs(estimate.time_ns[i] - frames(ALL).time_ns[j])
    assert apart.max() <= 0.5e9 / FPS
    assert len(i) >= 45


def test_the_caller_decides():
    estimate, truth = frames(LATE, timed=False), frames(ALL)
    assert match_frames(estimate, truth, "frame").truth.tolist() == list(range(50))
    with pytest.raises(InputError, match="has 50 frames, the truth 60"):
        match_frames(estimate, truth, "position")
    assert match_frames(frames(ALL), frames(ALL, numbers=ALL + 7), "position").note == ""


@pytest.fixture
def files(tmp_path, sample):
    """An estimate and a truth as files, with the fields asked for."""

    def write(name, rows, **fields):
        joints = sample.truth[rows] if name == "truth" else sample.joints[rows]
        np.savez(tmp_path / f"{name}.npz", joints_m=joints, hand=sample.hand, **fields)
        (found,) = ht.load(tmp_path / f"{name}.npz")
        return found

    return write


def test_a_file_without_frame_numbers_is_not_matched_by_places(files, sample):
    """The estimate lacks ten frames in the middle; only its clock says which."""
    rows = np.delete(np.arange(len(sample)), np.arange(100, 110))
    truth = files("truth", slice(None), time_ns=sample.time_ns)
    estimate = files("estimate", rows, time_ns=sample.time_ns[rows])
    assert not estimate.numbered
    found = stability_of_pair(estimate, truth)
    whole = stability_of_pair(files("estimate", slice(None), time_ns=sample.time_ns), truth)
    assert found.mpjpe_mm.mean == pytest.approx(whole.mpjpe_mm.mean, rel=0.05)
    assert "10 of 300 frames of the truth have no estimate" in found.notes


def test_a_track_knows_what_was_assumed(files, sample, tmp_path):
    estimate = files("estimate", slice(0, 60))
    track = ht.track(estimate)
    assert not track.timed
    assert not track.numbered
    ht.write_mcap([track], tmp_path / "a.mcap")
    (again,) = ht.read_mcap(tmp_path / "a.mcap")
    assert not again.timed
    assert not again.numbered
    truth = files("truth", slice(0, 60), time_ns=EPOCH + 2 * sample.time_ns[:60])
    found = stability_of_pair(again, truth)
    assert "no clock in the estimate: matched by position, 60 frames each" in found.notes
    stated = ht.track(files("estimate", slice(0, 60), fps=30.0, frame_index=np.arange(60)))
    assert stated.timed
    assert stated.numbered
    assert "assumed" not in stated.settings
