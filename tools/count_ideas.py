"""Count how many ideas the simulator has for one purpose: `python -m tools.count_ideas`.

Reads the sources as syntax trees and imports nothing. Each count has the number that the code has now as a bound and
the aim that it should fall to; `tests/tools/test_count_ideas.py` fails where a count is above its bound, and where the
bound is above the count. So a bound only falls. Exceptions are named with their reason, and not counted.

- systems: classes whose name ends in System: kinds of potential that a stage minimises.
- descents: functions with a loop that solves linear equations and evaluates the potential or its gradient, and loops
  named descend or minimise.
- roll-backs: functions that take a state back, to what was kept before, in a loop or in a call of themselves with half
  the step.
- time errors: modules that make a `TimeErrorReport`.
- circles: circles of imports among the modules, those inside functions and for types included.
- types: `isinstance` on systems and bodies.
- scheme names: comparisons of names of time schemes with strings, or with numbers that compiled loops give them.
"""

import ast
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from tripod_sim.integrators.schemes import EXPLICIT, IMPLICIT

ROOT = Path(__file__).parents[1]
PACKAGES = ("tripod_sim", "tripod_study", "tripod_runtime")

SYSTEM = re.compile(r"\w*System")
BODY = re.compile(r"\w*(?:System|Body|Bodies|Ball|Nodes|Solid|SolidArrays|Springs)")
DESCENT = re.compile(r"_?(?:descend|minimise)\w*")
SOLVE, EVALUATE = re.compile(r"_?solve\w*|_step"), re.compile(r"_?evaluate\w*|_?gradient\w*")
KEPT = re.compile(r"_?(?:keep|kept|backup|start|origin|saved|snapshot|x_keep|v_keep)")
SCHEMES = (*IMPLICIT, *EXPLICIT)
GROUPS = ("EXPLICIT", "IMPLICIT", "RK4", "SEMI_IMPLICIT_EULER", "EXPLICIT_EULER")

Trees = dict[str, ast.Module]


@dataclass(frozen=True)
class Idea:
    """A purpose for which one idea is enough.

    Attributes:
        aim: How many there should be.
        bound: How many there are at most.
        find: Returns the places, each as text.
        named: The places that stay beside the one idea, and why.
    """

    aim: int
    bound: int
    find: Callable[[Trees], list[str]]
    named: Mapping[str, str] = field(default_factory=dict)

    def count(self, found: Trees) -> list[str]:
        """Return the places that are no named exceptions."""
        return [place for place in self.find(found) if place not in self.named]


def trees() -> Trees:
    """Return the syntax tree of each module, by its path from the root of the project."""
    return {
        str(path.relative_to(ROOT)): ast.parse(path.read_text(encoding="utf-8"))
        for package in PACKAGES
        for path in sorted((ROOT / package).rglob("*.py"))
    }


def systems(found: Trees) -> list[str]:
    """Return the classes that are a system."""
    return [
        f"{path}: {node.name}"
        for path, tree in found.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef) and SYSTEM.fullmatch(node.name)
    ]


def descents(found: Trees) -> list[str]:
    """Return the functions that do a Newton descent over all unknowns; linear solvers are none."""
    return [
        f"{path}: {function.name}"
        for path, function in _functions(found)
        if not any(
            room in path for room in ("/linear/", "/mesh/", "/mesh_error/")
        )  # maps of elements are none
        if any(_descends(function.name, _calls(loop)) for loop in _loops(function))
    ]


def roll_backs(found: Trees) -> list[str]:
    """Return the functions that roll a state back and try again."""
    places = []
    for path, function in _functions(found):
        helpers = {
            other.name
            for other in ast.walk(found[path])
            if isinstance(other, ast.FunctionDef) and other.name.startswith("_") and not _loops(other)
            if any(_takes_back(node) for node in ast.walk(other) if isinstance(node, ast.Call))
            if not other.name.startswith("__")
        }
        if _rolls_back(function, helpers):
            places.append(f"{path}: {function.name}")
    return places


def time_errors(found: Trees) -> list[str]:
    """Return the modules that estimate the error of the time steps."""
    return [path for path, tree in found.items() if "TimeErrorReport" in _calls(tree)]


def circles(found: Trees) -> list[str]:
    """Return the circles of imports, each with its modules."""
    names = {path.removesuffix(".py").replace("/", ".").removesuffix(".__init__"): path for path in found}
    imports = {
        name: {target for target in _imports(found[path]) if target in names and target != name}
        for name, path in names.items()
    }
    return [" ".join(sorted(part)) for part in _strong_components(imports) if len(part) > 1]


def types(found: Trees) -> list[str]:
    """Return the calls of isinstance that tell systems or bodies apart."""
    return [
        f"{path}:{node.lineno}"
        for path, tree in found.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "isinstance"
        if any(BODY.fullmatch(name.id) for name in ast.walk(node.args[1]) if isinstance(name, ast.Name))
    ]


