"""Cameras: the lens model, calibration files, triangulation."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from rigs import LENS, rig
from scipy.optimize import minimize

from handtrack.cameras.camera import Camera
from handtrack.cameras.formats import load_cameras
from handtrack.cameras.triangulate import CAUCHY_PX, triangulate
from handtrack.errors import InputError
from handtrack.hand.rotations import matrix_to_vector


def project_plainly(camera: Camera, point: np.ndarray) -> np.ndarray:
    """The formulae of OpenCV's documentation, one by one."""
    k1, k2, p1, p2, k3, k4, k5, k6 = camera.distortion
    xc, yc, zc = camera.rotation @ point + camera.translation
    x, y = xc / zc, yc / zc
    r2 = x**2 + y**2
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    xd = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
    yd = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
    u, v, w = camera.matrix @ [xd, yd, 1]
    return np.array([u / w, v / w])


def test_projection_is_opencvs():
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.15, 0.15, (20, 3))
    for camera in rig():
        plain = [project_plainly(camera, p) for p in points]
        assert np.allclose(camera.project(points), plain, atol=1e-9)
        behind = camera.centre - 0.1 * camera.rotation[2]
        assert np.isnan(camera.project(behind)).all()


def test_projection_agrees_with_opencv_itself():
    cv2 = pytest.importorskip("cv2", reason="OpenCV comes with the extra video")
    points = np.random.default_rng(1).uniform(-0.15, 0.15, (20, 3))
    for camera in rig():
        no_skew = camera.matrix.copy()
        no_skew[0, 1] = 0.0
        plain = Camera("a", no_skew, camera.distortion, camera.rotation, camera.translation)
        theirs, _ = cv2.projectPoints(
            points,
            matrix_to_vector(camera.rotation),
            camera.translation,
            no_skew,
            camera.distortion,
        )
        assert np.allclose(plain.project(points), theirs[:, 0], atol=1e-8)


def test_undistorting_undoes_the_lens():
    points = np.random.default_rng(2).uniform(-0.15, 0.15, (50, 3))
    for camera in rig():
        x = points @ camera.rotation.T + camera.translation
        assert np.allclose(
            camera.undistorted(camera.project(points)), x[:, :2] / x[:, 2:], atol=1e-9
        )


def same(a: Camera, b: Camera) -> bool:
    fields = ("matrix", "distortion", "rotation", "translation")
    return all(np.allclose(getattr(a, f), getattr(b, f), atol=1e-9) for f in fields)


def test_aniposelib_toml(tmp_path):
    cameras = rig()
    text = ""
    for i, c in enumerate(cameras):
        text += (
            f'[cam_{i}]\nname = "{c.name}"\nsize = [ 1280, 720,]\n'
            f"matrix = {c.matrix.tolist()}\ndistortions = {c.distortion.tolist()}\n"
            f"rotation = {matrix_to_vector(c.rotation).tolist()}\n"
            f"translation = {(1e3 * c.translation).tolist()}\n\n"
        )
    (tmp_path / "calibration.toml").write_text(text + "[metadata]\nadjusted = true\nerror = 0.4\n")
    found = load_cameras(tmp_path / "calibration.toml", unit="mm")
    assert [c.name for c in found] == ["cam0", "cam1", "cam2"]
    assert all(same(a, b) and a.size == (1280, 720) for a, b in zip(found, cameras, strict=True))


def opencv_yaml(c: Camera) -> str:
    def matrix(name, value):
        rows, cols = np.atleast_2d(value).shape
        data = ", ".join(repr(float(v)) for v in np.ravel(value))
        return (
            f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n"
            f"   data: [ {data} ]\n"
        )

    return (
        "%YAML:1.0\n---\nimage_width: 1280\nimage_height: 720\n"
        + matrix("camera_matrix", c.matrix)
        + matrix("distortion_coefficients", c.distortion[None])
        + matrix("R", c.rotation)
        + matrix("T", c.translation[:, None])
    )


def test_opencv_yaml_one_camera_a_file(tmp_path):
    cameras = rig(2)
    for c in cameras:
        (tmp_path / f"{c.name}.yml").write_text(opencv_yaml(c))
    found = load_cameras(tmp_path)
    assert [c.name for c in found] == ["cam0", "cam1"]
    assert all(same(a, b) and a.size == (1280, 720) for a, b in zip(found, cameras, strict=True))


