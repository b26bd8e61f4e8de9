"""Which effects, elements, schemes, solvers and kinds of body go together: builds and steps every pair, writes a table.

A pair is a scene with both, and with what they need, on each kind of body. It works if it can be built and three steps
end with finite numbers; else it must be refused by one line (`SceneError`), and `WHY` says why that is: what physics
asks for stays, the rest is not there yet. Effects, elements, schemes and solvers come from the scene's own tables, so
that a new one has its row here by itself.

    python benchmarks/pairs.py            # renews docs/effects.md: one scene for each pair, some minutes
    python benchmarks/pairs.py --quick    # one scene for as many pairs as it can hold, as the test does it
    python benchmarks/pairs.py --check    # exit code 1 if the page is of other code than this
"""

import argparse
import re
import sys
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field, fields
from itertools import combinations
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))  # run as a script, too

from benchmarks.doc_parts import DOCS, write_part  # noqa: E402
from tripod_sim import Simulation  # noqa: E402
from tripod_sim.effects import EFFECTS, words  # noqa: E402
from tripod_sim.effects.inertia import Inertia  # noqa: E402
from tripod_sim.elements.catalogue import ELEMENTS  # noqa: E402
from tripod_sim.errors import SceneError  # noqa: E402
from tripod_sim.scene.file import scene_from_toml  # noqa: E402
from tripod_sim.tables.method import Solver  # noqa: E402

STEPS = 3

PAGE, PART = "effects.md", "pairs"

BASE = 'name = "pair"\ndt = 1e-4\n\n[inertia]\n'

KINDS = ("solid", "springs", "rigid")
"""Kinds of body."""


@dataclass(frozen=True)
class Thing:
    """What a scene may have.

    Attributes:
        words: Overrides that add it, as `tripod run --set` takes them.
        needs: Other things without which it is nothing.
        one_of: Of things that have the same here a scene has one.
        on: Other words where the first body is of a kind.
    """

    words: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    one_of: str = ""
    on: dict[str, tuple[str, ...]] = field(default_factory=dict)


PLACE = "-0.025, -0.0433"
"""x, y of what lies on the end of a strip, clear of disc, maze and ball [m]."""

BALLS = ", ".join(
    f"{{shape='ball', radius=0.004, mass=1e-3, position=[{PLACE}, {z}]}}" for z in (0.0073, 0.0157)
)


def _choices(table: type, name: str) -> tuple[str, ...]:
    """Return what a field of a scene's table may be."""
    return next(f.metadata["choices"] for f in fields(table) if f.name == name)


def _cube(z: float) -> str:
    """Return the words for a cube of 8 mm whose centre is at the height `z` [m]."""
    source = ROOT / "tripod_sim" / "scenes" / "cube.obj"
    return f"obstacles=[{{source='{source}', scale=0.04, position=[{PLACE}, {z}]}}]"


def _cable(points: str) -> str:
    """Return the words for a cable through points of the first body."""
    return f'cable=[{{name="tendon", via=[{{points=[{points}]}}], range=[-1.0, 1.0]}}]'


SPECIAL: dict[str, Thing] = {
    "damping": Thing(("damping={mass=1.0, stiffness=1e-4}",)),
    "fixed": Thing(
        ("fixed=[{low=[0.02, -0.02, -0.01], high=[0.04, 0.02, 0.002]}]",),
        on={"springs": ("fixed=[{low=[-0.04, -0.06, 0.0], high=[-0.033, -0.03, 0.01]}]",)},
    ),
    "prescribed": Thing(
        (
            "set=[{name='moved', along=[-0.5, -0.866, 0.0], beyond=0.02, below=0.04}]",
            "prescribed=[{set='moved', axes='xz', move='0: 0,0,0; 1: 0.01,0,0.01'}]",
        ),
        ("solid",),
    ),
    "load": Thing(words("load"), ("solid",)),
    "cable": Thing(
        words("cable"),
        on={"springs": (_cable("[-0.016, -0.0343, 0.003], [-0.022, -0.0403, 0.003]"),)},
    ),
    "force": Thing(
        ('force=[{name="push", set="all", direction=[0.0, 0.0, 1.0], range=[-1.0, 1.0], share="even"}]',)
    ),
    "servos": Thing(("servos={}",), ("solid",)),
    "servo_dynamics": Thing(("servo_dynamics={}",), ("servos",)),
    "clamp": Thing(("clamp={}",), ("servos",)),
    "effector": Thing(("effector={}",), ("solid",)),
    "maze": Thing(("maze={}",), ("effector",)),
    "mesh_error": Thing(("clamp.stiffness=1.4e10", "mesh_error={}"), ("clamp", "effector")),
    "ball": Thing(
        ("ball={radius=0.002, mass=1e-4, position=[0.012, 0.0, 0.0046]}",),
        ("gravity",),
        on={"springs": ("ball={radius=0.002, mass=1e-4, position=[-0.019, -0.0373, 0.0051]}",)},
    ),
    "strain_limit": Thing(("strain_limit={stretch=0.05}",), ("springs",)),
    "contact": Thing(
        ("contact={contact_distance=1e-4, alarm_distance=5e-4, self_contact=true}",),
        on={"rigid": ("contact={contact_distance=1e-4, alarm_distance=5e-4}",)},
    ),
    "obstacles": Thing(
        (_cube(-0.0068),), ("contact",), on={"springs": (_cube(-0.0013),), "rigid": (_cube(-0.001),)}
    ),
    "rigid": Thing((f"rigid=[{BALLS}]",), ("contact",)),
}
"""Effects that need more than their name here: they are to touch something."""

