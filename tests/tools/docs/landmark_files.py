"""What other programs write of a hand in pictures, for the page of several cameras."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from handtrack.cameras.camera import Camera
from handtrack.hand.rotations import vector_to_matrix

BOARD_M = 0.042
"""The square that `--board-unit 42mm` of the page says."""


def pair() -> list[Camera]:
    """Two cameras that look at the world's origin from 0.7 m, 60 degrees apart."""
    matrix = [[920.0, 0.0, 360.0], [0.0, 920.0, 360.0], [0.0, 0.0, 1.0]]
    turns = [vector_to_matrix(np.array([0.0, np.deg2rad(a), 0.0])) for a in (-30.0, 30.0)]
    return [
        Camera(f"cam{i}", matrix, [0.0] * 5, turn, [0.0, 0.0, 0.7], (720, 720))
        for i, turn in enumerate(turns)
    ]


def calibration(cameras: list[Camera]) -> str:
    """Cameras as aniposelib writes them."""
    from scipy.spatial.transform import Rotation

    tables = []
    for camera in cameras:
        turn = Rotation.from_matrix(camera.rotation).as_rotvec().tolist()
        tables.append(
            f'[{camera.name}]\nname = "{camera.name}"\nsize = {list(camera.size or ())}\n'
            f"matrix = {camera.matrix.tolist()}\ndistortions = {camera.distortion[:5].tolist()}\n"
            f"rotation = {turn}\ntranslation = {camera.translation.tolist()}\n"
        )
    return "\n".join(tables)


def write_all(folder: Path, joints: np.ndarray, cameras: list[Camera]) -> None:
    """All files that the page names.

    Args:
        folder: where.
        joints: (T, 21, 3) of a right hand [m]; it is moved to the world's origin.
        cameras: the two of `calibration.toml`.
    """
    centred = joints - joints.mean((0, 1))
    seen = np.stack([camera.project(centred) for camera in cameras])
    for i, pixels in enumerate(seen):
        (folder / f"cam{i}.csv").write_text(table(pixels))
    arrays = folder / "detections_2d.npz"
    np.savez(arrays, landmarks=seen, fps=30.0, hand="right")
    write_dats(folder / "camera_parameters", cameras)
    one = Camera("lens", [[900.0, 0, 640], [0, 900, 360], [0, 0, 1]], [0.0] * 5, np.eye(3), [0] * 3)
    pixels = one.project(np.add(centred, [0.0, 0.0, 0.6]))
    (folder / "lens.yaml").write_text(
        "image_width: 1280\nimage_height: 720\ncamera_matrix:\n  rows: 3\n  cols: 3\n"
        f"  data: {one.matrix.ravel().tolist()}\ndistortion_model: plumb_bob\n"
        "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0, 0, 0, 0, 0]\n"
    )
    (folder / "openpose").mkdir()
    for t, points in enumerate(pixels):
        hand = np.column_stack([points, np.full(21, 0.9)]).ravel().tolist()
        person = {"hand_left_keypoints_2d": [0.0] * 63, "hand_right_keypoints_2d": hand}
        text = json.dumps({"version": 1.3, "people": [person]})
        (folder / "openpose" / f"clip_{t:012d}_keypoints.json").write_text(text)
    (folder / "landmarks.csv").write_text(table(pixels / [1280, 720], "handedness", "Right"))


def table(points: np.ndarray, title: str = "", cell: str = "") -> str:
    """(T, 21, 2) as a table of a row a frame; with one column more where it has a title."""
    more, told = (f",{title}", f",{cell}") if title else ("", "")
    head = "frame," + ",".join(f"x_{i},y_{i}" for i in range(21)) + more
    rows = [f"{t}," + ",".join(f"{v:.6f}" for v in p.ravel()) for t, p in enumerate(points)]
    return "\n".join([head, *(row + told for row in rows)]) + "\n"


def write_dats(folder: Path, cameras: list[Camera]) -> None:
    """Cameras as .dat files, their translations in squares of the board."""
    folder.mkdir()

    def rows(values: np.ndarray) -> str:
        return "\n".join(" ".join(map(str, row)) for row in np.atleast_2d(values).tolist())

    for i, camera in enumerate(cameras):
        lens = f"intrinsic:\n{rows(camera.matrix)}\ndistortion:\n{rows(camera.distortion[:5])}\n"
        (folder / f"c{i}.dat").write_text(lens)
        place = camera.translation[:, None] / BOARD_M
        text = f"R:\n{rows(camera.rotation)}\nT:\n{rows(place)}\n"
        (folder / f"rot_trans_c{i}.dat").write_text(text)
