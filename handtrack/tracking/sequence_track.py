"""The joints of a whole sequence tracked, with the subject's hand found first."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.calibrate import calibrate
from handtrack.calibration.explain import doubt, explain
from handtrack.calibration.lasting import lasting_errors
from handtrack.calibration.settings import CalibrationSettings
from handtrack.detectors.chosen import AUTO, seen_by, why
from handtrack.detectors.profile import Profile
from handtrack.errors import InputError
from handtrack.files.long_arrays import evenly, release
from handtrack.fitting.fit import fit_batch
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_JOINTS
from handtrack.mcap.hand import Event, Head
from handtrack.mcap.state import Stretch
from handtrack.sequences.sequence import Remark, Sequence
from handtrack.tracking.block import Block, EventsOf
from handtrack.tracking.settings import TrackSettings
from handtrack.tracking.track import LongTrack, Track
from handtrack.tracking.tracker import Tracker

Array = NDArray[np.float64]

# frames that are fitted at once in a whole sequence
_CHUNK = 256
# poses over which what lasts is averaged
_LASTING = 12
# frames by which a calibrated hand is judged
_EXPLAINED = 100


def track_joints(
    sequence: Sequence,
    model: HandModel | None,
    settings: TrackSettings,
    progress: Callable[[int], None] | None = None,
    on_part: Callable[[Stretch], None] | None = None,
) -> Track:
    """Track a whole sequence by its joints alone.

    Args:
        sequence, model, progress, on_part: as of `handtrack.track`, which fits the pictures of a
            camera too where a sequence has them.
        settings: how to track.

    Raises:
        InputError: as it does.
    """
    if model is None:
        model = HandModel.default(sequence.hand)
    elif model.hand != sequence.hand:
        raise InputError(
            f"the model is a {model.hand} hand, the sequence a {sequence.hand} one",
            sequence.source or None,
        )
    model, profile = seen_by(model, settings.detector, sequence.detector)
    fitted = sequence.corrected(profile)
    hand, found, notes, open_rest = _subject(model, fitted, settings.calibration, profile)
    if profile is not None and not settings.lasting_deg:
        settings = settings.but(**_lasting(hand, fitted, profile, open_rest))
    tracker = Tracker(hand, settings=settings, profile=profile)
    told = {
        **settings.to_dict(),
        "calibration": found,
        "limits": model.limits.name,
        "model": model.name,
        **_detector_said(settings, profile),
        **_input_said(sequence),
    }

    head = Head.of(
        hand,
        sequence.name,
        told,
        source=sequence.source,
        subject=sequence.subject,
        has_truth=sequence.truth is not None,
    )
    events = [Event(int(sequence.time_ns[0]), "warning", str(note)) for note in notes]
    if progress is not None:
        progress(0)
    happened, made, done = EventsOf(), LongTrack(), 0
    for block in _blocks(tracker, sequence):
        part = slice(done, done + len(block))
        truth = None if sequence.truth is None else sequence.truth[part]
        stretch = block.stretch(head, sequence.frame_index[part], truth)
        events += sorted(
            happened(stretch) + _begun(sequence.remarks, stretch), key=lambda event: event.time_ns
        )
        reason = _with_remarks(stretch, sequence.remarks)
        stretch = replace(stretch, reason=reason, events=tuple(events))
        made.append(stretch)
        events, done = [], part.stop
        if on_part is not None:
            on_part(stretch)
        if progress is not None:
            progress(done)
        release()
    return made.track()


def _detector_said(settings: TrackSettings, profile: Profile | None) -> dict[str, object]:
    if profile is None:
        return {}
    name = profile.name if settings.detector == AUTO else settings.detector
    said: dict[str, object] = {"detector": name, "detector_why": why(settings.detector)}
    # what is written as observed is not what was fitted
    return said | ({} if profile.correction is None else {"detector_corrects": True})


def _subject(
    model: HandModel,
    sequence: Sequence,
    settings: CalibrationSettings,
    profile: Profile | None,
) -> tuple[HandModel, dict[str, Any], list[str], Array]:
    """The hand to fit, what was found of it, what the user should know, and the covariance of
    its rest joints."""
    notes = list(sequence.notes)
    if settings.by == "none":
        return model, {}, notes, np.zeros((3 * N_JOINTS, 3 * N_JOINTS))
    calibration = calibrate(
        model,
        sequence,
        settings.by,
        frames=settings.frames,
        noise=None if profile is None else profile.noise,
    )
    notes += calibration.notes
    found = calibration.summary()
    if calibration.method in ("full", "lengths"):
        found |= explain(calibration.model, sequence, _EXPLAINED).summary()
        doubtful = doubt(found)
        notes += [doubtful] if doubtful else []
    return calibration.model, found, notes, calibration.rest_covariance


def _lasting(
    hand: HandModel, sequence: Sequence, profile: Profile, open_rest: Array
) -> dict[str, list[float]]:
    """Settings that say what lasts in the errors of a sequence's poses; none without a pose."""
    whole = np.flatnonzero(np.isfinite(sequence.joints).all((1, 2)))
    if not hand.has_landmarks or not whole.size:
        return {}
    pick = evenly(whole, _LASTING)
    fits = fit_batch(hand, sequence.joints[pick])
    found = lasting_errors(hand, profile.noise, open_rest, fits.angles)
    return {
        "lasting_deg": np.rad2deg(found.angles).round(4).tolist(),
        "lasting_mm": (1e3 * found.joints).round(4).tolist(),
    }


def _input_said(sequence: Sequence) -> dict[str, Any]:
    """What a track is to hold of its input beside the joints."""
    said: dict[str, Any] = {}
    if sequence.cameras is not None:
        said["cameras"] = dict(sequence.cameras)
    if sequence.remarks:
        # what was done to the input is not seen in it, and belongs to the result
        said["remarks"] = [[r.first_ns, r.last_ns, r.text, r.kind] for r in sequence.remarks]
    # what the source does not say of time, so that nobody compares by it
    assumed = {"time": not sequence.timed, "frame numbers": not sequence.numbered}
    if any(assumed.values()):
        said["assumed"] = [name for name, is_so in assumed.items() if is_so]
    return said


def _blocks(tracker: Tracker, sequence: Sequence) -> Iterator[Block]:
    """The frames of a sequence, some at a time, as they become final."""
    for t in range(0, len(sequence), _CHUNK):
        part = slice(t, t + _CHUNK)
        # copies: the sequence's own arrays are not to be written to
        joints, w = np.array(sequence.joints[part]), np.array(sequence.confidence[part])
        yield from tracker._advance(np.array(sequence.time_ns[part]), joints, w)
    for block in tracker._rest():
        for t in range(0, len(block), _CHUNK):
            yield block.part(slice(t, t + _CHUNK))


def _begun(remarks: Iterable[Remark], part: Stretch) -> list[Event]:
    """An event for every remark that begins in these frames."""
    first, last = int(part.time_ns[0]), int(part.time_ns[-1])
    return [Event(r.first_ns, "info", r.text) for r in remarks if first <= r.first_ns <= last]


def _with_remarks(part: Stretch, remarks: Iterable[Remark]) -> NDArray[np.str_]:
    """(T,) the reasons of frames, with each remark among those of the frames that it is about."""
    reasons = part.reason.tolist()
    for remark in remarks:
        begin = int(np.searchsorted(part.time_ns, remark.first_ns, "left"))
        end = int(np.searchsorted(part.time_ns, remark.last_ns, "right"))
        for i in range(begin, end):
            reasons[i] = "; ".join(filter(None, (remark.text, reasons[i])))
    return np.array(reasons, np.str_)
