"""What tests of the simulator's node share."""

import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest


@pytest.fixture
def make(domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Any]]:
    """Make graphs (`sim_graph.Graph`), on the coarse mesh unless told, that do not say how slow this machine is; none
    outlives the test."""
    from tests.runtime.sim_graph import Graph
    from tripod_runtime import realtime

    monkeypatch.setattr(realtime, "BEHIND", 0.0)
    made: list[Graph] = []

    def graph(**parameters: object) -> Graph:
        made.append(Graph(domain, **{"set": "mesh.level=1", **parameters}))
        return made[-1]

    before = sys.getswitchinterval()
    yield graph
    sys.setswitchinterval(before)
    for graph in made:
        graph.close()
