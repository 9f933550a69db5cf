"""The skin that a recording may not hold, from the files that its user has."""

from __future__ import annotations

import dataclasses

import numpy as np

from handtrack.errors import InputError, ModelError
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import reshaped
from handtrack.tracking.track import Track

_SAME = 1e-6  # between rest joints that are the same [m]
_OFF = 5e-4  # most that a skin may be off the recorded one: the mesh may be quantised [m]
_LOOKED_AT = 50  # frames


def dressed(track: Track, model: HandModel) -> Track:
    """A track of a recording whose model has lost its skin, with the skin of the user's model.

    The skin is brought into the proportions that were fitted, as calibration does. Where the
    recording holds skins of single frames, it must be the same hand.

    Args:
        track: as read from a recording; one whose model has a skin is returned as it is.
        model: the hand that was tracked, before calibration.

    Raises:
        ModelError: the model has no skin, or is of the other hand.
        InputError: it is not the hand that was recorded.
    """
    if len(track.model.rest_vertices):
        return track
    if model.hand != track.hand:
        raise ModelError(f"the model is a {model.hand} hand, {track.name} a {track.hand} one")
    if not len(model.rest_vertices):
        raise ModelError(f"model {model.name} has no skin")
    bare = track.model
    if np.abs(model.rest_joints - bare.rest_joints).max() > _SAME:
        model = reshaped(model, bare.rest_joints, bare.axes)
    full = dataclasses.replace(
        bare,
        rest_vertices=model.rest_vertices,
        faces=model.faces,
        weights=model.weights,
        pose_blend=model.pose_blend,
        licensed=model.licensed,
    )
    made = dataclasses.replace(track, model=full, skin=None)
    if track.skin is not None:
        some = np.flatnonzero(np.isfinite(track.angles).all(1))[:_LOOKED_AT]
        off = np.inf
        if track.skin.n_vertices == len(full.rest_vertices):
            off = np.nanmax(np.abs(made.vertices(some) - track.vertices(some)), initial=0.0)
        if off > _OFF:
            raise InputError(
                f"{track.name}: the {model.name} model is not the hand that was recorded:"
                + (f" skins are {1e3 * off:.1f} mm apart" if np.isfinite(off) else " other skins")
            )
    return made
