"""What Rerun gets of a camera's pictures, read back from the .rrd file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from recording_checks import rrd_columns

from handtrack.tracking.track import Track
from handtrack.viewer import style
from handtrack.viewer.picture_log import BATCH, PictureView, log_pictures
from handtrack.viewer.rerun_log import log_rerun


def test_pictures_and_their_joints(track: Track, tmp_path: Path) -> None:
    n = BATCH + 3
    time_ns = track.time_ns[0] + 10_000_000 * np.arange(n)
    frames = 7 + np.arange(n)
    jpegs = [b"\xff\xd8\xff" + bytes([i]) for i in range(n)]
    seen = np.random.default_rng(0).uniform(0, 100, (n, 21, 2))
    seen[2] = np.nan
    seen[3, 8] = np.nan
    view = PictureView(
        "cam0", time_ns, frames, lambda: iter(jpegs), {"right": {style.OBSERVED: seen}}
    )
    log_rerun(track, save=tmp_path / "run.rrd", pictures=[view])
    found = rrd_columns(tmp_path / "run.rrd")

    pictures = found["/pictures/cam0"]
    assert pictures["frame"] == frames.tolist()
    origin = int(track.time_ns[0])
    assert [t - pictures["time"][0] for t in pictures["time"]] == (time_ns - origin).tolist()
    (blobs,) = (v for k, v in pictures.items() if k.endswith("blob"))
    assert [bytes(b[0]) for b in blobs if b] == jpegs

    joints = found["/pictures/cam0/right/observed"]
    (points,) = (v for k, v in joints.items() if k.endswith("positions"))
    (ids,) = (v for k, v in joints.items() if k.endswith("keypoint_ids"))
    points, ids = ([row for row in rows if row is not None] for rows in (points, ids))
    assert [len(p) for p in points] == [21, 21, 0, 20] + [21] * (n - 4)
    assert np.allclose(points[0], seen[0], atol=1e-4)
    assert 8 not in ids[3]


def test_what_stays_is_sent_once(track: Track) -> None:
    """Sent again with every picture, a viewer that shows them live forgets bones and colours."""

    class Sent(list[str]):
        def log(self, entity: str, archetype: object, *, static: bool) -> None:
            self.append(entity)

        def send_columns(self, *given: object) -> None: ...

    sent, begun = Sent(), set[str]()
    for i in range(3):
        seen = {hand: {style.OBSERVED: np.ones((1, 21, 2))} for hand in ("right", "left")[: i + 1]}
        number = np.array([i])
        view = PictureView("cam0", number, number, lambda: iter([b"x"]), seen)
        log_pictures(sent, [view], lambda f, t: [], begun)  # type: ignore[arg-type]
    places = ["pictures/cam0", "pictures/cam0/right/observed", "pictures/cam0/left/observed"]
    assert sent == places
