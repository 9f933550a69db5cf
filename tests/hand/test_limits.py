"""Limits: the presets' numbers, and the nearest valid pose."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from handtrack.errors import SettingsError
from handtrack.hand.limits import PRESETS, Limits, preset
from handtrack.hand.skeleton import ANGLE_JOINT, ANGLE_NAMES

# Li et al. 2021, Table 1 [degrees]: joints, z min, z max, y min, y max
TABLE_1 = (
    ((6, 10, 14, 18), 0, 100, None, None),
    ((3, 7, 11, 15, 19), 0, 90, None, None),
    ((2,), 0, 80, None, None),
    ((1,), -20, 20, -30, 30),
    ((5, 9, 13, 17), -10, 85, -10, 10),
)

# ranges that others publish [degrees]; the wider preset must hold all of them
PUBLISHED = {
    "index_mcp_flexion": (-16, 90),
    "middle_mcp_flexion": (-10, 90),
    "ring_mcp_flexion": (-10, 90),
    "little_mcp_flexion": (-10, 90),
    "index_mcp_abduction": (-20, 30),
    "middle_mcp_abduction": (-28, 20),
    "ring_mcp_abduction": (-16, 20),
    "little_mcp_abduction": (-39, 28),
    "thumb_cmc_flexion": (-45, 74),
    "thumb_cmc_abduction": (-45, 45),
    "thumb_mcp_flexion": (0, 74),
    "thumb_ip_flexion": (-15, 90),
    "index_pip_flexion": (-1, 108),
    "little_pip_flexion": (-1, 108),
    "index_dip_flexion": (-1, 90),
    "little_dip_flexion": (-1, 90),
}

SADDLES = np.array([[0, 1], [4, 5], [8, 9], [12, 13], [16, 17]])
HINGES = np.setdiff1d(np.arange(20), SADDLES)


def boundary(limits: Limits, f: int, n: int = 20_000) -> np.ndarray:
    """(n, 2) points of saddle f's four quarter-ellipses."""
    low, high = limits.lower[SADDLES[f]], limits.upper[SADDLES[f]]
    t = np.linspace(0, 2 * np.pi, n)
    unit = np.stack([np.cos(t), np.sin(t)], -1)
    return np.where(unit < 0, -low, high) * unit


def ellipse_value(limits: Limits, angles: np.ndarray) -> np.ndarray:
    """(..., 5) left side of eq. 3 for each saddle."""
    pairs = angles[..., SADDLES]
    star = np.where(pairs < 0, limits.lower[SADDLES], limits.upper[SADDLES])
    return ((pairs / star) ** 2).sum(-1)


def some_limits(rng: np.random.Generator) -> Limits:
    lower = -rng.uniform(0.05, 1.5, 20)
    lower[HINGES] = rng.uniform(-0.5, 0.3, len(HINGES))
    upper = rng.uniform(0.05, 1.5, 20)
    upper[HINGES] = lower[HINGES] + rng.uniform(0, 2, len(HINGES))
    return Limits("some", lower, upper)


def test_li2021_is_table_1_number_by_number():
    limits = preset("li2021")
    checked = set()
    for joints, *degrees in TABLE_1:
        for joint in joints:
            z, *y = np.flatnonzero(joint == ANGLE_JOINT)
            assert np.rad2deg([limits.lower[z], limits.upper[z]]) == pytest.approx(degrees[:2])
            checked.add(int(z))
            assert len(y) == (degrees[2] is not None)
            for a in y:
                assert np.rad2deg([limits.lower[a], limits.upper[a]]) == pytest.approx(degrees[2:])
                checked.add(int(a))
    assert checked == set(range(20))


def test_anatomical_holds_table_1_and_the_published_ranges():
    wide, table = PRESETS["anatomical"], PRESETS["li2021"]
    assert (wide.lower <= table.lower).all()
    assert (wide.upper >= table.upper).all()
    for name, (low, high) in PUBLISHED.items():
        a = ANGLE_NAMES.index(name)
        assert np.rad2deg(wide.lower[a]) <= low + 1e-9, name
        assert np.rad2deg(wide.upper[a]) >= high - 1e-9, name
    # real DIP and thumb IP joints hyperextend
    assert (wide.lower[[3, 7, 11, 15, 19]] < 0).all()
    # so every pose of Table 1 is anatomical
    rng = np.random.default_rng(0)
    poses = table.clamp(rng.uniform(1.5 * table.lower - 0.3, 1.5 * table.upper, (500, 20)))
    assert wide.contains(poses).all()


