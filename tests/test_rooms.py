"""Imports inside tripod_sim point down through its rooms, and packages form no circle (docs/architecture.md)."""

import re
from functools import cache
from itertools import accumulate

import pytest

from tests.test_layers import ROOT, imports, modules, package_of

ROOMS = {
    "base": (
        "errors",
        "copying",
        "kernel_cache",
        "array_kernels",
        "distance_kernels",
        "rotation_kernels",
        "system_kernels",
    ),
    "linear": ("linear",),
    "elements": ("elements",),
    "materials": ("materials",),
    "tables": ("tables",),
    "mesh": ("mesh",),
    "shapes": ("shapes",),
    "constraints": ("constraints",),
    "forces": ("forces",),
    "robot": ("robot",),
    "ball": ("ball",),
    "state": ("state",),
    "system": ("system",),
    "integrators": ("integrators",),
    "maze": ("maze",),
    "model": ("model", "effect"),
    "springs": ("springs",),
    "bodies": ("bodies",),
    "response": ("response", "rest_state", "stability_margin"),
    "contact": ("contact",),
    "compliance": ("compliance",),
    "steps": ("steps",),
    "effects": ("effects", "tables.short_forms"),
    "scene": ("scene", "scene_file"),
    "build": ("build",),
    "mesh_error": ("mesh_error",),
    "fields": ("fields",),
    "simulation": ("simulation", "acting_forces", "applied_forces"),
}
"""The rooms of tripod_sim with their files and folders, from the lowest: a room may import those before it."""


@cache
def room_of(module: str) -> str:
    """Return the room of a module of tripod_sim; the package itself is above all."""
    own = [*accumulate(module.split(".")[1:], "{}.{}".format)]
    return next((room for name in reversed(own) for room, names in ROOMS.items() if name in names), "")


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
    found = {m.removeprefix("tripod_sim.") for m in modules() if m.startswith("tripod_sim.")}
    assert {m.split(".")[0] for m in found} == {name for name in names if "." not in name}
    assert {name for name in names if "." in name} <= found


def test_no_import_points_up() -> None:
    """Imports inside functions and for types included."""
    found = upward(of_simulator())
    assert not found, "\n".join(f"{a} -> {b}" for a, b in found)


def test_only_what_makes_a_model_of_a_scene_knows_scenes() -> None:
    """All others read the model, in which nothing is short or left open."""
    knowing = {
        module
        for module, targets in of_simulator().items()
        if room_of(module) not in ("scene", "effects")
        if any(room_of(target) == "scene" or target.endswith("short_forms") for target in targets)
    }
    assert knowing == {"tripod_sim.build", "tripod_sim.simulation"}


def test_an_import_that_points_up_is_found() -> None:
    wrong = {"tripod_sim.linear.ldl": frozenset({"tripod_sim.simulation", "tripod_sim.errors"})}
    assert upward(wrong) == [("tripod_sim.linear.ldl", "tripod_sim.simulation")]
    short = {
        "tripod_sim.contact.start": frozenset({"tripod_sim.tables.short_forms", "tripod_sim.tables.contact"})
    }
    assert upward(short) == [("tripod_sim.contact.start", "tripod_sim.tables.short_forms")]


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
