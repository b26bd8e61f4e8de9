"""What tests of scenes with contact have in common."""

from collections.abc import Sequence

import pytest

from tripod_sim import Simulation, load_scene
from tripod_sim.errors import SceneError


def refusal(scene: str, overrides: Sequence[str]) -> str:
    """Return the one line with which `scene` is refused."""
    with pytest.raises(SceneError) as caught:
        Simulation(load_scene(scene, overrides))
    assert "\n" not in str(caught.value)
    return str(caught.value)


def assert_same_after_reset(simulation: Simulation, steps: int) -> None:
    """Assert that `steps`, which end pressed together, lead to the same bits after a reset."""

    def motion() -> bytes:
        for _ in range(steps):
            simulation.step()
        assert simulation.report.contact
        assert simulation.report.contact.pressed
        return simulation.positions.tobytes()

    first = motion()
    simulation.reset()
    assert motion() == first
