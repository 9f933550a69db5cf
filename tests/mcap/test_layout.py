"""Fixed-size messages against protobuf's own decoder."""

from __future__ import annotations

import numpy as np
import pytest

from handtrack.mcap.frames import Layout, timestamps, varint
from handtrack.mcap.schema import message_class

TIMES = [0, 1, 999_999_999, 1_000_000_000, 1_700_000_000_123_456_789, 2**63 - 1, 2**64 - 1]


def test_timestamps_of_every_size_decode() -> None:
    log = Layout().timestamp(1)
    rows = log.rows(len(TIMES), **timestamps(np.array(TIMES, np.uint64)))
    for row, time in zip(rows, TIMES, strict=True):
        stamp = message_class("foxglove.Log").FromString(row.tobytes()).timestamp
        assert (stamp.seconds, stamp.nanos) == divmod(time, 10**9)


@pytest.mark.parametrize("value", [0, 1, 127, 128, 300, 2**14, 2**32 - 1, 2**63])
def test_varint_is_what_protobuf_reads(value: int) -> None:
    from google.protobuf.internal.decoder import _DecodeVarint

    data = varint(value)
    assert _DecodeVarint(data, 0) == (value, len(data))


def test_nested_slots_and_repeated_names() -> None:
    vector = Layout().number(1, "x").number(2, "x").number(3, "z")
    pose = Layout().field(1, vector)
    x, z = np.array([1.5, np.nan]), np.array([-0.0, np.inf])
    rows = pose.rows(2, x=x, z=z)
    first, second = (message_class("foxglove.Pose").FromString(r.tobytes()) for r in rows)
    assert (first.position.x, first.position.y, first.position.z) == (1.5, 1.5, 0.0)
    assert np.signbit(first.position.z)
    assert np.isnan(second.position.x)
    assert second.position.z == np.inf


def test_no_rows() -> None:
    assert Layout().number(1, "x").rows(0, x=np.empty(0)).shape == (0, 9)
