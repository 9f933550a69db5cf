"""The eye: the hand fills the picture, and goes out of it nowhere."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from made_tracks import make_track
from recording_checks import rrd_columns

from handtrack.viewer.blueprint import blueprint, placed
from handtrack.viewer.eye import Eye, Seen, eye, middles
from handtrack.viewer.hand_plots import rings
from handtrack.viewer.rerun_log import log_rerun
from handtrack.viewer.shown import Run, shown
from handtrack.viewer.style import Look


def seen_by(view: Eye, points: np.ndarray, aspect: float) -> np.ndarray:
    """(n, 2) where points (n, 3) are in the picture: -1 to 1 from edge to edge."""
    beside = points - view.position
    forward = (view.target - view.position) / view.distance
    slope = np.tan(np.deg2rad(55 / 2))  # Rerun's field of view is 55 degrees from top to bottom
    depth = beside @ forward
    return np.stack(
        [beside @ view.right / (depth * slope * aspect), beside @ view.upward / (depth * slope)], 1
    )


def far(metres: float) -> np.ndarray:
    """Joints (200, 21, 3) of a hand that goes so far, to and fro, in a world of its own."""
    track = make_track(200, lost=slice(0))
    turn, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    moved = (track.fitted_joints - middles(track.fitted_joints)[:, None]) @ turn.T
    there = metres * np.sin(np.linspace(0, 20, 200))[:, None, None] * np.array([1.0, 0.5, 0])
    return np.asarray(moved + there + [0.3, -2, 1.1])


@pytest.mark.parametrize("aspect", [0.4, 1.0, 1.7])
@pytest.mark.parametrize("metres", [0.0, 0.02, 0.4, 3.0])
def test_the_hand_fills_the_picture_and_stays_in_it(metres: float, aspect: float) -> None:
    joints = far(metres)
    view = eye([Seen("right", joints)], aspect=aspect)
    assert view.goes_along == (metres > 0.1)
    if view.goes_along:
        joints = joints - middles(joints)[:, None] + view.target
    at = seen_by(view, joints.reshape(-1, 3), aspect).reshape(len(joints), 21, 2)
    assert (np.abs(at) < 1).all(-1).mean() > 0.99
    # in the tighter direction a hand takes a good part of the picture
    assert np.median(np.ptp(at, axis=1).max(-1)) / 2 > 0.4


def test_a_still_eye_sees_all_of_the_way() -> None:
    joints = far(0.4)
    view = eye([Seen("right", joints)], still=True)
    assert not view.goes_along
    at = seen_by(view, joints.reshape(-1, 3), 1.0)
    assert (np.abs(at) < 1).all(1).mean() > 0.97
    assert np.abs(at).max(0).max() > 0.75
    assert (joints @ view.up > view.floor).mean() > 0.99


def test_the_eye_goes_along_with_what_the_recording_holds(tmp_path) -> None:  # type: ignore[no-untyped-def]
    track = make_track(30, lost=slice(0, 5))
    way = np.linspace(0, 2, 30)[:, None, None]
    moved = {
        name: getattr(track, name) + way
        for name in ("observed", "fitted_joints", "filtered_joints")
    }
    track = dataclasses.replace(track, **moved)
    path = log_rerun(track, save=tmp_path / "x.rrd", mesh=False)
    assert path is not None
    rows = rrd_columns(path)["/world/right/middle"]
    places = np.array(rows["Transform3D:translation"])[:, 0]
    assert len(rows["frame"]) == 26  # it waits where the hand will be, from the first frame on
    np.testing.assert_allclose(places[1:], middles(track.filtered_joints)[5:], atol=1e-6)
    (view,) = views(blueprint(shown([Run("", [track])]), Look(mesh=False)))
    assert str(view.origin).strip("/") == "world/right/middle"
    looked_at = view.properties["EyeControls3D"].look_target.as_arrow_array().to_pylist()
    assert looked_at == [[0, 0, 0]]
    # the ground stays, flat, below the hand wherever it goes
    strips = rrd_columns(path)["/world/right/ground"]["LineStrips3D:strips"]
    ground = np.array([list(map(list, strip)) for strip in strips[0]])
    seen = eye([Seen.of(track)], aspect=0.8)
    np.testing.assert_allclose(ground @ seen.up, seen.floor, atol=1e-5)
    assert (track.filtered_joints[5:] @ seen.up > seen.floor).mean() > 0.99
    assert np.ptp(ground @ seen.right) > 2 * (2 * np.sqrt(3) / 2)
    still = placed(shown([Run("", [track])]), Look(mesh=False, still=True))
    assert not still.view.goes_along


def views(arranged) -> list:  # type: ignore[no-untyped-def, type-arg]
    """The 3D views of a blueprint."""
    found, look = [], [arranged.root_container]
    while look:
        at = look.pop(0)
        found += [at] * (type(at).__name__ == "Spatial3DView")
        look += getattr(at, "contents", []) if hasattr(at, "row_shares") else []
    return found


def test_rings_are_about_joints_and_square_to_bones() -> None:
    joints = np.repeat(make_track(2, lost=slice(0)).fitted_joints[:1], 20, 0)
    at = np.arange(1, 21)
    found = rings(joints, at)
    centre = joints[np.arange(20), at]
    np.testing.assert_allclose(found[:, :-1].mean(1), centre, atol=1e-9)
    np.testing.assert_allclose(found[:, 0], found[:, -1], atol=1e-12)
    parents = np.where(at % 4 == 1, 0, at - 1)
    bone = centre - joints[np.arange(20), parents]
    off = np.einsum("nki,ni->nk", found - centre[:, None], bone)
    np.testing.assert_allclose(off, 0, atol=1e-12)
    radii = np.linalg.norm(found - centre[:, None], axis=-1)
    assert (radii > 0.005).all()
    assert (radii < 0.0131).all()
