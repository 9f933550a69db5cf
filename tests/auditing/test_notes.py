"""Notes of readers say what they are about; an audit goes by that, not by their words."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import handtrack as ht
from handtrack.auditing.notes import note_findings
from handtrack.sequences.note import Note

N = 60
TIME = np.arange(N) / 50


def a_leap(time):
    time[30:] += 3 * 86400


def a_clock_set_back(time):
    time[30:] -= 3600


def a_stray(time):
    time[20] = 500.0


def stamps_twice(time):
    time[11], time[41] = time[10], time[40]


def another_order(time):
    time[[5, 6]] = time[[6, 5]]


@pytest.fixture
def read(tmp_path, sample):
    def of(time, **more):
        path = tmp_path / "clip.npz"
        np.savez(path, joints=sample.joints[:N], time=time, hand="right", **more)
        return ht.load(path)[0]

    return of


@pytest.mark.parametrize(
    ("fault", "frames"),
    [
        (a_leap, (30,)),
        (a_clock_set_back, (30,)),
        (a_stray, (20,)),
        (stamps_twice, (11, 41)),
        (another_order, ()),
    ],
)
def test_a_clock_that_was_cured_is_told_at_its_frames(read, fault, frames):
    time = TIME.copy()
    fault(time)
    sequence = read(time)
    (found,) = note_findings(sequence, {})
    assert found.kind == "time"
    marked = np.flatnonzero(found.marks.any(1)) if frames else ()
    assert tuple(marked) == frames
    assert frames or (found.marks == sequence.present).all()


def test_what_is_no_fault_is_not_told(read):
    assert not list(note_findings(read(TIME), {}))
    counted = read(np.arange(N))  # counted frames: a note, but no fault
    assert counted.notes
    assert not list(note_findings(counted, {}))


def test_words_alone_say_nothing(read):
    sequence = read(TIME)
    said = "time goes back by 2 s at frame 7"
    assert not list(note_findings(replace(sequence, notes=(said,)), {}))
    (found,) = note_findings(replace(sequence, notes=(Note(said, "time", (7, 10**6)),)), {})
    assert np.flatnonzero(found.marks.any(1)).tolist() == [7, N - 1]


def test_a_note_is_a_text_that_keeps_what_it_is_about():
    note = Note("inner.csv: time leaps", "time", (3,))
    for one in (note, pickle.loads(pickle.dumps(note)), Note.of(note)):
        assert (one, one.about, one.frames) == ("inner.csv: time leaps", "time", (3,))
    named = note.renamed("inner.csv", "a.zip/inner.csv")
    assert (named, named.about, named.frames) == ("a.zip/inner.csv: time leaps", "time", (3,))
    assert Note.of("anything").about == ""
    assert type(str(note)) is str
