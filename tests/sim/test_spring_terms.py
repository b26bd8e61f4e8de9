"""Springs are a term as others: which list of terms has a compiled explicit loop, and what is known of forces."""

import numpy as np
import pytest

from tripod_sim import Simulation, load_scene
from tripod_sim.integrators.explicit import ExplicitSteps
from tripod_sim.springs.automatic import AutomaticSprings
from tripod_sim.springs.explicit import ExplicitSprings

EXPLICIT = ("semi_implicit_euler", "rk4", "explicit_euler")
LOAD = "load=[{set='all', force=[0.0, 0.3, 0.0], share='even'}]"
NET = "springs={source='chain', nodes=4, stiffness=300.0, fixed_corners=[1]}"
SECOND = f"body=[{{name='other', {NET}, position=[0, 1, 0]}}]"


def stepper_of(*words: str) -> object:
    return Simulation(load_scene("pendulum", words))._stepper


@pytest.mark.parametrize(
    "words",
    [
        (),
        (LOAD,),
        (SECOND,),
        ("gravity=off",),
        ("damping={mass=1.0}",),
        ("fixed=[{low=[0.4, -1, -1], high=[2, 1, 1]}]",),
    ],
)
def test_nets_with_constant_forces_drag_and_fixed_nodes_have_a_compiled_loop(words: tuple[str, ...]) -> None:
    assert isinstance(stepper_of(*words), ExplicitSprings)
    assert isinstance(stepper_of(*words, "dt=auto"), AutomaticSprings)


@pytest.mark.parametrize(
    "words",
    [
        ("fixed=[{low=[0.4, -1, -1], high=[2, 1, 1], axes='xy'}]",),
        ("prescribed=[{set='all', move='0: 0,0,0; 0.1: 0,0,0.01', axes='y'}]",),
        (SECOND.replace("stiffness", "compressed='slack', stiffness"),),
    ],
)
def test_what_the_loop_does_not_know_goes_by_the_general_one(words: tuple[str, ...]) -> None:
    assert isinstance(stepper_of(*words), ExplicitSteps)
    assert not isinstance(stepper_of(*words, "dt=auto"), AutomaticSprings)


@pytest.mark.parametrize("scheme", EXPLICIT)
@pytest.mark.parametrize(
    "words", [(LOAD,), (SECOND, "springs.damping=0.7", "damping={mass=0.4, stiffness=1e-3}")]
)
def test_the_loop_moves_springs_as_the_general_scheme_does(
    scheme: str, words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    words, ends = (*words, f"inertia={{scheme='{scheme}', substeps='off'}}", "dt=1e-4"), []
    for general in (False, True):
        if general:
            monkeypatch.setattr("tripod_sim.springs.loop.spring_loop", lambda *_: None)
        simulation = Simulation(load_scene("pendulum", words))
        assert isinstance(simulation._stepper, ExplicitSteps if general else ExplicitSprings)
        for _ in range(300):
            simulation.step()
        ends.append((simulation.positions.copy(), simulation.state.velocities.copy()))
    (x, v), (y, u) = ends
    assert np.ptp(x - simulation._system.rest) > 1e-3
    np.testing.assert_allclose(x, y, rtol=0, atol=1e-12)
    np.testing.assert_allclose(v, u, rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    "word", ["inertia.scheme=implicit_euler", "inertia.scheme=bdf2", "inertia.scheme=rk4", "dt=auto"]
)
def test_what_holds_a_resting_chain_bears_its_weight(word: str) -> None:
    marked = "marker=[{set='top'}]", "set=[{name='top', low=[-9, -9, -9], high=[0.05, 9, 9]}]"
    still = "springs.damping=100.0", "damping={mass=20.0}", *marked
    simulation = Simulation(load_scene("pendulum", [*still, word]))
    for _ in range(4000):
        simulation.step()
    force, moment = simulation.reactions(0)
    weight = 10 * 9.81  # that of the held node itself, too
    np.testing.assert_allclose(force, [0, 0, weight], atol=0.02 * weight)
    np.testing.assert_allclose(moment, np.cross(simulation.positions[0], force), atol=1e-9)


def test_statics_of_a_chain_hangs_it_below_what_holds_it() -> None:
    simulation = Simulation(load_scene("pendulum", ["inertia=off", "solver.tolerance=1e-9"]))
    report = simulation.step()
    assert report.residual <= 1e-9 + simulation.system.rounding(simulation.state)
    x = simulation.positions
    tension = 9.81 * np.arange(9, 0, -1)
    np.testing.assert_allclose(np.diff(x[:, 2]), -(1 / 9 + tension / 1500), atol=1e-9)
    np.testing.assert_allclose(x[:, :2], np.tile(x[0, :2], (10, 1)), atol=1e-6)
    again = x.copy()
    simulation.step()
    np.testing.assert_allclose(simulation.positions, again, atol=1e-8)