def scheme_names(found: Trees) -> list[str]:
    """Return the comparisons of the name of a time scheme, but for numbers that a module gives itself."""
    return [
        f"{path}:{node.lineno}"
        for path, tree in found.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Compare) and any(map(_names_scheme, (node.left, *node.comparators)))
        if not _own_names(tree) & {_last_name(side) for side in (node.left, *node.comparators)}
    ]


IDEAS = {
    "systems": Idea(1, 1, systems),
    "descents": Idea(
        1,
        1,
        descents,
        {
            "tripod_sim/contact/condensed_contact.py: _descend": "few contacts, condensed on their nodes, compiled"
        },
    ),
    "roll-backs": Idea(
        1,
        1,
        roll_backs,
        {
            "tripod_sim/integrators/load_steps.py: carry": "statics: increments of the load, before a part begins",
            "tripod_sim/springs/automatic_kernels.py: automatic_steps": "springs alone: compiled steps",
            "tripod_sim/springs/explicit_kernels.py: explicit_steps": "springs alone: compiled steps",
        },
    ),
    "time errors": Idea(1, 4, time_errors),
    "circles": Idea(0, 0, circles),
    "types": Idea(0, 0, types),
    "scheme names": Idea(0, 0, scheme_names),
}


def main() -> int:
    """Print each count with its places; return 1 if one is above its bound."""
    found, above = trees(), False
    for name, idea in IDEAS.items():
        places = idea.count(found)
        above |= len(places) > idea.bound
        print(f"{name}: {len(places)} (at most {idea.bound}, aim {idea.aim})")
        print("".join(f"    {place}\n" for place in places), end="")
        print("".join(f"    not counted, {place}: {why}\n" for place, why in idea.named.items()), end="")
    return int(above)


def _functions(found: Trees) -> Iterator[tuple[str, ast.FunctionDef]]:
    for path, tree in found.items():
        if path.startswith("tripod_sim/"):
            yield from ((path, node) for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))


def _loops(function: ast.AST) -> list[ast.AST]:
    return [node for node in ast.walk(function) if isinstance(node, ast.For | ast.While)]


def _calls(tree: ast.AST) -> set[str]:
    """Return the names of all functions and methods that are called below a node."""
    return {_last_name(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}


def _last_name(node: ast.AST) -> str:
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""


def _descends(name: str, calls: set[str]) -> bool:
    if DESCENT.fullmatch(name):
        return True
    return any(map(SOLVE.fullmatch, calls)) and any(map(EVALUATE.fullmatch, calls))


def _rolls_back(function: ast.FunctionDef, helpers: set[str]) -> bool:
    """Return whether a loop takes a state back, itself or by one of `helpers`, or a function retries half its step."""
    calls = [node for loop in _loops(function) for node in ast.walk(loop) if isinstance(node, ast.Call)]
    if any(_takes_back(node) or _last_name(node.func) in helpers for node in calls):
        return True
    return any(
        _last_name(node.func) == function.name and any(map(_is_half, node.args))
        for node in ast.walk(function)
        if isinstance(node, ast.Call)
    )


def _takes_back(call: ast.Call) -> bool:
    """Return whether a call writes what was kept into the state."""
    called = _last_name(call.func)
    if called == "copy_to" and isinstance(call.func, ast.Attribute):
        return bool(KEPT.fullmatch(_last_name(call.func.value)))
    return called == "put" and bool(KEPT.fullmatch(_last_name(call.args[-1])))


def _is_half(node: ast.AST) -> bool:
    return isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div) and ast.unparse(node.right) == "2"


def _own_names(tree: ast.Module) -> set[str]:
    """Return the names that a module assigns at its top, as those of tuples are."""
    stored = [n for statement in tree.body if isinstance(statement, ast.Assign) for n in ast.walk(statement)]
    return {n.id for n in stored if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}


def _names_scheme(node: ast.AST) -> bool:
    if isinstance(node, ast.Tuple | ast.List | ast.Set):
        return any(map(_names_scheme, node.elts))
    if isinstance(node, ast.Constant):
        return node.value in SCHEMES
    return _last_name(node) in GROUPS


def _imports(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _strong_components(graph: dict[str, set[str]]) -> list[list[str]]:
    """Return the strongly connected parts of a directed graph, each sorted."""
    reach = {start: _reached(graph, start) for start in graph}
    parts = {tuple(sorted({b for b in reach[a] if a in reach[b]} | {a})) for a in graph}
    return [list(part) for part in sorted(parts)]


def _reached(graph: dict[str, set[str]], start: str) -> set[str]:
    seen, waiting = set[str](), [start]
    while waiting:
        for target in graph[waiting.pop()] - seen:
            seen.add(target)
            waiting.append(target)
    return seen


if __name__ == "__main__":
    sys.exit(main())
