"""What results must not depend on: frame, order of elements and nodes, number of threads, what ran before."""

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from benchmarks.blocks import brick, lumped
from tests.checks import law_vector
from tests.sim.implicit_schemes import MULTISTEP
from tripod_sim.constraints.groups import Groups
from tripod_sim.elements.catalogue import ELEMENTS
from tripod_sim.forces.anchor import Anchor
from tripod_sim.forces.gravity import GravityForce
from tripod_sim.forces.solid import Solid
from tripod_sim.integrators.implicit import ImplicitSteps
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.quasi_static import quasi_static_steps
from tripod_sim.integrators.schemes import SCHEMES
from tripod_sim.integrators.stage import ImplicitStage
from tripod_sim.integrators.substeps import halving
from tripod_sim.materials.lame import lame_constants
from tripod_sim.system import System

LINES = (np.linspace(0, 0.06, 4), np.linspace(0, 0.02, 2), np.linspace(0, 0.02, 2))
LAM, MU = lame_constants(2e4, 0.4)

Change = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""Takes nodes and elements and returns others, and the numbers that the old nodes then have."""


def hang(element: str, law: str, scheme: str, rotation: Rotation, change: Change | None = None) -> np.ndarray:
    """Return the nodes of a soft bar, held at one end, with a rigid plate at the other, after some steps [m].

    All that the world gives is turned by `rotation`: nodes and gravity. Results come in the order of the first mesh.
    """
    mesh = brick(element, LINES)
    nodes, elements = np.array(mesh.nodes), np.array(mesh.elements)
    held, plate = np.flatnonzero(nodes[:, 0] < 1e-9), np.flatnonzero(nodes[:, 0] > 0.06 - 1e-9)
    load, inert = lumped(mesh, 0.03)
    order = np.arange(len(nodes))
    if change:
        nodes, elements, order = change(nodes, elements)
        load, inert = (np.bincount(order, m) for m in (load, inert))
    nodes = rotation.apply(nodes)
    damping = 0.0 if scheme == "static" else 1e-3
    solid = Solid(nodes, elements, mesh.kind, law, law_vector(law, LAM, MU), damping=damping)
    groups = Groups(len(nodes), rigid=(np.sort(order[plate]),), fixed=np.sort(order[held]))
    weight = rotation.apply([2.0, 1.0, -9.0])
    gravity = GravityForce(load, tuple(weight), nodes)
    inertia = None if scheme == "static" else Anchor(len(nodes))
    terms = [gravity, inertia] if inertia else [gravity]
    system = System(nodes, [solid], groups, terms, damped=inertia is not None)
    newton = Newton(system, 1e-11, 200)
    stepper = (
        halving(ImplicitSteps(SCHEMES[scheme], ImplicitStage(newton, inertia, inert, 0.5)), 8)
        if inertia
        else quasi_static_steps(newton, 8, 0.1, 0.03)
    )
    state = system.start_state(np.zeros(1))
    for _ in range(6 if inertia else 1):
        stepper.step(state, np.zeros(1), 0.01)
    assert np.abs(state.positions - nodes).max() > 3e-3  # it hangs
    return rotation.inv().apply(state.positions[order])


NOT_TURNED = Rotation.identity()
TURNS = Rotation.random(2, random_state=5)


@pytest.mark.parametrize("element", sorted(ELEMENTS))
@pytest.mark.parametrize("law", ["neo_hooke", "corotational"])
def test_a_turned_scene_gives_turned_results(element: str, law: str) -> None:
    straight = hang(element, law, "implicit_euler", NOT_TURNED)
    for turn in TURNS:
        np.testing.assert_allclose(hang(element, law, "implicit_euler", turn), straight, rtol=0, atol=1e-10)


@pytest.mark.parametrize("scheme", ["static", *MULTISTEP])
def test_it_does_with_every_scheme(scheme: str) -> None:
    straight = hang("h8_modes", "stable_neo_hooke", scheme, NOT_TURNED)
    turned = hang("h8_modes", "stable_neo_hooke", scheme, TURNS[0])
    np.testing.assert_allclose(turned, straight, rtol=0, atol=1e-10)


def shuffled(seed: int) -> Change:
    """Return what numbers nodes and elements again."""

    def change(nodes: np.ndarray, elements: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        rng = np.random.default_rng(seed)
        order, turn = rng.permutation(len(nodes)), rng.permutation(len(elements))
        moved = np.empty_like(nodes)
        moved[order] = nodes
        return moved, np.ascontiguousarray(order[elements][turn]), order

    return change


@pytest.mark.parametrize("element", sorted(ELEMENTS))
def test_the_order_of_nodes_and_elements_does_not_matter(element: str) -> None:
    first = hang(element, "neo_hooke", "implicit_euler", NOT_TURNED)
    for seed in range(2):
        other = hang(element, "neo_hooke", "implicit_euler", NOT_TURNED, shuffled(seed))
        np.testing.assert_allclose(other, first, rtol=0, atol=1e-10)


RUN = """
import hashlib, numpy as np
from tripod_sim import Simulation, load_scene
simulation = Simulation(load_scene("tripod", ["mesh.level=1"]))
for k in range(20):
    simulation.step(np.array([-0.02 * k, 0.0, -0.01 * k, 0.0]))
print(hashlib.sha256(simulation.state.positions.tobytes()).hexdigest())
"""


def test_the_number_of_threads_does_not_matter() -> None:
    found = set()
    for count in ("1", "2", "5"):
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
        environment = {**os.environ, **dict.fromkeys(names, count)}
        done = subprocess.run(
            [sys.executable, "-c", RUN], env=environment, check=True, capture_output=True, text=True
        )
        found.add(done.stdout.strip())
    assert len(found) == 1
    assert found != {hashlib.sha256(b"").hexdigest()}


AFTER = """
import hashlib, sys
from tripod_sim import Simulation, load_scene
for name in sys.argv[1:]:
    simulation = Simulation(load_scene(name))
    for _ in range(60):
        simulation.step()
print(hashlib.sha256(simulation.state.positions.tobytes()).hexdigest())
"""


def test_what_the_process_simulated_before_does_not_matter() -> None:
    """Loops that others call are compiled with those, too, where they may round otherwise; whose copy runs is one's own
    or that of who came first. The silicone solves by the loops that the cloth's have in them."""
    words = [("silicone", "cloth"), ("cloth",)]  # the first compiles what is not there
    ran = [
        subprocess.run([sys.executable, "-c", AFTER, *w], check=True, capture_output=True, text=True)
        for w in words
    ]
    assert ran[0].stdout == ran[1].stdout
    assert len(ran[0].stdout.strip()) == 64
