"""What the tests of the node share."""

import pytest


@pytest.fixture
def graph(monkeypatch):
    from tests.ik.ik_graph import Graph

    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    graph = Graph()
    yield graph
    graph.close()
