"""What tests of inverse kinematics share."""

import pytest

from tests.scenes import SHARP


@pytest.fixture
def graph(domain):
    from tests.ik.ik_graph import Graph

    graph = Graph(domain)
    yield graph
    graph.close()


@pytest.fixture
def clock(monkeypatch):
    """The clock of the node that `graph` starts."""
    from tests.ik.ik_graph import NodeClock

    clock = NodeClock()
    monkeypatch.setattr("tripod_ik.node.time", clock)
    return clock


@pytest.fixture(scope="module")
def shared_flat():
    import numpy as np

    from tripod_ik.model import StaticModel
    from tripod_sim import load_scene

    return StaticModel(load_scene(SHARP), 0.0, np.zeros(3))


@pytest.fixture
def flat(shared_flat):
    """The flat piece, its servos at 0 and not slid in."""
    shared_flat.go_home()
    return shared_flat
