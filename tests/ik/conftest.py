"""What the tests of the node share."""

import pytest


@pytest.fixture
def graph(domain):
    from tests.ik.ik_graph import Graph

    graph = Graph(domain)
    yield graph
    graph.close()
