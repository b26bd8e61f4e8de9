"""The one way down a potential, on potentials of few unknowns that are known by heart."""

from collections.abc import Callable

import numpy as np
import pytest

from tripod_sim.errors import UnsolvedError
from tripod_sim.integrators.minimise import Descent, minimise, search

Function = Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]


class Plain(Descent):
    """A function with gradient and Hessian; keeps what was taken."""

    def __init__(self, function: Function, start: list[float], kept: np.ndarray | None = None) -> None:
        self.function, self.x, self.kept = function, np.array(start), kept
        self.phi, self.g, _ = function(self.x)
        self.trial, self.g_trial, self.taken, self.factored = self.x, self.g, [self.phi], 0

    def ends(self) -> bool:
        if len(self.taken) > 50:
            raise UnsolvedError("too many steps")
        return bool(np.abs(self.g).max() <= 1e-10)

    def holds(self) -> bool:
        return self.kept is not None

    def factor(self) -> None:
        self.kept, self.factored = self.function(self.x)[2], self.factored + 1
        assert np.linalg.eigvalsh(self.kept)[0] > 0

    def propose(self) -> np.ndarray:
        assert self.kept is not None
        return np.linalg.solve(self.kept, self.g)

    def walk(self, p: np.ndarray, share: float) -> float:
        self.trial = self.x - share * p
        phi, self.g_trial, _ = self.function(self.trial)
        return phi

    def slope(self, p: np.ndarray, *, trial: bool) -> float:
        return float((self.g_trial if trial else self.g) @ p)

    def left(self) -> float:
        return float(np.linalg.norm(self.g_trial) / np.linalg.norm(self.g))

    def converges(self) -> bool:
        return self.left() < 0.5

    def slack(self) -> float:
        return 1e-15

    def take(self, phi: float, share: float) -> None:
        self.x, self.g, self.phi = self.trial, self.g_trial, phi
        self.taken.append(phi)

    def rests(self, *, fresh: bool) -> bool:
        if fresh:
            raise UnsolvedError("no lower value")
        return False


def bowl(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return sqrt(1 + x²): whole steps of Newton's method from beyond 1 lead ever further away."""
    r = np.sqrt(1 + x**2)
    return float(r.sum()), x / r, np.diag(r**-3)


def valley(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return a curved valley, x⁴-like along and steep across it."""
    y = x[1] - x[0] ** 2
    g = np.array([x[0] - 20 * x[0] * y, 10 * y])
    return (
        0.5 * x[0] ** 2 + 5 * y**2,
        g,
        np.array([[1 + 40 * x[0] ** 2 + 20 * max(0.0, -y), -20 * x[0]], [-20 * x[0], 10.0]]),
    )


@pytest.mark.parametrize(("function", "start"), [(bowl, [30.0]), (bowl, [-2.0, 5.0]), (valley, [-1.2, 1.0])])
def test_it_goes_down_to_the_minimum_from_where_whole_steps_lead_astray(
    function: Function, start: list[float]
) -> None:
    descent = Plain(function, start)
    minimise(descent)
    assert descent.x == pytest.approx(0.0, abs=1e-8)
    assert all(b <= a + 1e-15 for a, b in zip(descent.taken, descent.taken[1:], strict=False))


def test_a_hessian_at_hand_serves_while_steps_with_it_converge() -> None:
    near = np.diag([1.2, 0.9])
    square = Plain(lambda x: (0.5 * float(x @ x), x.copy(), np.eye(2)), [3.0, -2.0], near)
    minimise(square)
    assert square.factored == 0
    soft = Plain(lambda x: (0.5 * float(x @ x), x.copy(), np.eye(2)), [3.0, -2.0], np.diag([0.4, 0.4]))
    minimise(soft)  # steps by it go two and a half times too far
    assert soft.factored == 1


def test_a_step_that_goes_too_far_ends_where_the_slope_is_small() -> None:
    descent = Plain(bowl, [3.0])
    descent.factor()
    p = descent.propose()
    share, phi = search(descent, p)
    assert 0.0 < share < 0.2
    assert abs(descent.slope(p, trial=True)) <= 0.3 * descent.slope(p, trial=False)
    assert phi < 1.2


def test_where_no_step_goes_down_the_point_stays() -> None:
    """As a gradient that is wrong makes it."""
    descent = Plain(lambda x: (float(x @ x), -2 * x, np.eye(1)), [3.0])
    with pytest.raises(UnsolvedError):
        minimise(descent)
    assert descent.x[0] == 3.0


def test_where_there_is_no_potential_a_step_is_shortened() -> None:
    def wall(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        if x[0] <= 0:
            return np.inf, x * np.nan, np.eye(1)
        return float(x[0] - np.log(x[0])), 1 - 1 / x, np.diag(x**-2)

    descent = Plain(wall, [8.0])  # a whole step of Newton's method leads to -48
    minimise(descent)
    assert descent.x == pytest.approx(1.0, abs=1e-8)
