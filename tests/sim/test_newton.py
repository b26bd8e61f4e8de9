"""Newton's method where the matrix is singular."""

import pytest

from tests.messages import raises_naming
from tripod_sim import Simulation, StepError, load_scene


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
    if enough == 4:
        with raises_naming(StepError, "matrix is singular"):
            simulation.step()
    else:
        assert simulation.step().iterations > 0
    first = 1e-8 * system.elastic.largest_stiffness()
    shifts = [0.0, 0.0, *(first * 100.0**k for k in range(min(enough + 1, 4)))]
    assert tried[: len(shifts)] == pytest.approx(shifts, rel=0.05)
