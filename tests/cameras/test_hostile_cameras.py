"""Camera files that are wrong, or mean harm: each is refused with its name and the place."""

from __future__ import annotations

import json
import os
import warnings

import numpy as np
import pytest

from handtrack.cameras.formats import load_cameras
from handtrack.errors import InputError

MATRIX = "[[900.0, 0, 640], [0, 900.0, 360], [0, 0, 1]]"
TURNED = "[[0, -1, 0], [1, 0, 0], [0, 0, 1]]"
SWAPPED = "[[900.0, 0, 0], [0, 900.0, 0], [640, 360, 1]]"


def toml(**changes: str) -> str:
    values = {
        "name": '"one"',
        "size": "[1280, 720]",
        "matrix": MATRIX,
        "distortions": "[0.1, 0, 0, 0, 0]",
        "rotation": "[0.1, 0.2, 0.3]",
        "translation": "[0.0, 0.1, 0.5]",
    } | changes
    return "[cam_0]\n" + "".join(f"{k} = {v}\n" for k, v in values.items() if v)


def panoptic(**changes: str) -> str:
    values = {
        "name": '"00_00"',
        "type": '"hd"',
        "resolution": "[1920, 1080]",
        "K": MATRIX,
        "distCoef": "[0.1, 0, 0, 0, 0]",
        "R": TURNED,
        "t": "[[10], [20], [300]]",
    } | changes
    return '{"cameras": [{' + ", ".join(f'"{k}": {v}' for k, v in values.items() if v) + "}]}"


def opencv(**changes: str) -> str:
    matrices = {
        "camera_matrix": ("3", "3", "900., 0., 640., 0., 900., 360., 0., 0., 1."),
        "distortion_coefficients": ("1", "5", "0.1, 0., 0., 0., 0."),
        "R": ("3", "3", "0., -1., 0., 1., 0., 0., 0., 0., 1."),
        "T": ("3", "1", "0.1, 0.2, 0.5"),
    }
    sizes = {"image_width": "1280", "image_height": "720"}
    text = "%YAML:1.0\n---\n"
    for name, value in sizes.items():
        text += f"{name}: {changes.get(name, value)}\n"
    for name, (rows, columns, data) in matrices.items():
        shape = changes.get(f"{name}_shape", f"{rows} {columns}").split()
        text += f"{name}: !!opencv-matrix\n   rows: {shape[0]}\n   cols: {shape[1]}\n   dt: d\n"
        text += f"   data: [ {changes.get(name, data)} ]\n"
    return text + changes.get("more", "")


OPEN = "a: !!opencv-matrix\n rows: 3\n cols: 3\n dt: d\n data: [\n"
NAN_MATRIX = MATRIX.replace("900.0", "nan", 1)
BAD_TOML = [
    *({"size": v} for v in ("[nan, 720]", "[inf, 720]", '["a", 720]', "[1280]", "[1280.5, 720]")),
    *({"size": v} for v in ("[0, 720]", "[-1, 720]", "[1e30, 1]", "true", "[[1280, 720], [1, 2]]")),
    *({"matrix": v} for v in (NAN_MATRIX, NAN_MATRIX.replace("nan", "inf"), SWAPPED, "[[1]]")),
    *({"matrix": v} for v in ("7", '"text"', MATRIX.replace("900.0", "-900.0"), "[[1, 2], [3]]")),
    *({"matrix": v} for v in (MATRIX.replace("640", "9" * 4000), "[" * 50 + "1" + "]" * 50)),
    *({"matrix": v} for v in (MATRIX.replace("640", "true"), MATRIX.replace("640", '"640"'))),
    *({"rotation": v} for v in ("[nan, 0, 0]", "[1e300, 0, 0]", "[1, 2]", '["x", 0, 0]', "[]")),
    *({"rotation": v} for v in (TURNED.replace("-1", "1"), TURNED.replace("1", "2"))),
    *({"translation": v} for v in ("[nan, 0, 0]", "[inf, 0, 0]", "[0, 0]", "", "[1e200, 0, 0]")),
    *({"distortions": v} for v in ("[nan]", '["a"]', "[0, 0, 0, 0, 0, 0, 0, 0, 1]", "[1e200]")),
    *({"name": v} for v in ("[1]", "true", "{a = 1}")),
    {"matrix": ""},
    {"rotation": ""},
    {"fisheye": "true"},
]  # fmt: skip
BAD_PANOPTIC = [
    *({"resolution": v} for v in ("[NaN, 1080]", '["a", 1]', "[1]", "7", "[0, 0]", "{}", '"ab"')),
    *({"K": v} for v in (MATRIX.replace("640", "NaN"), "[[1]]", "null", SWAPPED, "{}", "1e999")),
    *({"K": v} for v in (MATRIX.replace("640", "9" * 5000), "[" * 1000 + "]" * 1000)),
    *({"R": v} for v in ("[1, 2, 3]", TURNED.replace("-1", "1"), TURNED.replace("1", "Infinity"))),
    *({"R": v} for v in ("[[1e200, 0, 0], [0, 1, 0], [0, 0, 1]]", '"R"', "")),
    *({"t": v} for v in ("[1, 2]", "[null, 0, 0]", '["1", "2", "3"]', "")),
    *({"distCoef": v} for v in ("[NaN]", "null", "[true]")),
    *({"name": v} for v in ("[]", "null", "{}")),
    {"R": TURNED + ', "R": ' + TURNED},
]
BAD_OPENCV = [
    *({"camera_matrix": v} for v in ("1, 2", ".nan, 0, 0, 0, 1, 0, 0, 0, 1", "a, b", "")),
    *({"camera_matrix": f"{v}, 0, 0, 0, 1, 0, 0, 0, 1"} for v in ("nan", "1e999")),
    {"camera_matrix_shape": "1 8"},
    {"camera_matrix_shape": "9999 9999"},
    *({"R": v} for v in ("1, 0, 0, 0, 1, 0, 0, 0, -1", "1, 2, 3", "2, 0, 0, 0, 2, 0, 0, 0, 2")),
    *({"T": v} for v in ("nan, 0, 0", "inf, 0, 0", "1, 2")),
    *({"image_width": v} for v in ("wide", "nan", "-5", "1e9", "0.5")),
    {"more": "image_width: 7\n"},
    {"more": opencv().partition("---\n")[2]},
]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "write", "changes"),
    [("a.toml", toml, c) for c in BAD_TOML]
    + [("a.json", panoptic, c) for c in BAD_PANOPTIC]
    + [("a.yaml", opencv, c) for c in BAD_OPENCV],
)
def test_what_is_no_camera_is_refused_with_its_file(tmp_path, name, write, changes):
    path = tmp_path / name
    path.write_text(write())
    assert len(load_cameras(path)) == 1
    path.write_text(write(**changes))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError) as refused:
            load_cameras(path)
    text = str(refused.value)
    assert text.startswith(f"{path}: ")
    assert "\n" not in text
    assert len(text) < len(str(path)) + 400


