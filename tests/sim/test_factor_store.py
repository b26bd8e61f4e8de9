"""Factorisations of several step lengths: each comes back to its own length, and none outlives its welcome."""

from typing import Any

import numpy as np

from tripod_sim import load_scene
from tripod_sim.build import build
from tripod_sim.forces.anchor import Anchor
from tripod_sim.integrators.factor_store import MOST, FactorStore


class System:
    """Hands out numbered solvers."""

    def __init__(self) -> None:
        self.linear: Any = "solver 0"
        self.made = 1

    def another_linear(self) -> Any:
        self.made += 1
        return f"solver {self.made - 1}"


def test_a_length_finds_its_own_solver_again() -> None:
    system = System()
    store = FactorStore(system)
    assert not store.use(0.1)
    assert system.linear == "solver 0"
    store.keep(0.1)
    assert not store.use(0.2)
    assert system.linear == "solver 1"
    assert store.use(0.1)
    assert system.linear == "solver 0"
    assert not store.use(0.1)  # it was not kept since
    assert not store.use(0.2)


def test_the_one_not_used_for_longest_makes_room() -> None:
    system = System()
    store = FactorStore(system)
    for k in range(MOST):
        store.use(float(k))
        store.keep(float(k))
    assert store.use(0.0)
    store.keep(0.0)
    assert not store.use(-1.0)
    assert system.made == MOST
    assert system.linear == "solver 1"  # of the length 1, asked for longest ago
    assert store.use(0.0)
    assert not store.use(1.0)


def test_forgetting_keeps_the_solvers_and_not_what_they_factored() -> None:
    system = System()
    store = FactorStore(system)
    for k in range(3):
        store.use(float(k))
        store.keep(float(k))
    store.forget()
    assert not any(store.use(float(k)) for k in range(3))
    assert system.made == 3


def test_a_sibling_solves_with_a_factor_of_its_own() -> None:
    system: Any = build(load_scene("tripod", ["mesh.level=1"])).system
    first = system.linear
    state = system.start_state(np.zeros(4))
    system.term(Anchor).weight[:] = 1.0
    system.assemble(state, project=False)
    system.evaluate(state)
    system.factor()
    b = np.random.default_rng(0).standard_normal(system.unknowns)
    expected = first.solve(b)
    system.linear = system.another_linear()
    assert system.linear is not first
    system.term(Anchor).weight[:] = 100.0
    system.factor()
    assert np.abs(system.linear.solve(b) - expected).max() > 0.1 * np.abs(expected).max()
    np.testing.assert_array_equal(first.solve(b), expected)
