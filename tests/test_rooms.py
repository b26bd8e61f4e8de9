"""Imports inside tripod_sim point down through its rooms, and packages form no circle (docs/architecture.md)."""

import re
from collections import Counter
from functools import cache

import pytest

from tests.test_layers import ROOT, imports, modules, package_of

ROOMS = {
    "base": (
        "errors",
        "copied",
        "kernel_cache",
        "array_kernels",
        "distance_kernels",
        "rotation_kernels",
        "system_kernels",
    ),
    "linear": ("linear",),
    "elements": ("elements",),
    "materials": ("materials",),
    "tables": ("tables", "joints", "scene_lines", "timeline", "node_sets"),
    "mesh": ("mesh",),
    "shapes": ("shapes",),
    "constraints": ("constraints",),
    "forces": ("forces",),
    "robot": ("robot",),
    "ball": ("ball",),
    "state": ("state", "rigid_state"),
    "system": ("system",),
    "integrators": ("integrators",),
    "maze": ("maze",),
    "model": ("model", "effect"),
    "springs": ("springs",),
    "bodies": ("bodies",),
    "response": ("response", "rest_state", "softness"),
    "contact": ("contact",),
    "compliance": ("compliance",),
    "steps": ("steppers", "parts", "solved_to"),
    "effects": ("effects", "scene_short"),
    "scene": ("scene", "scene_checks", "scene_file", "unread", "script", "description", "lowering"),
    "build": ("build", "proportions"),
    "mesh_error": ("mesh_error",),
    "simulation": ("simulation",),
}
"""The rooms of tripod_sim with their files and folders, from the lowest: a room may import those before it."""

UPWARD = {
    "contact -> steps": 1,
    "forces -> springs": 3,
    "integrators -> contact": 2,
    "integrators -> springs": 2,
    "integrators -> steps": 2,
    "mesh -> forces": 1,
}
"""Imports that still point up, inside functions and for types included; these numbers only fall."""


@cache
def room_of(module: str) -> str:
    """Return the room of a module of tripod_sim; the package itself is above all."""
    first = module.split(".")[1] if "." in module else ""
    return next((room for room, names in ROOMS.items() if first in names), "")


def upward(found: dict[str, frozenset[str]]) -> list[tuple[str, str]]:
    """Return the imports of a module of tripod_sim from a room above its own, of modules with their imports."""
    order = list(ROOMS)
    return [
        (module, target)
        for module, targets in found.items()
        for target in sorted(targets)
        if room_of(module) and room_of(target)
        if order.index(room_of(module)) < order.index(room_of(target))
    ]


def of_simulator() -> dict[str, frozenset[str]]:
    mine = {m for m in modules() if m.startswith("tripod_sim.")}
    return {m: imports(m) & mine - {m.rsplit(".", n)[0] for n in (1, 2)} for m in mine}


def test_every_module_is_in_one_room() -> None:
    names = [name for room in ROOMS.values() for name in room]
    assert len(names) == len(set(names))
    assert {m.split(".")[1] for m in modules() if m.startswith("tripod_sim.")} == set(names)


def test_no_import_points_up_but_those_known() -> None:
    found = upward(of_simulator())
    counts = Counter(f"{room_of(a)} -> {room_of(b)}" for a, b in found)
    more = [
        f"{a} -> {b}" for a, b in found if counts[p := f"{room_of(a)} -> {room_of(b)}"] > UPWARD.get(p, 0)
    ]
    assert not more, "\n".join(more)
    assert counts == UPWARD, "fewer than before: lower the numbers in UPWARD"


def test_only_what_makes_a_model_of_a_scene_knows_scenes() -> None:
    """All others read the model, in which nothing is short or left open."""
    knowing = {
        module
        for module, targets in of_simulator().items()
        if room_of(module) not in ("scene", "effects")
        if any(room_of(target) == "scene" or target.endswith("scene_short") for target in targets)
    }
    assert knowing == {"tripod_sim.build", "tripod_sim.simulation"}


def test_an_import_that_points_up_is_found() -> None:
    wrong = {"tripod_sim.linear.ldl": frozenset({"tripod_sim.simulation", "tripod_sim.errors"})}
    assert upward(wrong) == [("tripod_sim.linear.ldl", "tripod_sim.simulation")]


def circles(arrows: dict[str, set[str]]) -> set[str]:
    """Return the nodes of a directed graph that are on a circle."""
    left = {node: set(targets) - {node} for node, targets in arrows.items()}
    while ends := [node for node, targets in left.items() if not targets & left.keys()]:
        for node in ends:
            del left[node]
    return set(left)


def test_packages_form_no_circle() -> None:
    arrows = {package_of(m): set[str]() for m in modules()}
    for module in modules():
        arrows[package_of(module)] |= {package_of(target) for target in imports(module)}
    assert circles(arrows) == set()


@pytest.mark.parametrize("back", ["tripod_sim", "tripod_study"])
def test_a_circle_of_packages_is_found(back: str) -> None:
    arrows = {"tripod_sim": set[str](), "tripod_study": {"tripod_sim"}, "tripod_runtime": {"tripod_study"}}
    assert circles(arrows) == set()
    assert {back, "tripod_runtime"} <= circles({**arrows, back: {*arrows[back], "tripod_runtime"}})


def test_the_page_of_the_architecture_has_the_same_order() -> None:
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    rooms = re.search(r"from the lowest:\n\n```\n(.*?)```", text, re.S)
    assert rooms
    assert rooms[1].split() == list(ROOMS)
