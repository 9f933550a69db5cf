"""Tables of a row per joint: frames that begin again, and what follows of them."""

import numpy as np
import pytest
from long_rows import MEDIAPIPE, STYLES, rows, same, text

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES


def test_rows_without_frames_begin_again(read, right):
    lines = [r[2:] for r in rows(right, MEDIAPIPE) if not (r[0] == 3 and "TIP" in r[2])]
    (sequence,) = read(text("landmark,x,y,z", lines))
    truth = right.copy()
    truth[3, [4, 8, 12, 16, 20]] = np.nan
    same(sequence, truth)


def test_time_instead_of_frames(read, right):
    lines = [(f"{r[0] / 60:.6f}", *r[2:]) for r in rows(right, MEDIAPIPE)]
    (sequence,) = read(text("timestamp,landmark,x,y,z", lines))
    same(sequence, right)
    np.testing.assert_allclose(sequence.time_ns, np.arange(12) * 1e9 / 60, atol=1000)


def test_names_of_pictures_are_frames(read, right):
    lines = [(f"img_{r[0]:04d}.jpg", *r[2:]) for r in rows(right, MEDIAPIPE)][::-1]
    (sequence,) = read(text("frame,landmark,x,y,z", lines))
    same(sequence, right)


def test_scores(read, right):
    lines = [(*r, 0 if (r[0], r[2]) == (4, "WRIST") else 0.5) for r in rows(right, MEDIAPIPE)]
    (sequence,) = read(text("frame,landmark,x,y,z,score", lines))
    assert not sequence.present[4, 0]
    assert sequence.present.sum() == 12 * 21 - 1
    assert sequence.confidence[0, 3] == 0.5


def test_a_finger_and_a_joint_of_it(read, right):
    lines = [
        (r[0], *(r[2].split("_") if "_" in r[2] else ["wrist", ""]), *r[3:])
        for r in rows(right, JOINT_NAMES)
    ]
    (sequence,) = read(text("frame,finger,joint,x,y,z", lines))
    same(sequence, right)


@pytest.mark.parametrize("head", ["frame,variable,value", "frame,joint,axis,value"])
def test_melted(read, right, head):
    together = head.count(",") == 2
    lines = [
        (r[0], f"{r[2]}_{axis}", value) if together else (r[0], r[2], axis, value)
        for r in rows(right, JOINT_NAMES)
        for axis, value in zip("xyz", r[3:], strict=True)
    ]
    lines = [lines[i] for i in np.random.default_rng(1).permutation(len(lines))]
    (sequence,) = read(text(head, lines))
    same(sequence, right)


def test_faces_and_bodies_beside_hands(read, left):
    lines = [(r[0], "left_hand", *r[2:]) for r in rows(left, STYLES["numbers"])]
    lines += [(t, "face", i, 0.1, 0.2, 0.3) for t in range(12) for i in range(60)]
    (sequence,) = read(text("frame,type,landmark_index,x,y,z", sorted(lines, key=lambda r: r[0])))
    same(sequence, left)
    assert sequence.hand == "left"


PICTURE = [0.4, 0.6]


def shares(joints, size=1.0):
    """Landmarks as MediaPipe gives them in the picture."""
    out = joints - joints[:, :1]
    out[..., :2] += np.array(PICTURE) + 0.01 * np.arange(len(joints))[:, None, None]
    return np.round(out * size, 6)


@pytest.mark.parametrize(("size", "said"), [(1.0, "shares of a picture"), (640.0, "pixels")])
def test_landmarks_in_the_picture_are_refused(read, right, size, said):
    with pytest.raises(ht.InputError, match=f"{said}.*take MediaPipe's world landmarks"):
        read(text("frame,hand,landmark,x,y,z", rows(shares(right, size), MEDIAPIPE, hand="Right")))


def test_only_x_and_y_are_refused(read, right):
    with pytest.raises(ht.InputError, match=r"only x and y.*world landmarks"):
        read(text("frame,landmark,x,y", [r[:-1] for r in rows(right, MEDIAPIPE)]))


def test_a_joint_twice_is_refused(read, right):
    lines = rows(right, MEDIAPIPE, hand="Left")
    with pytest.raises(ht.InputError, match=r"line 254: landmark WRIST of this frame.*line 2 too"):
        read(text("frame,hand,landmark,x,y,z", [*lines, lines[0]]))


def test_a_joint_that_nobody_knows_is_refused(read, right):
    lines = rows(right, [*MEDIAPIPE[:-1], "PINKY_TOES"])
    with pytest.raises(ht.InputError, match="line 22: landmark 'PINKY_TOES' is unknown, the near"):
        read(text("frame,landmark,x,y,z", lines))


