"""What tests of the simulator's node share."""

import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest


@pytest.fixture
def make(domain: int) -> Iterator[Callable[..., Any]]:
    """Make graphs (`sim_graph.Graph`), on the coarse mesh unless told, and on no other where this machine is too slow;
    none outlives the test."""
    from tests.sim.sim_graph import Graph

    made: list[Graph] = []

    def graph(**parameters: object) -> Graph:
        made.append(Graph(domain, **{"set": "mesh.level=1", "keep_up": False, **parameters}))
        return made[-1]

    before = sys.getswitchinterval()
    yield graph
    sys.setswitchinterval(before)
    for graph in made:
        graph.close()