def test_panoptic_json_is_in_centimetres_and_only_hd(tmp_path):
    c = rig(1)[0]
    entry = {
        "name": "00_00",
        "type": "hd",
        "resolution": [1920, 1080],
        "K": c.matrix.tolist(),
        "distCoef": c.distortion[:5].tolist(),
        "R": c.rotation.tolist(),
        "t": (100 * c.translation)[:, None].tolist(),
    }
    path = tmp_path / "calibration.json"
    path.write_text(json.dumps({"cameras": [{**entry, "name": "01_01", "type": "vga"}, entry]}))
    (found,) = load_cameras(path)
    assert (found.name, found.size) == ("00_00", (1920, 1080))
    assert np.allclose(found.translation, c.translation)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("a.toml", "[cam_0]\nmatrix = [[1, 2", "not valid TOML"),
        ("a.toml", "[cam_0]\nname = 'x'\n", "no camera"),
        ("a.toml", "[cam_0]\nmatrix = [[1,0],[0,1]]\n", r"\[cam_0\] matrix has 4 numbers"),
        (
            "a.toml",
            "[c]\nmatrix=[[1,0,0],[0,1,0],[0,0,1]]\nrotation=[0,0,0]\n",
            r"\[c\] has no translation",
        ),
        ("a.json", "{", "not valid JSON"),
        ("a.json", '{"people": []}', "expected a list under `cameras`"),
        ("a.json", '{"cameras": [{"K": [[1]], "name": "q"}]}', "camera q K has 1 numbers"),
        ("a.yaml", "%YAML:1.0\n---\na: 1\n", "no camera_matrix"),
        ("a.txt", "hello", "not a calibration"),
    ],
)
def test_a_calibration_that_is_wrong_is_named(tmp_path, name, text, says):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=says) as error:
        load_cameras(tmp_path / name)
    assert str(error.value).startswith(str(tmp_path / name))
    with pytest.raises(InputError, match="no such file"):
        load_cameras(tmp_path / "none.toml")


def test_an_inconsistent_camera_is_refused():
    c = rig(1)[0]
    good = {
        "matrix": c.matrix,
        "distortion": LENS,
        "rotation": c.rotation,
        "translation": [0, 0, 1],
    }
    for change, says in (
        ({"rotation": 2 * np.eye(3)}, "no rotation"),
        ({"rotation": np.diag([1.0, 1, -1])}, "no rotation"),
        ({"matrix": -np.eye(3)}, "focal"),
        ({"matrix": np.eye(2)}, "shape"),
        ({"translation": [0, 0, np.nan]}, "not finite"),
        ({"distortion": np.ones(12)}, "12 distortion numbers"),
    ):
        with pytest.raises(InputError, match=says):
            Camera("c", **{**good, **change})


def test_a_point_is_shared_by_views_under_cauchys_loss():
    """Against scipy; a view that errs by less than what leaves it out pulls little."""
    rng = np.random.default_rng(4)
    cameras = [replace(c, distortion=np.zeros(0)) for c in rig(4)]
    points = rng.uniform(-0.1, 0.1, (12, 3))
    pixels = np.stack([c.project(points) for c in cameras]) + rng.normal(0, 1.0, (4, 12, 2))
    pixels[2] += (18.0, 12.0)
    found, agree = triangulate(cameras, pixels)
    assert agree.all()
    plain, _ = triangulate(cameras, pixels, cauchy_px=np.inf)
    for i, point in enumerate(found):

        def loss(x: np.ndarray, i: int = i) -> float:
            off = np.array([c.project(x) - p[i] for c, p in zip(cameras, pixels, strict=True)])
            return float(np.log1p((off**2).sum(-1) / CAUCHY_PX**2).sum())

        best = minimize(loss, points[i], method="Nelder-Mead", tol=1e-10).x
        assert np.abs(point - best).max() < 1e-5
    error, plainly = (np.linalg.norm(x - points, axis=-1).mean() for x in (found, plain))
    assert error < 0.8 * plainly


def test_triangulation_finds_points_and_leaves_bad_views_out():
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.1, 0.1, (40, 3))
    cameras = rig(4)
    pixels = np.stack([c.project(points) for c in cameras])
    found, agree = triangulate(cameras, pixels)
    assert np.allclose(found, points, atol=1e-9)
    assert agree.all()

    pixels[2, :10] += 80.0  # one view is wrong
    pixels[1, 5:15] = np.nan  # one sees nothing
    pixels[1:, 20] = np.nan  # only one sees it
    found, agree = triangulate(cameras, pixels)
    rest = np.arange(40) != 20
    assert np.allclose(found[rest], points[rest], atol=1e-9)
    assert np.isnan(found[20]).all()
    assert not agree[2, :10].any()
    assert not agree[1, 5:15].any()
    assert not agree[:, 20].any()
    assert agree[0, rest].all()
    with pytest.raises(InputError, match="shape"):
        triangulate(cameras[:2], pixels)
