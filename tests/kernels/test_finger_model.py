"""One finger's quadratic model inside its limits: solved exactly, its face reported rightly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from kernel_cases import nearest_on_ellipse, solve_finger
from scipy.optimize import minimize

from handtrack.hand.limits import PRESETS, Limits
from handtrack.kernels.workspace import GRADIENT, HINGE_1, HINGE_2, NORMAL, ROOT, TANGENT, WORK


@dataclass
class Problem:
    """min over x of (x - start) H (x - start) / 2 + (g + C rho) (x - start), inside the limits."""

    h: np.ndarray
    g: np.ndarray
    start: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    def value(self, x: np.ndarray) -> np.ndarray:
        d = x - self.start
        return 0.5 * ((d @ self.h) * d).sum(-1) + d @ self.g

    def slope(self, x: np.ndarray) -> np.ndarray:
        return self.g + (x - self.start) @ self.h

    def star(self, x: np.ndarray) -> np.ndarray:
        return np.where(x[..., :2] < 0, self.lower[:2], self.upper[:2])

    def edge(self, x: np.ndarray) -> np.ndarray:
        """Left side of eq. 3."""
        return np.square(x[..., :2] / self.star(x)).sum(-1)

    def nearest(self, x: np.ndarray) -> np.ndarray:
        out = np.clip(x, self.lower, self.upper)
        if self.edge(x) > 1:
            out[:2] = nearest_on_ellipse(x[:2], np.abs(self.star(x)))
        else:
            out[:2] = x[:2]
        return out


def some_problem(rng: np.random.Generator, limits: Limits, f: int, stiff: float) -> tuple:
    """A random convex model whose free minimiser is often outside, and its buffer."""
    part = slice(4 * f, 4 * f + 4)
    lower, upper = limits.lower[part], limits.upper[part]
    basis = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    h = basis @ np.diag(10 ** rng.uniform(-stiff, 0, 4)) @ basis.T
    full = np.zeros(20)
    full[part] = rng.uniform(lower, upper)
    start = limits.clamp(full)[part]
    wish = start + rng.normal(0, 1, 4) * rng.choice([0.05, 0.5, 3.0])
    coupling, rho = rng.normal(size=(4, 6)), rng.normal(0, 0.1, 6)
    g = -h @ (wish - start)
    works = np.zeros(1, WORK)
    w = works[0]
    w["angle"][:, f], w["lower"][:, f], w["upper"][:, f] = start, lower, upper
    # part of the gradient comes from the root's step
    w["row"][:, GRADIENT, f], w["row"][:, :ROOT, f] = g - coupling @ rho, coupling
    w["hessian"][:, :, f] = h
    w["root_step"] = rho
    return Problem(h, g, start, lower, upper), works


def solution(s: np.ndarray, f: int) -> np.ndarray:
    """The four angles after the step."""
    solve_finger(s, f)
    return s[0]["angle"][:, f] + s[0]["step"][:, f]


def problems(preset: str, stiff: float, n: int = 300):
    rng = np.random.default_rng(int(10 * stiff) + len(preset))
    for i in range(n):
        yield i % 5, *some_problem(rng, PRESETS[preset], i % 5, stiff)


@pytest.mark.parametrize("stiff", [0.5, 1.5, 2.5])
@pytest.mark.parametrize("preset", PRESETS)
def test_the_solution_is_feasible_and_stationary(preset, stiff):
    active = np.zeros(3)
    for f, problem, s in problems(preset, stiff):
        x = solution(s, f)
        assert problem.edge(x) <= 1 + 1e-12
        assert (x[2:] >= problem.lower[2:] - 1e-12).all()
        assert (x[2:] <= problem.upper[2:] + 1e-12).all()
        # in a convex model, a point that no downhill move inside the limits leaves is the best
        length = np.linalg.norm(problem.h, 2)
        moved = problem.nearest(x - problem.slope(x) / length)
        assert np.abs(moved - x).max() < 1e-7
        on_edge = problem.edge(x) > 1 - 1e-9
        active += [on_edge, *(np.isclose(x[2:], problem.lower[2:]) | (x[2:] == problem.upper[2:]))]
    assert (active > 30).all()


@pytest.mark.parametrize("preset", PRESETS)
def test_the_solution_is_as_good_as_a_general_solvers(preset):
    for f, problem, s in problems(preset, 1.0, 60):
        x = solution(s, f)
        star = problem.star(x)
        answers = [
            minimize(
                problem.value,
                problem.nearest(first),
                jac=problem.slope,
                bounds=list(zip(problem.lower, problem.upper, strict=True)),
                constraints={"type": "ineq", "fun": lambda x, p=problem: 1 - p.edge(x)},
                method="SLSQP",
                tol=1e-10,
            )
            for first in (problem.start, 0.5 * np.append(star, problem.start[2:]))
        ]
        best = min(a.fun for a in answers)
        scale = abs(problem.value(problem.nearest(np.zeros(4)))) + abs(best)
        assert problem.value(x) <= best + 1e-6 * scale
        assert problem.value(x) <= 1e-15  # no step at all is allowed too


@pytest.mark.parametrize("preset", PRESETS)
def test_the_solution_beats_a_dense_search(preset):
    rng = np.random.default_rng(9)
    r, t = np.sqrt(rng.random(40_000)), rng.uniform(0, 2 * np.pi, 40_000)
    r[:20_000] = 1.0
    disk = np.stack([r * np.cos(t), r * np.sin(t)], -1)
    for f, problem, s in problems(preset, 1.0, 60):
        x = solution(s, f)
        saddle = np.where(disk < 0, -problem.lower[:2], problem.upper[:2]) * disk
        share = rng.random((len(disk), 2))
        share = np.where(rng.random(share.shape) < 0.3, np.round(share), share)
        hinges = problem.lower[2:] + share * (problem.upper - problem.lower)[2:]
        values = problem.value(np.concatenate([saddle, hinges], -1))
        assert problem.value(x) <= values.min() + 1e-12 * np.abs(values).max()


def test_a_free_minimiser_inside_is_the_newton_step():
    found = 0
    for f, problem, s in problems("anatomical", 0.5):
        free = problem.start - np.linalg.solve(problem.h, problem.g)
        if problem.edge(free) > 1 or (free != np.clip(free, problem.lower, problem.upper)).any():
            continue
        found += 1
        assert np.allclose(solution(s, f), free, rtol=0, atol=1e-12)
        assert (s[0]["free"][[NORMAL, HINGE_1, HINGE_2], f] == 1).all()
        assert s[0]["curvature"][f] == 0
    assert found > 30


@pytest.mark.parametrize("preset", PRESETS)
def test_the_face_is_where_the_solution_is(preset):
    seen = set()
    for f, problem, s in problems(preset, 1.0):
        x = solution(s, f)
        slope = problem.slope(x)
        w = s[0]
        for i in (HINGE_1, HINGE_2):
            at_bound = x[i] in (problem.lower[i], problem.upper[i])
            if w["free"][i, f] == 1:
                assert abs(slope[i]) < 1e-8
            else:
                assert x[i] == pytest.approx(problem.lower[i] if slope[i] > 0 else problem.upper[i])
            seen.add((i, at_bound))
        if w["free"][NORMAL, f] == 1:
            assert np.abs(slope[:2]).max() < 1e-8
            seen.add("inside")
            continue
        seen.add("edge")
        # H + multiplier x Hessian of the constraint, along the tangent
        normal = w["normal"][:, f]
        inverse = 1 / problem.star(x) ** 2
        outward = x[:2] * inverse
        assert np.allclose(normal, outward / np.linalg.norm(outward), rtol=0, atol=1e-9)
        assert abs(slope[0] * normal[1] - slope[1] * normal[0]) < 1e-6 * np.linalg.norm(slope[:2])
        multiplier = -(slope[:2] @ outward) / (outward @ outward)
        tangent = np.array([-normal[1], normal[0]])
        assert w["free"][TANGENT, f] == 1
        assert w["curvature"][f] == pytest.approx(
            multiplier * (tangent**2 @ inverse), rel=1e-5, abs=1e-12
        )
    assert seen == {(2, True), (2, False), (3, True), (3, False), "inside", "edge"}