@pytest.mark.parametrize("name", PRESETS)
def test_contains_follows_eq_3_and_the_intervals(name):
    limits = PRESETS[name]
    rng = np.random.default_rng(1)
    angles = rng.uniform(1.2 * limits.lower - 0.02, 1.2 * limits.upper, (4000, 20))
    inside = (ellipse_value(limits, angles) <= 1).all(-1)
    hinges = angles[:, HINGES]
    inside &= ((hinges >= limits.lower[HINGES]) & (hinges <= limits.upper[HINGES])).all(-1)
    assert np.array_equal(limits.contains(angles), inside)
    # each condition alone decides
    for a in range(20):
        for end, outward in ((limits.lower, -1), (limits.upper, 1)):
            one = np.zeros(20)
            one[HINGES] = limits.lower[HINGES]
            one[a] = end[a]
            assert limits.contains(one)
            one[a] += outward * 1e-6
            assert not limits.contains(one)


def test_clamp_leaves_valid_angles_alone_and_is_idempotent():
    rng = np.random.default_rng(2)
    for limits in (*PRESETS.values(), *(some_limits(rng) for _ in range(20))):
        angles = rng.uniform(3 * limits.lower - 1, 3 * limits.upper + 1, (300, 20))
        before = angles.copy()
        clamped = limits.clamp(angles)
        assert np.array_equal(angles, before)
        assert limits.contains(clamped, tolerance=1e-15).all()
        assert ellipse_value(limits, clamped).max() <= 1 + 1e-15
        assert np.abs(limits.clamp(clamped) - clamped).max() <= 1e-15
        # a little inside nothing moves at all
        inner = clamped.copy()
        inner[:, SADDLES] *= 1 - 1e-12
        assert np.array_equal(limits.clamp(inner), inner)


def test_clamp_is_the_nearest_point_of_the_ellipse():
    rng = np.random.default_rng(3)
    for limits in (*PRESETS.values(), *(some_limits(rng) for _ in range(4))):
        for f in range(5):
            edge = boundary(limits, f)
            angles = np.zeros((60, 20))
            points = rng.uniform(-2.5, 2.5, (60, 2))
            points[:4] = [(2, 0), (-2, 0), (0, 2), (0, -2)]
            angles[:, SADDLES[f]] = points
            nearest = limits.clamp(angles)[:, SADDLES[f]]
            outside = ellipse_value(limits, angles)[:, f] > 1
            assert outside.sum() > 15
            assert {tuple(q) for q in np.sign(points[outside])} >= {(1, 1), (1, -1), (-1, 1)}
            for point, found in zip(points[outside], nearest[outside], strict=True):
                best = np.linalg.norm(edge - point, axis=1).min()
                distance = np.linalg.norm(found - point)
                # no point of the edge is nearer, and the sampled edge is dense
                assert distance <= best + 1e-12
                assert distance >= best - 1e-5
                assert (found * point >= 0).all()  # the quadrant is kept


def test_clamp_agrees_with_a_general_solver():
    limits = preset("anatomical")
    rng = np.random.default_rng(4)
    for f in range(5):
        point = rng.choice([-1, 1], 2) * rng.uniform(0.9, 1.6, 2)
        angles = np.zeros(20)
        angles[SADDLES[f]] = point
        side = np.where(point < 0, limits.lower[SADDLES[f]], limits.upper[SADDLES[f]])
        answer = minimize(
            lambda x, p=point: ((x - p) ** 2).sum(),
            0.1 * side,
            constraints={"type": "ineq", "fun": lambda x, s=side: 1 - ((x / s) ** 2).sum()},
            tol=1e-10,
        )
        assert answer.success
        assert limits.clamp(angles)[SADDLES[f]] == pytest.approx(answer.x, abs=1e-6)


def test_hinges_are_clipped():
    limits = preset("li2021")
    low, high = np.zeros(20), np.zeros(20)
    low[HINGES], high[HINGES] = -9, 9
    assert np.array_equal(limits.clamp(low)[HINGES], limits.lower[HINGES])
    assert np.array_equal(limits.clamp(high)[HINGES], limits.upper[HINGES])


