"""Calibrations of OpenCV's XML, ROS, NumPy and .dat give the cameras that they were written of."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from rigs import rig

import handtrack as ht
from handtrack.cameras.camera import Camera
from handtrack.errors import InputError, SettingsError
from handtrack.hand.rotations import matrix_to_vector, vector_to_matrix

POINTS = np.random.default_rng(4).uniform(-0.1, 0.1, (20, 3))


def same(found: list[Camera], wanted: list[Camera]) -> None:
    """They see the same."""
    assert len(found) == len(wanted)
    for a, b in zip(found, wanted, strict=True):
        np.testing.assert_allclose(a.project(POINTS), b.project(POINTS), atol=1e-6)


def rows(value) -> str:
    return " ".join(repr(float(x)) for x in np.ravel(value))


def opencv_xml(c: Camera) -> str:
    parts = []
    for name, value in (
        ("camera_matrix", c.matrix),
        ("distortion_coefficients", c.distortion[None]),
        ("R", c.rotation),
        ("T", c.translation[:, None]),
    ):
        r, k = value.shape
        parts.append(
            f'<{name} type_id="opencv-matrix"><rows>{r}</rows><cols>{k}</cols><dt>d</dt>'
            f"<data>\n  {rows(value)}</data></{name}>"
        )
    size = "<image_width>1280</image_width><image_height>720</image_height>"
    return f'<?xml version="1.0"?>\n<opencv_storage>\n{size}{"".join(parts)}</opencv_storage>\n'


def ros(c: Camera, name: str, turn: np.ndarray, p: np.ndarray) -> str:
    def matrix(title, value):
        data = ", ".join(rows(value).split())
        r, k = np.atleast_2d(value).shape
        return f"{title}:\n  rows: {r}\n  cols: {k}\n  data: [{data}]\n"

    return (
        f"image_width: 1280\nimage_height: 720\ncamera_name: {name}\n"
        + matrix("camera_matrix", c.matrix)
        + "distortion_model: rational_polynomial\n"
        + matrix("distortion_coefficients", c.distortion[None])
        + matrix("rectification_matrix", turn)
        + matrix("projection_matrix", p)
    )


def test_opencv_xml(tmp_path):
    cameras = rig(2)
    for c in cameras:
        (tmp_path / f"{c.name}.xml").write_text(opencv_xml(c))
    found = ht.load_cameras(tmp_path)
    same(found, cameras)
    assert found[0].size == (1280, 720)
    (tmp_path / "cam0.xml").write_text('<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><a/>')
    with pytest.raises(InputError, match=r"cam0\.xml: .*declarations"):
        ht.load_cameras(tmp_path)


def test_a_lens_alone_sees_in_its_own_frame_and_two_need_their_places(tmp_path):
    """cv2.calibrateCamera says how a lens sees, not where it stands."""
    placed = rig(1)[0]
    c = Camera("lens", placed.matrix, placed.distortion, np.eye(3), np.zeros(3), (1280, 720))
    text = opencv_xml(c)
    lens = text[: text.index("<R ")] + text[text.index("</opencv_storage>") :]
    (tmp_path / "a.xml").write_text(lens)
    (found,) = ht.load_cameras(tmp_path / "a.xml")
    before = np.add(POINTS, [0, 0, 0.5])
    np.testing.assert_allclose(found.project(before), c.project(before), atol=1e-6)
    boards = {name: np.ones((14, 3, 1)) for name in ("rvecs", "tvecs")}
    np.savez(tmp_path / "o.npz", mtx=c.matrix, dist=c.distortion[None], **boards)
    (found,) = ht.load_cameras(tmp_path / "o.npz")
    np.testing.assert_allclose(found.project(before), c.project(before), atol=1e-6)
    (tmp_path / "o.npz").unlink()
    (tmp_path / "b.xml").write_text(lens)
    with pytest.raises(InputError, match="a and b stand at one place and look one way: expected R"):
        ht.load_cameras(tmp_path)
    half = text[: text.index("<T ")] + text[text.index("</opencv_storage>") :]
    (tmp_path / "c.xml").write_text(half)
    with pytest.raises(InputError, match="no T or t"):
        ht.load_cameras(tmp_path / "c.xml")


@pytest.mark.parametrize("message", [False, True])
def test_a_pair_calibrated_by_ros_shares_the_rectified_world(tmp_path, message):
    """Points in the rectified frame of the first camera, at 120 mm to the second."""
    plain, turn = rig(1)[0], vector_to_matrix(np.array([0.01, -0.03, 0.02]))
    wanted = []
    for name, shift in (("left", 0.0), ("right", -0.12)):
        p = np.array([[880.0, 0, 600, 880 * shift], [0, 880, 350, 0], [0, 0, 1, 0]])
        text = ros(plain, name, turn, p)
        if message:
            blocks = (("k", plain.matrix), ("d", plain.distortion), ("r", turn), ("p", p))
            text = "header:\n  frame_id: x\nheight: 720\nwidth: 1280\ndistortion_model: plumb_bob\n"
            for key, value in blocks:
                text += f"{key}:\n" + "".join(f"- {x}\n" for x in rows(value).split())
        (tmp_path / f"{name}.yaml").write_text(text)
        move = turn.T @ np.array([shift, 0.0, 0.0])
        wanted.append(Camera(name, plain.matrix, plain.distortion, turn.T, move))
        # the projection that P says of the rectified pictures
        deep = POINTS + np.array([0, 0, 0.5])
        x = deep + np.array([shift, 0, 0])
        u = np.einsum("ij,tj->ti", p, np.c_[deep, np.ones(len(deep))])
        np.testing.assert_allclose(u[:, :2] / u[:, 2:], (x[:, :2] / x[:, 2:]) * 880 + [600, 350])
    found = ht.load_cameras(tmp_path)
    assert [c.name for c in found] == ["left", "right"]
    assert found[1].size == (1280, 720)
    for a, b in zip(found, wanted, strict=True):
        deep = POINTS + np.array([0, 0, 0.5])
        np.testing.assert_allclose(a.project(deep), b.project(deep), atol=1e-6)


def test_numpy_one_camera_a_pair_and_a_stack(tmp_path):
    cameras = rig(3)
    arrays = {
        "K": np.stack([c.matrix for c in cameras]),
        "D": np.stack([c.distortion for c in cameras]),
        "R": np.stack([matrix_to_vector(c.rotation) for c in cameras]),
        "T": np.stack([c.translation for c in cameras])[..., None],
    }
    np.savez(tmp_path / "rig.npz", **arrays)
    same(ht.load_cameras(tmp_path / "rig.npz"), cameras)
    one = tmp_path / "one"
    one.mkdir()
    for i, c in enumerate(cameras):
        both = np.c_[c.rotation, 1e3 * c.translation]
        np.savez(one / f"{i}.npz", mtx=c.matrix, dist=c.distortion, extrinsic=both)
    same(ht.load_cameras(one, "mm"), cameras)
    a, b = cameras[:2]
    turn = b.rotation @ a.rotation.T
    move = b.translation - turn @ a.translation
    np.savez(
        tmp_path / "pair.npz", K1=a.matrix, D1=a.distortion, K2=b.matrix, D2=b.distortion,
        R=turn, T=100 * move,
    )  # fmt: skip
    found = ht.load_cameras(tmp_path / "pair.npz", "cm")
    moved = POINTS @ a.rotation.T + a.translation
    for c, seen in zip(found, (a, b), strict=True):
        np.testing.assert_allclose(c.project(moved), seen.project(POINTS), atol=1e-6)


def dats(folder: Path, cameras: list[Camera], square_m: float) -> None:
    folder.mkdir(exist_ok=True)
    for i, c in enumerate(cameras):
        lens = "\n".join(rows(r) for r in c.matrix)
        (folder / f"c{i}.dat").write_text(
            f"intrinsic:\n{lens}\ndistortion:\n{rows(c.distortion)}\n"
        )
        turn = "\n".join(rows(r) for r in c.rotation)
        move = "\n".join(rows(x) for x in c.translation / square_m)
        more = "#below is from cam0 to cam1\nR:\n9 9 9\n9 9 9\n9 9 9\nT:\n9\n9\n9\n" * (i > 0)
        (folder / f"rot_trans_c{i}.dat").write_text(f"R:\n{turn}\nT:\n{move}\n\n{more}")


def test_dat_files_in_squares_of_a_board(tmp_path):
    cameras = rig(2)
    dats(tmp_path / "dats", cameras, 0.042)
    same(ht.load_cameras(tmp_path / "dats", "42mm"), cameras)
    same(ht.load_cameras(tmp_path / "dats" / "c1.dat", "4.2 cm"), cameras[1:])
    (tmp_path / "dats" / "rot_trans_c1.dat").unlink()
    with pytest.raises(InputError, match=r"c1\.dat: rot_trans_c1\.dat, .* is missing"):
        ht.load_cameras(tmp_path / "dats")
    (tmp_path / "dats" / "rot_trans_c1.dat").write_text("R:\n1 0 0\n")
    with pytest.raises(InputError, match="there is no `T:`"):
        ht.load_cameras(tmp_path / "dats")


@pytest.mark.parametrize("unit", ["inch", "0mm", "mm42", "", "-3cm"])
def test_a_unit_that_is_none(tmp_path, unit):
    with pytest.raises(SettingsError, match="expected m, cm, mm or a length"):
        ht.load_cameras(tmp_path, unit)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.yaml", "K: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nP: [0, 0, 0]\n", "P has 3 numbers"),
        ("a.yaml", "distortion_model: equidistant\nK: [1]\n", "fisheye"),
        ("a.xml", "<?xml version='1.0'?><opencv_storage>", "not valid XML"),
        ("a.xml", "<?xml version='1.0'?><a></a>", "no camera_matrix"),
        ("a.dat", "hello\n", r"rot_trans_a\.dat"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, name, text, says):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=says) as refused:
        ht.load_cameras(tmp_path / name)
    assert str(refused.value).startswith(str(tmp_path / name))


K, D = [[900.0, 0, 640], [0, 905.0, 360], [0, 0, 1]], [0.1, -0.05, 0.001, -0.002, 0.01]
FLAT = [x for row in K for x in row]
_LINES = "".join(f"- - {a}\n  - {b}\n  - {c}\n" for a, b, c in K)
_NUMBERS = dict(zip(("fx", "fy", "cx", "cy"), (900, 905, 640, 360), strict=True))
LENSES = {
    "flow.yaml": f"camera_matrix: {{rows: 3, cols: 3, data: {FLAT}}}\n"
    f"distortion_coefficients: {{rows: 1, cols: 5, data: {D}}}\n",
    "lists.yaml": f"camera_matrix: {K}\ndist_coeffs: {D}\n",
    "rows.yaml": "camera_matrix:\n" + "".join(f"- {r}\n" for r in K) + f"dist_coeff:\n- {D}\n",
    "lines.yml": "camera_matrix:\n" + _LINES + "dist:\n- - "
    + "\n  - ".join(map(str, D)) + "\n",
    "k.json": json.dumps({"K": K, "D": D}),
    "names.json": json.dumps({"mtx": K, "dist_coeffs": [D]}),
    "flat.json": json.dumps(
        _NUMBERS | dict(zip(("k1", "k2", "p1", "p2", "k3"), D, strict=True))
    ),
    "inside.json": json.dumps({"intrinsics": _NUMBERS, "distortion": D}),
    "realsense.json": json.dumps(
        {"fx": 900, "fy": 905, "ppx": 640, "ppy": 360, "model": "brown_conrady", "coeffs": D}
    ),
    "columns.json": json.dumps({"intrinsic_matrix": np.transpose(K).ravel().tolist(), "D": D}),
    "info.json": json.dumps(
        {"k": FLAT, "d": D, "r": np.eye(3).ravel().tolist(), "p": [900, 0, 640, 0, 0, 905,
         360, 0, 0, 0, 1, 0]}
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LENSES)
def test_a_lens_as_scripts_write_it(tmp_path, name):
    (tmp_path / name).write_text(LENSES[name])
    (camera,) = ht.load_cameras(tmp_path / name)
    np.testing.assert_array_equal(camera.matrix, K)
    np.testing.assert_array_equal(camera.distortion[:5], D)


def test_arrays_by_other_names_lose_no_distortion(tmp_path):
    np.savez(tmp_path / "a.npz", cameraMatrix=K, dist_coeffs=[D])
    np.testing.assert_array_equal(ht.load_cameras(tmp_path / "a.npz")[0].distortion[:5], D)
    np.savez(tmp_path / "b.npz", K=K, dist_of_mine=[D])
    with pytest.raises(InputError, match="dist_of_mine is not understood"):
        ht.load_cameras(tmp_path / "b.npz")
    turn, move = vector_to_matrix(np.array([0.0, 0.4, 0.1])), [-0.3, 0.0, 0.05]
    np.savez(tmp_path / "c.npz", mtxL=K, distL=D, mtxR=K, distR=D, R=turn, T=move)
    first, second = ht.load_cameras(tmp_path / "c.npz")
    np.testing.assert_array_equal(first.rotation, np.eye(3))
    np.testing.assert_allclose(second.rotation, turn)
    for camera in (first, second):
        np.testing.assert_array_equal(camera.distortion[:5], D)


def test_json_of_cameras_by_name_and_lenses_that_are_not_understood(tmp_path):
    path, cameras = tmp_path / "rig.json", rig(2)
    told = {
        c.name: {"K": c.matrix.tolist(), "dist": c.distortion.tolist(), "R": c.rotation.tolist(),
                 "t": c.translation.tolist()}
        for c in cameras
    }  # fmt: skip
    path.write_text(json.dumps(told))
    found = ht.load_cameras(path)
    same(found, cameras)
    assert [c.name for c in found] == [c.name for c in cameras]
    for model in ("distortion.inverse_brown_conrady", "kannala_brandt4"):
        path.write_text(json.dumps({"K": K, "coeffs": D, "model": model}))
        with pytest.raises(InputError, match=model):
            ht.load_cameras(path)
    path.write_text(json.dumps({"camera_matrix": {"rows": -3, "cols": -3, "data": FLAT}}))
    np.testing.assert_array_equal(ht.load_cameras(path)[0].matrix, K)
    path.write_text(json.dumps({"camera_matrix": [[900, 0], [0, 905, 3], [0, 0, 1]]}))
    with pytest.raises(InputError, match="rows of different length"):
        ht.load_cameras(path)


def test_a_list_of_cameras_by_opencv_s_names_is_in_metres(tmp_path):
    cameras, path = rig(3), tmp_path / "rig.json"
    told = [
        {"id": i, "camera_matrix": c.matrix.tolist(), "dist_coeffs": c.distortion.tolist(),
         "rvec": matrix_to_vector(c.rotation).tolist(), "tvec": c.translation[:, None].tolist()}
        for i, c in enumerate(cameras)
    ]  # fmt: skip
    for data in ({"cameras": told}, {"cameras": {f"c{c['id']}": c for c in told}}):
        path.write_text(json.dumps(data))
        same(ht.load_cameras(path), cameras)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.json", json.dumps({"cameras": [{"name": "a", "K": K, "R": np.eye(3).tolist(),
                                            "t": [0, 0, 0], "dist_of_mine": D}]})),
        ("a.toml", f"[cam]\nname='a'\nmatrix={K}\nrotation=[0,0,0]\ntranslation=[0,0,0]\n"
                   f"dist_of_mine={D}\n"),
    ],
)  # fmt: skip
def test_a_distortion_by_another_name_is_told_of_not_left_out(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match="dist_of_mine is not understood"):
        ht.load_cameras(tmp_path / name)
    (tmp_path / name).write_text(text.replace("dist_of_mine", "distortion"))
    np.testing.assert_array_equal(ht.load_cameras(tmp_path / name)[0].distortion[:5], D)