def test_a_rotation_as_matrix_and_numbers_in_a_row(tmp_path):
    (tmp_path / "a.toml").write_text(toml(rotation=TURNED))
    (tmp_path / "b.json").write_text(panoptic(K="[900, 0, 640, 0, 900, 360, 0, 0, 1]"))
    assert np.array_equal(load_cameras(tmp_path / "a.toml")[0].rotation, json.loads(TURNED))
    assert load_cameras(tmp_path / "b.json")[0].matrix[0, 2] == 640


def test_two_of_one_name(tmp_path):
    (tmp_path / "a.toml").write_text(toml() + toml().replace("cam_0", "cam_1"))
    with pytest.raises(InputError, match=r"a\.toml: two cameras are called one"):
        load_cameras(tmp_path / "a.toml")
    folder = tmp_path / "both"
    folder.mkdir()
    (folder / "a.toml").write_text(toml())
    (folder / "b.toml").write_text(toml())
    with pytest.raises(InputError, match="both: two cameras are called one"):
        load_cameras(folder)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.toml", "a" + ".a" * 200_000 + " = 1\n"),
        ("a.toml", "x = " + "[" * 100_000),
        ("a.toml", "x = " + "{a=" * 2000),
        ("a.toml", "x = " + "9" * 5000),
        ("a.toml", "\n" * 3_000_000),
        ("a.json", '{"cameras": ' + "[" * 200_000),
        ("a.json", '{"cameras": ' + "9" * 5000 + "}"),
        ("a.json", '{"a":' * 100_000),
        ("a.yaml", "%YAML:1.0\n" + OPEN * 30_000),
        ("a.yaml", "%YAML:1.0\n" + "a" * 1_900_000),
        ("a.yaml", "%YAML:1.0\na:" + "\n" * 1_900_000),
        ("a.yaml", "%YAML:1.0\n" + "a:\n" * 600_000),
        ("a.yaml", "%YAML:1.0\nK: !!opencv-matrix" + " " * 1_900_000),
    ],
)
def test_texts_that_would_take_long(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=rf"{name}: "):
        load_cameras(tmp_path / name)


def test_what_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "a.toml")
    with pytest.raises(InputError, match="is a named pipe, expected a file"):
        load_cameras(tmp_path / "a.toml")
    with pytest.raises(InputError, match="no such file"):
        load_cameras(tmp_path / "b.toml")
    (tmp_path / "c.json").symlink_to("/dev/zero")
    with pytest.raises(InputError, match="is a device, expected a file"):
        load_cameras(tmp_path / "c.json")


def test_a_rotation_vector_as_a_column(tmp_path):
    (tmp_path / "a.yaml").write_text(opencv(R_shape="3 1", R="0.1, 0.2, 0.3"))
    (tmp_path / "b.toml").write_text(toml(rotation="[[0.1], [0.2], [0.3]]"))
    a, b = (load_cameras(tmp_path / name)[0] for name in ("a.yaml", "b.toml"))
    assert np.array_equal(a.rotation, b.rotation)
