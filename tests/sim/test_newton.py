"""Newton's method where the matrix is singular."""

import pytest

from tests.messages import raises_naming
from tripod_sim import Simulation, StepError, load_scene
from tripod_sim.integrators.load_steps import LoadSteps
from tripod_sim.integrators.newton import NewtonReport
from tripod_sim.state import State


@pytest.mark.parametrize("enough", [0, 2, 3, 4])
def test_a_singular_tangent_is_shifted_a_hundredfold_until_it_is_positive(
    enough: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From 1e-8 of its largest entry on, three times; `enough`: the shifts that do not suffice."""
    simulation = Simulation(load_scene("silicone", ["mesh.level=1", "solver.max_halvings=0"]))
    system, tried = simulation._system, list[float]()
    plain = system.factor

    def factor(shift: float = 0.0) -> bool:
        tried.append(shift)
        return plain(shift) and enough < 4 and len(tried) > 2 + enough  # as it is, projected, then shifted

    monkeypatch.setattr(system, "factor", factor)
    simulation._stepper.forget()
    if enough == 4:
        with raises_naming(StepError, "matrix is singular"):
            simulation.step()
    else:
        assert simulation.step().iterations > 0
    first = 1e-8 * system.elastic.largest_stiffness()
    shifts = [0.0, 0.0, *(first * 100.0**k for k in range(min(enough + 1, 4)))]
    assert tried[: len(shifts)] == pytest.approx(shifts, rel=0.05)


@pytest.mark.parametrize(
    ("scene", "words", "renews"),
    [
        ("cloth", ["springs.nodes=8", "solver.linear=cg", "inertia.scheme=implicit_euler"], True),
        ("silicone", ["mesh.level=1", "solver.linear=cg", "solver.mode=newton"], False),
    ],
)
def test_with_conjugate_gradients_springs_renew_the_hessian_and_solids_keep_it(
    scene: str, words: list[str], renews: bool
) -> None:
    """That of springs soon is out of date, and an iterative solve by it costs as much as by a new one."""
    simulation = Simulation(load_scene(scene, words))
    reports = [simulation.step() for _ in range(10)]
    solves, renewed = (sum(getattr(r, name) for r in reports) for name in ("iterations", "factorisations"))
    assert solves > 10
    assert (renewed == solves) == renews


def test_each_part_of_a_static_step_may_take_its_load_in_increments(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = list[int]()
    whole = LoadSteps.carry

    def carry(self: LoadSteps, state: State) -> NewtonReport:
        calls.append(1)
        return whole(self, state)

    simulation = Simulation(load_scene("tripod", ["inertia=off", "damping=off", "mesh.level=1"]))
    monkeypatch.setattr(LoadSteps, "carry", carry)
    report = simulation.step(simulation.command - [0.6, 0.0, 0.0, 0.0])
    assert report.parts > 2
    assert len(calls) == report.parts


def test_a_static_step_in_which_nothing_moves_takes_no_tangent() -> None:
    """The tangent of the step before told whether it is stable."""
    simulation = Simulation(load_scene("tripod", ["inertia=off", "damping=off", "mesh.level=1"]))
    first, again = simulation.step(), simulation.step()
    assert first.factorisations > 0
    assert (again.iterations, again.factorisations, again.unstable) == (0, 0, False)
