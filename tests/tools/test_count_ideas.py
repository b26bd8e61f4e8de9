"""The simulator has no more ideas for one purpose than before: see tools/count_ideas.py."""

import ast

import pytest

from tools.count_ideas import IDEAS, Trees, trees

FOUND = trees()

SOURCES = {
    "systems": "class NetSystem: ...\n",
    "descents": """
def lower(system, x):
    while system.evaluate(x) > 0.1:
        x -= system.linear.solve(system.residual)
""",
    "roll-backs": """
def advance(state, kept):
    while not try_step(state):
        kept.copy_to(state)
""",
    "time errors": "def report(found): return TimeErrorReport(found)\n",
    "types": "def is_net(body): return isinstance(body, (int, NetSystem))\n",
    "scheme names": "def stages(scheme): return 2 if scheme in ('tr_bdf2', 'other') else 1\n",
}
"""One more of each idea, in a module of its own."""


def with_module(name: str, text: str) -> Trees:
    return {**FOUND, name: ast.parse(text)}


@pytest.mark.parametrize("name", IDEAS)
def test_no_idea_has_become_more_and_each_bound_is_what_there_is(name: str) -> None:
    places = IDEAS[name].count(FOUND)
    assert len(places) <= IDEAS[name].bound, "\n".join(["one more than before:", *places])
    assert len(places) == IDEAS[name].bound, "fewer than the bound: lower it in tools/count_ideas.py"
    assert IDEAS[name].aim <= IDEAS[name].bound
    assert set(IDEAS[name].named) <= set(IDEAS[name].find(FOUND)), (
        "an exception is gone: do not name it any longer"
    )


@pytest.mark.parametrize("name", SOURCES)
def test_one_more_is_seen(name: str) -> None:
    before = len(IDEAS[name].count(FOUND))
    assert len(IDEAS[name].count(with_module("tripod_sim/another.py", SOURCES[name]))) == before + 1


def test_a_circle_of_imports_is_seen_inside_functions_and_of_types_too() -> None:
    before = len(IDEAS["circles"].find(FOUND))
    text = "def build():\n    from tripod_sim import another\n"
    two = with_module("tripod_sim/another.py", "from tripod_sim.one_more import build\n")
    assert len(IDEAS["circles"].find({**two, "tripod_sim/one_more.py": ast.parse(text)})) == before + 1