THINGS: dict[str, Thing] = {
    "solid": Thing(("mesh={source='y_piece', level=1}", "material={}")),
    "springs": Thing(
        (
            f"springs={{source='grid', nodes=4, size=0.018, position=[{PLACE}, 0.003], node_mass=1e-4, stiffness=100, "
            "shear=30}",
        )
    ),
    **{name: SPECIAL.get(name, Thing(words(name))) for name in EFFECTS if name != "inertia"},
    "dt = auto": Thing(("dt=auto",), one_of="dt"),
    **{name: Thing((f"mesh.element={name}",), ("solid",), "element") for name in ELEMENTS},
    **{
        name: Thing((f"inertia.scheme={name}",), one_of="scheme")
        for name in _choices(Inertia, "scheme")
        if name != "auto"
    },
    "statics": Thing(
        ("inertia=off", *SPECIAL["fixed"].words),
        one_of="scheme",
        on={"springs": ("inertia=off", *SPECIAL["fixed"].on["springs"]), "rigid": ("inertia=off",)},
    ),
    **{
        name: Thing((f"solver.linear={name}",), one_of="linear")
        for name in _choices(Solver, "linear")
        if name not in ("auto", "cholmod")  # the second is an extra that need not be there
    },
    **{name: Thing((f"solver.mode={name}",), one_of="mode") for name in _choices(Solver, "mode")},
}

PHYSICS, LATER = "physics", "not yet"

WHY: tuple[tuple[str, str, str], ...] = (
    ("damping needs inertia", PHYSICS, "at rest nothing moves"),
    ("sleep needs inertia", PHYSICS, "without inertia everything is at rest"),
    (
        "strain_limit needs springs and inertia",
        PHYSICS,
        "at rest the spring forces determine the lengths",
    ),
    ("time_error needs inertia", PHYSICS, "at rest there are no time steps"),
    (r"\w+ needs a soft body", PHYSICS, "rigid bodies have no nodes"),
    ("contact.self_contact needs a soft body", PHYSICS, "a rigid body does not touch itself"),
    (
        "inertia.scheme is '.*'; contact needs an implicit scheme",
        PHYSICS,
        "contact forces depend on the state at the end of the step",
    ),
    ("(rigid|ball) needs inertia", PHYSICS, "the rest position of a free body is not determined"),
    ("nothing holds the body", PHYSICS, "a free body has no static equilibrium"),
    ("initial_velocity needs inertia", PHYSICS, "at rest all velocities are zero"),
    (
        "cable.0.command is 'length', but inertia.scheme",
        PHYSICS,
        "the scheme gains energy where a stiff force comes and goes",
    ),
    (
        r"inertia.scheme is '\w+', which cannot compute (cable|chamber|force)",
        LATER,
        "explicit loops know no commanded forces",
    ),
    (
        r"mesh_error and [\w, ]+ cannot be combined so far",
        LATER,
        "the estimate knows servos and loads only",
    ),
    ("chamber.0.body is a net of springs", PHYSICS, "a net encloses no volume"),
    (
        "chamber.0.cavity is 0",
        PHYSICS,
        "the pieces of this table have no cavity; `tests/sim/test_actuators.py` has one",
    ),
    (r"\w+ needs a solid", LATER, "servos and disc hold nodes of a solid's mesh only"),
)
"""Beginning of a refusal, as a regular expression; whose it is; why, or what is missing."""