def test_a_cell_that_is_no_number(read, right):
    lines = text("frame,landmark,x,y,z", rows(right, MEDIAPIPE)).split("\n")
    lines[5] = lines[5].rsplit(",", 1)[0] + ",far"
    with pytest.raises(ht.InputError, match="line 6: z is 'far', expected a number"):
        read("\n".join(lines))


def test_nul_bytes_at_the_start(read, right):
    lines = text("frame,landmark,x,y,z", rows(right, MEDIAPIPE))
    (sequence,) = read(b"\0" * 700 + lines.encode())
    same(sequence, right)
    with pytest.raises(ht.InputError):
        read(b"\0" * 700)


PLACES = {
    "list": "[{:.6f}, {:.6f}, {:.6f}]",
    "tuple": "({:.6f}, {:.6f}, {:.6f})",
    "numpy": "[ {:.6f} {:.6f}  {:.6f}]",
    "scalars": "(np.float64({:.6f}), np.float64({:.6f}), np.float64({:.6f}))",
    "blanks": "{:.6f} {:.6f} {:.6f}",
    "dict": "{{'x': {:.6f}, 'y': {:.6f}, 'z': {:.6f}}}",
    "landmark": "Landmark(x={:.6f}, y={:.6f}, z={:.6f}, visibility=0.0)",
    "protobuf": "x: {:.6f}\ny: {:.6f}\nz: {:.6f}\n",
}


@pytest.mark.parametrize("form", PLACES)
@pytest.mark.parametrize("kind", ["a frame", "a frame by number", "a joint", "no titles", "a hand"])
def test_cells_that_hold_places(read, right, form, kind):
    def cell(point):
        made = PLACES[form].format(*point)
        return made if form == "blanks" else f'"{made}"'

    if kind == "a joint":
        lines = [
            (t, n, cell(p))
            for t, of in enumerate(right)
            for n, p in zip(MEDIAPIPE, of, strict=True)
        ]
        content = text("frame,landmark,position", lines)
    elif kind == "a hand":
        inside = " " if form == "protobuf" else ", "
        lines = [
            (t, '"[' + inside.join(cell(p).strip('"') for p in of) + ']"')
            for t, of in enumerate(right)
        ]
        content = text("frame,landmarks", lines)
    else:
        titles = MEDIAPIPE if kind == "a frame" else [f"landmark_{i}" for i in range(21)]
        head = "frame," + ",".join(titles)
        content = text(head, [(t, *map(cell, of)) for t, of in enumerate(right)])
        if kind == "no titles":
            content = content.split("\n", 1)[1]
    (sequence,) = read(content)
    same(sequence, right)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("form", ["list", "tuple", "landmark"])
def test_cells_of_places_without_quotes(read, right, form, separator):
    lines = [
        separator.join([str(t), *(PLACES[form].format(*p) for p in of)])
        for t, of in enumerate(right)
    ]
    (sequence,) = read("\n".join([separator.join(["frame", *MEDIAPIPE]), *lines]))
    same(sequence, right)


def test_empty_cells_of_places_are_missing(read, right):
    lines = [(t, *(f'"{list(p)}"' for p in of)) for t, of in enumerate(np.round(right, 6).tolist())]
    lines[2] = (2, *["None"] * 21)
    lines[3] = (3, "", *lines[3][2:])
    (sequence,) = read(text("frame," + ",".join(MEDIAPIPE), lines))
    truth = right.copy()
    truth[2], truth[3, 0] = np.nan, np.nan
    same(sequence, truth)


def test_normalised_landmarks_in_cells_are_refused(read, right):
    lines = [
        (t, *(f'"NormalizedLandmark(x={x}, y={y}, z={z}, visibility=0.0)"' for x, y, z in of))
        for t, of in enumerate(shares(right))
    ]
    for some in (lines, lines[:1]):
        with pytest.raises(ht.InputError, match=r"shares of a picture.*world landmarks"):
            read(text("frame," + ",".join(MEDIAPIPE), some))


def test_a_cell_that_is_no_place(read, right):
    lines = [(t, *(f'"{list(p)}"' for p in of)) for t, of in enumerate(np.round(right, 6).tolist())]
    lines[2] = (*lines[2][:4], '"[0.1, 0.2]"', *lines[2][5:])
    with pytest.raises(ht.InputError, match=r"line 4: column 5 is '\[0.1, 0.2\]', expected 3 num"):
        read(text("frame," + ",".join(MEDIAPIPE), lines))
