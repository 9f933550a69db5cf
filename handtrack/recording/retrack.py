"""The input of a track through today's tracker."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import msgspec
import numpy as np

from handtrack.detectors.chosen import AUTO
from handtrack.errors import InputError, ModelError
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import reshaped, without_landmarks
from handtrack.sequences.sequence import Remark, RemarkKind, Sequence
from handtrack.tracking.sequence_track import track_joints
from handtrack.tracking.settings import TrackSettings
from handtrack.tracking.track import Track


def input_of(stored: Track) -> Sequence:
    """The sequence that a track was made of, with what was done to single frames of it.

    Raises:
        InputError: it holds no joint, or its remarks are none.
    """
    return Sequence(
        time_ns=stored.time_ns,
        joints=stored.observed,
        confidence=stored.confidence,
        hand=stored.hand,
        frame_index=stored.frame_index,
        truth=stored.truth,
        name=stored.name,
        source=stored.source,
        subject=stored.subject,
        timed=stored.timed,
        numbered=stored.numbered,
        remarks=tuple(
            Remark(*msgspec.structs.astuple(remark))
            for remark in _typed(stored, "remarks", list[_StoredRemark], [])
        ),
    )


class _StoredRemark(msgspec.Struct, array_like=True):
    """A Remark as a recording has it. In old ones it has no kind: all were of this one."""

    first_ns: int
    last_ns: int
    text: str
    kind: RemarkKind = "exchanged"


def _typed(stored: Track, name: str, kind: Any, otherwise: Any = None) -> Any:
    """A setting of a track, which a file may have made anything of.

    Raises:
        InputError: it is of another kind.
    """
    value = stored.settings.get(name, otherwise)
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError as error:
        message = f"{stored.name}: the setting {name} of the recording is wrong: {error}"
        raise InputError(message, stored.source or None) from error


def settings_of(stored: Track) -> dict[str, Any]:
    """The settings that made a track, as far as today's `track` knows them.

    The hand is not among them: it is in the track as it was calibrated.

    Raises:
        InputError: one is of a kind that none can have.
    """
    known = TrackSettings.known()
    names = [name for name in stored.settings if name in known and name != "calibrate"]
    # who made it before noise could last took it for white
    return {"noise_colour": "white"} | {
        name: _typed(stored, name, known[name].kind) for name in names
    }


def as_stored(model: HandModel, stored: HandModel) -> HandModel:
    """A model with its own skin and the joints, axes and limits of a hand whose skin is not known.

    Args:
        model: the model that the hand was made from, such as MANO of the same shape.
        stored: the hand as a recording holds it.
    """
    if not np.array_equal(model.rest_joints, stored.rest_joints):
        model = reshaped(model, stored.rest_joints)
    own = {name: getattr(stored, name) for name in _OWN}
    return replace(model, **own)


_LASTING = ("lasting_deg", "lasting_mm")
_OWN = ("axes", "limits", "thumb_twist", "shape", "landmark_offsets")


def retrack(
    stored: Track,
    model: HandModel | None = None,
    settings: TrackSettings | Mapping[str, Any] | None = None,
    **options: Any,
) -> Track:
    """Track the observed joints of a track again.

    With the same version and no settings, the result is the stored track, to the bit.

    Args:
        stored: the track, such as `read_mcap` returns.
        model: the hand to fit as it is; the stored one by default. With `calibrate` among the
            settings it is only where calibration begins.
        settings: settings by their names that replace the stored ones, or all of them.
        options: settings by their names, as in `track`, that replace these.

    Raises:
        ModelError: the stored hand is a licensed one (MANO), of which the recording holds no
            skin, and no model is given.
        InputError, SettingsError: as `track`.
    """
    if model is None:
        if stored.model.licensed:
            raise ModelError(
                f"{stored.name}: the hand is {stored.model.name}, whose licence keeps its skin out"
                " of recordings: give the model again"
            )
        model = stored.model
    given = settings.flat() if isinstance(settings, TrackSettings) else dict(settings or {})
    given |= options
    if given.get("detector") == AUTO:
        del given["detector"]
    elif "detector" in given:
        model = without_landmarks(model)
    before = settings_of(stored)
    if "calibrate" in given or "detector" in given:
        # what lasts is of another hand, or another detector
        before = {name: v for name, v in before.items() if name not in _LASTING}
    wanted = TrackSettings.of({"calibrate": "none", **before, **given})
    result = track_joints(input_of(stored), model, wanted)
    first = int(stored.time_ns[0])
    # what the reader and the calibration had to say; the tracker says its own things again
    said = {event.text for event in result.events}
    notes = [e for e in stored.events if e.level == "warning" and e.time_ns == first]
    events = (*(e for e in notes if e.text not in said), *result.events)
    made = dict(result.settings)
    if "detector" not in given and "detector_why" in stored.settings:
        made["detector_why"] = stored.settings["detector_why"]
    if "calibrate" not in given:
        # the hand is still that one
        kept = {n: v for n, v in stored.settings.items() if n in before or n not in _LASTING}
        made = {**kept, **made, "calibrate": stored.settings.get("calibrate", "none")}
        made |= {k: stored.settings[k] for k in ("calibration", "model") if k in stored.settings}
    return replace(result, events=events, settings=made)
