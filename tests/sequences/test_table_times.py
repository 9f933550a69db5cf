"""Tables of a row per frame: times, confidences and other columns."""

import numpy as np
import pytest
from wide_rows import text, titles

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES


@pytest.mark.parametrize(
    ("title", "values", "fps"),
    [
        ("timestamp", lambda i: f"{1.7e9 + i / 60:.6f}", 60),
        ("Time (s)", lambda i: f"{i / 60:.6f}", 60),
        ("t", lambda i: f"{i / 60:.6f}", 60),
        ("elapsed", lambda i: f"{i / 60:.6f}", 60),
        ("frame_time", lambda i: f"{i / 60:.6f}", 60),
        ("time_ms", lambda i: f"{i * 1000 / 60:.3f}", 60),
        ("timestamp_ns", lambda i: str(1_700_000_000_000_000_000 + i * 16_666_667), 60),
        ("stamp", lambda i: f"{i / 60:.6f}", 60),
        ("tracking_timestamp_us", lambda i: str(i * 16_667), 60),
    ],
)
def test_times(read, right, title, values, fps):
    lines = text([title, *titles(JOINT_NAMES)], right).splitlines()
    lines[1:] = [f"{values(i)},{line}" for i, line in enumerate(lines[1:])]
    (sequence,) = read("\n".join(lines))
    assert sequence.fps == pytest.approx(fps, rel=1e-3)


def test_a_stamp_of_ros_in_two_columns(read, right):
    lines = text(["header.stamp.sec", "header.stamp.nanosec", *titles(JOINT_NAMES)], right)
    lines = lines.splitlines()
    lines[1:] = [
        f"{1700000000 + i // 2},{i % 2 * 500_000_000},{r}" for i, r in enumerate(lines[1:])
    ]
    (sequence,) = read("\n".join(lines))
    assert sequence.time_ns[0] == 1_700_000_000_000_000_000
    assert sequence.fps == pytest.approx(2)


def test_confidences(read, right):
    head = titles(range(21), "{a}{n}")
    with_sure = [t for i in range(21) for t in (*head[3 * i : 3 * i + 3], f"visibility{i}")]
    sure = np.full((12, 21, 1), 0.5)
    sure[2, 3] = 0.25
    (sequence,) = read(text(with_sure, np.concatenate([right, sure], axis=2)))
    assert sequence.confidence[2, 3] == 0.25
    assert sequence.confidence[2, 4] == 0.5
    # MediaPipe writes 0 for what it does not know
    (sequence,) = read(text(with_sure, np.concatenate([right, 0 * sure], axis=2)))
    assert (sequence.confidence == 1).all()
    (bare,) = read(text(None, np.concatenate([right, sure], axis=2)))
    assert bare.confidence[2, 3] == 0.25


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("little_tip", "litle_tpi"),
            r"litle_tpi_x.* not understood, and only 20 of 21 joints are: is it little_tip",
        ),
        (
            ("index_mcp", "index_xyzzy"),
            "looks like a joint.*index_xyzzy_x|index_xyzzy_x.*looks like",
        ),
        (("thumb_cmc", "thumb_zeroth"), "thumb_zeroth_x.*looks like a joint"),
    ],
)
def test_a_joint_that_is_not_understood(read, right, change, message):
    with pytest.raises(ht.InputError, match=message):
        read(text([t.replace(*change) for t in titles(JOINT_NAMES)], right))


@pytest.mark.parametrize(
    ("title", "message"),
    [("time_of_day_code", "looks like a time"), ("handedness_guess", "looks like a hand")],
)
def test_a_time_or_hand_that_is_not_understood(read, right, title, message):
    lines = text([title, *titles(JOINT_NAMES)], right).splitlines()
    lines[1:] = [f"7,{line}" for line in lines[1:]]
    with pytest.raises(ht.InputError, match=message):
        read("\n".join(lines))


def test_places_that_are_known_and_other_quantities_are_left_out(read, right):
    more = ["palm_x", "palm_y", "palm_z", "index_metacarpal_x", "index_metacarpal_y"]
    more += ["index_metacarpal_z", "thumb_tip_velocity_x", "wrist_qw"]
    lines = text([*more, *titles(JOINT_NAMES)], right).splitlines()
    lines[1:] = ["1,2,3,4,5,6,7,8," + line for line in lines[1:]]
    (sequence,) = read("\n".join(lines))
    np.testing.assert_allclose(sequence.joints, right, atol=1e-6)
    assert "columns not used: thumb_tip_velocity_x, wrist_qw" in sequence.notes


def test_numbers_from_1_to_20_lack_the_wrist(read, right):
    (sequence,) = read(text(titles(range(1, 21), "{a}{n}"), right[:, 1:]))
    np.testing.assert_allclose(sequence.joints[:, 1:], right[:, 1:], atol=1e-6)
    assert not sequence.present[:, 0].any()
    with pytest.raises(ht.InputError, match=r"numbered 1 to 19.*expected 0 to 20 or 1 to 21"):
        read(text(titles(range(1, 20), "{a}{n}"), right[:, 1:20]))


def test_x_and_y_alone_are_a_picture(read, right):
    head = [t for t in titles(range(21), "{a}_{n}") if not t.startswith("z")]
    with pytest.raises(ht.InputError, match=r"only x and y.*world landmarks"):
        read(text(head, right[..., :2] * 640))


def test_an_index_and_63_numbers(read, left):
    lines = [f"{i},{line}" for i, line in enumerate(text(None, left * 1e3, digits=3).splitlines())]
    (sequence,) = read("\n".join(lines))
    np.testing.assert_allclose(sequence.joints, left, atol=1e-5)
    assert sequence.hand == "left"
    assert any("64 columns" in note and "mm" in note for note in sequence.notes)
    shuffled = left[:, np.random.default_rng(2).permutation(21)]
    rows = [f"{i},{line}" for i, line in enumerate(text(None, shuffled * 1e3).splitlines())]
    with pytest.raises(ht.InputError, match="--order"):
        read("\n".join(rows))


def test_a_time_and_63_numbers(read, right):
    lines = [f"{i / 50:.3f},{line}" for i, line in enumerate(text(None, right).splitlines())]
    (sequence,) = read("\n".join(lines))
    assert sequence.fps == pytest.approx(50)
    assert "the first column was read as times" in sequence.notes


def test_21_lines_of_3_numbers(read, right):
    (sequence,) = read("\n".join(" ".join(map(repr, map(float, j))) for j in right[0]), "a.txt")
    np.testing.assert_array_equal(sequence.joints, right[:1])


def test_titles_in_a_windows_code_page_are_read(tmp_path, right):
    lines = [";".join(["Time (s)", "Abstand \xb5m", *titles(JOINT_NAMES)])]
    for i, joints in enumerate(right):
        cells = [f"{v:.9f}" for v in joints.ravel()]
        lines.append(";".join([f"{i / 60:.6f}", "0", *cells]))
    path = tmp_path / "a.csv"
    path.write_bytes("\r\n".join(lines).encode("latin-1"))
    (sequence,) = ht.load(path)
    np.testing.assert_allclose(sequence.joints, right, atol=1e-8)
    # in the rows themselves it is no text that can be trusted
    path.write_bytes("\n".join([lines[0], *lines[1:] * 2, "\xb5" + lines[1]]).encode("latin-1"))
    with pytest.raises(ht.InputError, match="save it as UTF-8"):
        ht.load(path)
