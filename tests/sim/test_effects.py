"""A scene pays only for what it names: no import, no array, no term; adding and removing restores the same bits."""

import subprocess
import sys

import numpy as np
import pytest

from tripod_sim import Simulation, load_scene
from tripod_sim.integrators.backward import ImplicitEuler
from tripod_sim.integrators.quasi_static import QuasiStatic

MODULES = {
    "gravity": "tripod_sim.forces.gravity",
    "inertia": "tripod_sim.integrators.backward",
    "damping": "tripod_sim.forces.rayleigh",
    "servos": "tripod_sim.robot.arms",
    "clamp": "tripod_sim.forces.foundation",
    "maze": "tripod_sim.maze.plate",
    "ball": "tripod_sim.maze.play",
}


def loaded(overrides: list[str]) -> set[str]:
    """Modules of the simulator in a fresh interpreter after one step of a scene."""
    code = (
        "import sys; from tripod_sim import Simulation, load_scene;"
        f"Simulation(load_scene('silicone', {['mesh.level=1', *overrides]!r})).step();"
        "print(*[m for m in sys.modules if m.startswith('tripod_sim')])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    return set(done.stdout.split())


def test_absent_effects_are_not_imported() -> None:
    bare = loaded(["gravity=off", "inertia=off", "damping=off"])
    full = loaded(["servos={}", "fixed=off", "effector={}", "clamp={}", "maze={}", "ball={}"])
    for effect, module in MODULES.items():
        assert module not in bare, effect
        assert module in full, effect
    assert "tripod_sim.integrators.quasi_static" in bare


def test_absent_effects_have_no_term_and_no_array() -> None:
    bare = Simulation(load_scene("silicone", ["mesh.level=1", "gravity=off", "inertia=off", "damping=off"]))
    system = bare._system
    assert (system.gravity, system.inertia, system.damping) == (None, None, None)
    assert isinstance(bare._stepper, QuasiStatic)
    assert system.drive is not None
    assert system.reduction.drive.size == 0
    assert bare.effector is None
    full = Simulation(load_scene("tripod", ["mesh.level=1"]))
    assert full._system.damping is not None
    assert isinstance(full._stepper, ImplicitEuler)


@pytest.mark.parametrize(
    "effect", ["gravity={}", "damping={mass=1.0}", "fixed=[{low=[-1,-1,-1], high=[-0.02,1,1]}]"]
)
def test_adding_and_removing_an_effect_restores_the_same_bits(effect: str) -> None:
    def motion(overrides: list[str]) -> bytes:
        base = ["mesh.level=1", "gravity=off", "damping=off", "fixed=[{low=[0.045,-1,-1], high=[1,1,1]}]"]
        simulation = Simulation(load_scene("silicone", [*base, *overrides]))
        simulation.state.velocities[:, 2] = np.where(simulation.state.positions[:, 0] < 0, -0.3, 0.0)
        for _ in range(20):
            simulation.step()
        return simulation.state.positions.tobytes()

    name = effect.partition("=")[0]
    undo = f"{name}=off" if name != "fixed" else "fixed=[{low=[0.045,-1,-1], high=[1,1,1]}]"
    without = motion([])
    assert motion([effect]) != without
    assert motion([effect, undo]) == without


def test_a_steady_step_allocates_no_growing_memory() -> None:
    import tracemalloc

    simulation = Simulation(load_scene("tripod", ["mesh.level=1"]))
    joints = [np.array([-0.001 * k, 0, 0, 0]) for k in range(60)]
    for j in joints[:20]:
        simulation.step(j)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for j in joints[20:]:
        simulation.step(j)
    after = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert (
        after - before < 4_000
    )  # a report and a few numbers, no array of the mesh (the smallest has 3,000 bytes a step)