@given(
    a=st.tuples(st.floats(1e-3, 3), st.floats(1e-3, 3)),
    p=st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)),
)
def test_nearest_point_has_the_ellipse_normal(a, p):
    axes, point = np.array(a), np.array(p)
    if not ((point / axes) ** 2).sum() > 1:
        return
    angles = np.zeros((5, 4))
    angles[3, :2] = point
    box = np.tile([*axes, 1.0, 1.0], 5)
    x = Limits("symmetric", -box, box).clamp(angles.ravel())[12:14]
    assert ((x / axes) ** 2).sum() == pytest.approx(1, abs=1e-9)
    normal, away = x / axes**2, point - x
    across = normal[0] * away[1] - normal[1] * away[0]
    assert abs(across) <= 1e-9 * np.linalg.norm(normal) * (np.linalg.norm(away) + axes.max())
    assert normal @ away >= -1e-12


def test_violation_is_the_distance_to_the_nearest_valid_angle():
    limits = preset("li2021")
    angles = np.zeros((2, 3, 20))
    angles[0, 1, 2] = np.deg2rad(95)
    angles[1, 2, 5] = np.deg2rad(-12)
    violation = limits.violation(angles)
    assert violation.shape == (2, 3, 20)
    assert np.rad2deg(violation[0, 1, 2]) == pytest.approx(15)
    assert np.rad2deg(violation[1, 2, 5]) == pytest.approx(2)
    assert np.count_nonzero(violation > 1e-12) == 2
    assert limits.contains(angles).tolist() == [[True, False, True], [True, True, False]]


def test_clamp_takes_any_leading_axes():
    limits = preset("anatomical")
    angles = np.random.default_rng(5).uniform(-2, 2, (3, 4, 20))
    batch = limits.clamp(angles)
    one_by_one = np.array([[limits.clamp(a) for a in row] for row in angles])
    assert np.allclose(batch, one_by_one, rtol=0, atol=1e-14)
    assert limits.clamp(np.zeros((0, 20))).shape == (0, 20)


def changed(a: int, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    table = preset("li2021")
    lower, upper = table.lower.copy(), table.upper.copy()
    lower[a], upper[a] = low, high
    return lower, upper


@pytest.mark.parametrize(
    ("lower", "upper", "says"),
    [
        (np.zeros(19), np.ones(20), "lower has shape"),
        (-np.ones(20), np.ones((20, 1)), "upper has shape"),
        (np.full(20, np.nan), np.ones(20), "lower"),
        (-np.ones(20), np.full(20, np.inf), "upper"),
        (*changed(2, 0.5, 0.4), "thumb_mcp_flexion has a lower limit above"),
        (*changed(4, 0.0, 1.0), "index_mcp_flexion must hold 0"),
        (*changed(17, -0.1, 0.0), "little_mcp_abduction must hold 0"),
        (*changed(9, 0.1, 0.3), "middle_mcp_abduction must hold 0"),
    ],
)
def test_bad_limits_are_named(lower, upper, says):
    with pytest.raises(SettingsError, match=says) as raised:
        Limits("mine", lower, upper)
    assert "mine" in str(raised.value)


def test_a_hinge_may_be_fixed_and_need_not_hold_zero():
    lower, upper = changed(6, 0.4, 0.4)
    limits = Limits("mine", lower, upper)
    assert limits.clamp(np.zeros(20))[6] == 0.4


def test_limits_keep_their_own_copy():
    lower, upper = changed(6, 0.0, 1.0)
    limits = Limits("mine", lower, upper)
    lower[6] = -5
    assert limits.lower[6] == 0
    with pytest.raises(ValueError, match="read-only"):
        limits.upper[0] = 3


def test_an_unknown_preset_lists_the_known_ones():
    with pytest.raises(SettingsError, match=r"'wide'.*li2021.*anatomical"):
        preset("wide")


def test_a_missing_angle_stays_missing_and_the_others_are_clipped():
    limits = preset("li2021")
    angles = np.zeros(20)
    angles[[4, 5, 6, 8]] = np.nan, 2.0, 9.0, -3.0
    found = limits.clamp(angles)
    assert np.isnan(found[4])
    assert np.isfinite(np.delete(found, 4)).all()
    assert (found[[5, 6]] == limits.upper[[5, 6]]).all()
    assert found[8] == limits.lower[8]
    assert not limits.contains(angles)
