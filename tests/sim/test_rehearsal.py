"""Nothing is compiled while the physics runs: a robot would stand still for as long."""

import subprocess
import sys

import pytest

PROGRAM = """
import gc, sys
import numpy as np
from numba.core.registry import CPUDispatcher
from tripod_sim.scene.file import load_scene
from tripod_sim.simulation import Simulation

def compiled():
    return sum(len(d.signatures) for d in gc.get_objects() if isinstance(d, CPUDispatcher))

simulation = Simulation(load_scene(sys.argv[1], []))
start = simulation.positions.copy()
simulation.rehearse()
assert np.array_equal(simulation.positions, start)
assert simulation.state.step == 0
before = compiled()
joints = simulation.command.copy() if simulation.scene.servos else None
for k in range(20):
    if joints is not None:
        joints[:-1] -= 0.02
    simulation.step(joints)
simulation.energies()
if simulation.scene.effector:
    simulation.compliance()
assert before > 0
print(compiled() - before)
"""


@pytest.mark.parametrize("scene", ["tripod", "pendulum"])
def test_what_a_running_scene_needs_is_compiled_before_it_runs(scene: str) -> None:
    found = subprocess.run([sys.executable, "-c", PROGRAM, scene], capture_output=True, text=True, check=True)
    assert int(found.stdout) == 0
