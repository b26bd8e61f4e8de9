"""Which texts are namespaces of ROS."""

import pytest

from tests.messages import raises_naming
from tripod_graph.namespace import NamespaceError, full_namespace


@pytest.mark.parametrize(("name", "full"), [("", "/"), ("/", "/"), ("left", "/left"), ("/a_1/b", "/a_1/b")])
def test_a_namespace_gets_its_slash(name: str, full: str) -> None:
    assert full_namespace(name) == full


@pytest.mark.parametrize(
    "name", ["9left", "left/", "a//b", "//a", "a b", "a-b", "~/a", "ä", "a/9", "a" * 100, "{a}"]
)
def test_what_is_no_namespace_is_refused_by_its_value(name: str) -> None:
    with raises_naming(NamespaceError, f"namespace {name!r:.80}", "letters, digits and _", "characters"):
        full_namespace(name)
