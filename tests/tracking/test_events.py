"""What is said of frames as they come: changes of status, joints newly rejected, hands anew."""

from types import SimpleNamespace

import numpy as np

from handtrack.tracking.block import EventsOf


def frames(first, *rows):
    """Frames of (status, joints rejected, restart, reason), one a nanosecond."""
    rejected = np.zeros((len(rows), 21), bool)
    for t, row in enumerate(rows):
        rejected[t, list(row[1])] = True
    return SimpleNamespace(
        time_ns=np.arange(first, first + len(rows)),
        status=np.array([row[0] for row in rows]),
        rejected=rejected,
        restart=np.array([row[2] for row in rows]),
        reason=np.array([row[3] for row in rows]),
    )


def test_events_go_on_from_one_part_to_the_next():
    rows = [
        ("fitted", (), False, ""),
        ("fitted", (8,), False, "tip off"),
        ("fitted", (8,), False, "tip off"),
        ("fitted", (8, 4), False, "two off"),
        ("predicted", (), False, "unseen"),
        ("fitted", (), True, "found anew"),
        ("fitted", (), True, "found anew"),
    ]
    expected = [
        (0, "info", "fitted"),
        (1, "info", "tip off"),
        (3, "info", "two off"),
        (4, "warning", "predicted: unseen"),
        (5, "info", "fitted: found anew"),
        (6, "info", "found anew"),
    ]
    for cut in range(1, len(rows)):
        events = EventsOf()
        said = events(frames(0, *rows[:cut])) + events(frames(cut, *rows[cut:]))
        assert [(e.time_ns, e.level, e.text) for e in said] == expected, cut