UNKNOWN = ("?", "?", "not in WHY of benchmarks/pairs.py")


def closure(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return `names` with all that they need, in the order of `THINGS`."""
    found, todo = set[str](), list(names)
    while todo:
        if (name := todo.pop()) not in found:
            found.add(name)
            todo += THINGS[name].needs
    return tuple(name for name in THINGS if name in found)


def first_body(names: Collection[str]) -> str:
    """Return the kind of the first body of a scene that has `names`."""
    return next(name for name in KINDS if name in names)


def clash(names: tuple[str, ...]) -> bool:
    """Return whether `names` has two things of which a scene has one."""
    kinds = [THINGS[name].one_of for name in names if THINGS[name].one_of]
    return len(set(kinds)) < len(kinds)


class Checker:
    """Builds and steps scenes; it knows what it has seen."""

    def __init__(self) -> None:
        self.builds = 0

    def overrides(self, kind: str, names: tuple[str, ...]) -> list[str]:
        """Return the words of a scene with the things `names` on a body of `kind`."""
        found = closure((kind, *names))
        body = first_body(found)
        return [w for name in found for w in THINGS[name].on.get(body, THINGS[name].words)]

    def refused(self, kind: str, names: tuple[str, ...]) -> str:
        """Return why a scene is refused before it is built; empty if it is not."""
        try:
            scene_from_toml(BASE, self.overrides(kind, names))
        except SceneError as error:
            return str(error)
        return ""

    def tried(self, kind: str, names: tuple[str, ...]) -> tuple[str, str]:
        """Build and step a scene; return why it is refused and what broke, both empty if it works."""
        self.builds += 1
        try:
            simulation = Simulation(scene_from_toml(BASE, self.overrides(kind, names)))
        except SceneError as error:
            return str(error), ""
        except Exception as error:  # noqa: BLE001 - whatever it is, the pair is at fault
            return "", f"{type(error).__name__}: {error}"
        try:
            for _ in range(STEPS):
                joints = simulation.command
                joints[:-1] -= 0.002
                simulation.step(joints)
        except Exception as error:  # noqa: BLE001
            return "", f"{type(error).__name__}: {error}"
        state = simulation.state
        arrays = [simulation.positions, state.velocities, simulation.efforts]
        return "", "" if all(np.isfinite(a).all() for a in arrays) else "a number is not finite"


@dataclass
class Found:
    """What came out, for each kind of body and pair: the refusal, empty if it works; `broken`: neither.

    `works`: all that scenes had which worked.
    """

    refusals: dict[tuple[str, str, str], str] = field(default_factory=dict)
    broken: dict[tuple[str, ...], str] = field(default_factory=dict)
    works: list[set[str]] = field(default_factory=list)
    builds: int = 0


def pairs(kind: str) -> Iterator[tuple[str, str]]:
    """Return the pairs to be tried on a body of `kind`; a thing with itself is the thing alone."""
    others = [name for name in THINGS if name != kind]
    yield from ((name, name) for name in others if not clash(closure((kind, name))))
    yield from (p for p in combinations(others, 2) if not clash(closure((kind, *p))))


def look(*, quick: bool) -> Found:
    """Try every pair; `quick`: in as few scenes as may be."""
    found = Found()
    checker = Checker()
    for kind in KINDS:
        _look_at(checker, kind, found, quick=quick)
    found.builds = checker.builds
    return found


def _look_at(checker: Checker, kind: str, found: Found, *, quick: bool) -> None:
    left: dict[tuple[str, str], None] = {}
    for a, b in pairs(kind):
        if why := checker.refused(kind, (a, b)):
            found.refusals[kind, a, b] = why
        else:
            left[a, b] = None
    free = {frozenset(p) for p in left}
    if quick:  # what a pair asks for may have been in a scene of another kind of body: it is the same scene
        for p in [p for p in left if _within(closure((kind, *p)), found.works)]:
            found.refusals[kind, *p] = ""
            del left[p]
    while left:
        first = next(iter(left))
        names = first
        if quick:
            names = _grown(kind, first, left, free)
        why, broken = checker.tried(kind, names)
        if (why or broken) and set(names) != set(first):
            names = first
            why, broken = checker.tried(kind, names)
        if not (why or broken):
            found.works.append({*closure((kind, *names))})
        done = [p for p in left if set(p) <= set(names)]
        for p in done if not (why or broken) else [first]:
            found.refusals[kind, *p] = why
            if broken:
                found.broken[kind, *p] = broken
            del left[p]


def _within(wanted: tuple[str, ...], scenes: list[set[str]]) -> bool:
    """Return whether one of `scenes` has the same first body and all that is wanted."""
    return any(first_body(scene) == first_body(wanted) and scene.issuperset(wanted) for scene in scenes)


def _grown(
    kind: str,
    first: tuple[str, str],
    left: dict[tuple[str, str], None],
    free: set[frozenset[str]],
) -> tuple[str, ...]:
    """Return `first` with all that goes with it, and that has not been tried with all of it."""
    names = tuple(dict.fromkeys(first))
    for other in THINGS:
        new = any(set(p) <= {*names, other} and other in p for p in left)
        fits = all(frozenset((name, other)) in free for name in (*names, other))
        if other == kind or other in names or not new or not fits:
            continue
        if not clash(closure((kind, *names, other))):
            names = (*names, other)
    return names


def reason(refusal: str) -> int:
    """Return the place in `WHY` of a refusal, -1 if it has none."""
    return next((i for i, (begin, _, _) in enumerate(WHY) if re.match(begin, refusal)), -1)


def document(found: Found) -> list[str]:
    """Return the table as Markdown."""
    used = sorted({reason(text) for text in found.refusals.values() if text})
    letter = {k: chr(ord("a") + i) for i, k in enumerate(used)}
    groups: dict[tuple[str, int, str], list[str]] = {}
    for (kind, a, b), text in found.refusals.items():
        if text:
            groups.setdefault((kind, reason(text), a), []).append(b)
    total, works = len(found.refusals), sum(not text for text in found.refusals.values())
    counts = {
        name: sum(WHY[reason(t)][1] == name for t in found.refusals.values() if t)
        for name in (PHYSICS, LATER)
    }
    lines = [
        f"Of {total} pairs of {len(THINGS)} features, with a solid, springs or rigid bodies, {works} work. "
        f"{counts[PHYSICS]} are refused because they contradict physics; {counts[LATER]} are not implemented.",
        "",
        "| feature | with a solid | with springs | with rigid bodies |",
        "|---|---|---|---|",
    ]
    for name in THINGS:
        cells = [_cell(found, kind, name, letter) for kind in KINDS]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    lines += ["", "| | message, for example | class | reason |", "|---|---|---|---|"]
    for k in used:
        example = next(text for text in found.refusals.values() if text and reason(text) == k)
        whose, why = WHY[k][1:] if k >= 0 else UNKNOWN[1:]
        lines.append(f"| {letter[k]} | {example.replace('|', '/')} | {whose} | {why} |")
    return lines


def _cell(found: Found, kind: str, name: str, letter: dict[int, str]) -> str:
    """Return with what a thing does not go on a body of `kind`."""
    if name == kind:
        return "-"
    alone = found.refusals.get((kind, name, name))
    if alone is None:
        return ""
    if alone:
        return f"no: {letter[reason(alone)]}"
    refused: dict[str, list[str]] = {}
    for (of, a, b), text in found.refusals.items():
        other = b if a == name else a
        if of != kind or not text or name not in (a, b) or found.refusals.get((kind, other, other)):
            continue
        refused.setdefault(letter[reason(text)], []).append(other)
    return "; ".join(f"not with {', '.join(others)}: {k}" for k, others in refused.items()) or "all"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="few scenes")
    parser.add_argument("--check", action="store_true", help="write nothing")
    options = parser.parse_args()
    found = look(quick=options.quick or options.check)
    for names, what in found.broken.items():
        print(f"broken: {', '.join(names)}: {what}", file=sys.stderr)
    for text in sorted({t for t in found.refusals.values() if t and reason(t) < 0}):
        print(f"no reason in WHY: {text}", file=sys.stderr)
    print(f"{len(found.refusals)} pairs in {found.builds} scenes")
    lines = document(found)
    if options.check:
        sys.exit("\n".join(lines) not in (DOCS / PAGE).read_text(encoding="utf-8"))
    write_part(PAGE, PART, lines)
    sys.exit(bool(found.broken))


if __name__ == "__main__":
    main()
