"""Arrows between the packages point one way: bringup -> nodes -> pure libraries (docs/architecture.md)."""

import ast
import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

MAY_IMPORT = {
    "tripod_host": set(),
    "tripod_graph": {"tripod_host"},
    "tripod_sim": {"tripod_host"},
    "tripod_study": {"tripod_host", "tripod_sim"},
    "tripod_runtime": {"tripod_host", "tripod_graph", "tripod_sim", "tripod_study"},
    "tripod_ik": {"tripod_host", "tripod_graph", "tripod_sim", "tripod_study", "tripod_identify"},
    "tripod_driver": {"tripod_host", "tripod_graph"},
    "tripod_teleop": {"tripod_host", "tripod_graph"},
    "tripod_view": {"tripod_host", "tripod_graph"},
    "tripod_record": {"tripod_host", "tripod_graph"},
    "tripod_play": {"tripod_host", "tripod_graph", "tripod_sim", "tripod_ik"},
    "tripod_identify": {"tripod_host", "tripod_sim"},
}
"""Packages of the suite that each package may import; tripod_bringup may import all."""

ROS_EDGE = {
    "tripod_host": set(),
    "tripod_graph": {
        "control_mode",
        "diagnostics",
        "follow_action",
        "goal_request",
        "limits",
        "parameters",
        "liveliness",
        "qos",
        "executor",
        "run",
        "timers",
        "trajectory",
    },
    "tripod_sim": set(),
    "tripod_study": set(),
    "tripod_runtime": {
        "node",
        "messages",
        "markers",
        "scene_topics",
        "settings",
        "simulated_clock",
        "standard_services",
        "introspection",
        "transforms",
    },
    "tripod_ik": {"node", "messages", "settings"},
    "tripod_driver": {"node", "messages", "settings"},
    "tripod_teleop": {"node", "settings"},
    "tripod_view": {"node", "messages", "settings"},
    "tripod_record": {"node", "play_node", "settings"},
    "tripod_play": {"node", "replay_node"},
    "tripod_identify": set(),
}
"""Modules that touch ROS, themselves or through what they import. All others work where there is no ROS."""

OPTIONAL = {"tripod_sim.linear.cholmod", "tripod_identify.marker", "tripod_bringup.camera"}
"""Modules that need an optional extra; nothing imports them unless a scene names them or the extra is there."""

HOME = {
    "websockets": {"tripod_view"},
    "serial": {"tripod_driver", "tripod_bringup"},  # the doctor looks at ports
    "mcap": {"tripod_record"},
    "rosbags": {"tripod_record"},
    "cv2": {"tripod_identify", "tripod_bringup"},
    "osqp": {"tripod_ik"},
    "qdldl": {"tripod_sim"},
    "numba": {"tripod_sim", "tripod_study", "tripod_ik", "tripod_view", "tripod_bringup"},
    "typer": {"tripod_bringup"},
    "rich": {"tripod_bringup"},
}
"""Libraries that only some packages may use."""

ROS = {
    "ament_index_python",
    "builtin_interfaces",
    "rclpy",
    "rcl_interfaces",
    "rosidl_adapter",
    "rosidl_parser",
    "rosidl_runtime_py",
    "rpyutils",
    "simulation_interfaces",
    "std_srvs",
}


def is_ros(module: str) -> bool:
    top = module.partition(".")[0]
    return top in ROS or top.endswith("_msgs")


@cache
def modules() -> dict[str, Path]:
    """Every module of the suite by dotted name."""
    found = {}
    for path in sorted(ROOT.glob("tripod_*/**/*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def loaded(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes of a text that are not inside a function: what loading imports, and what types name."""
    for node in ast.iter_child_nodes(tree):
        if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            yield node
            yield from loaded(node)


@cache
def imports(module: str, walk: Callable[[ast.AST], Iterator[ast.AST]] = ast.walk) -> frozenset[str]:
    """What `module` imports anywhere in its text, also inside functions; modules of the suite by their full name."""
    path = modules()[module]
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    found = set()
    for node in walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parents = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*parents, *([base] if base else [])])
            found.add(base)
            found |= {f"{base}.{a.name}" for a in node.names if f"{base}.{a.name}" in modules()}
    return frozenset(found)


@cache
def reached(module: str) -> frozenset[str]:
    """All modules that importing `module` may bring in, through the modules of the suite."""
    seen, waiting = set(), {module}
    while waiting:
        name = waiting.pop()
        seen.add(name)
        if name in modules():
            parents = {name.rsplit(".", n)[0] for n in range(1, name.count(".") + 1)}
            waiting |= (imports(name) | parents) - seen
    return frozenset(seen)


def package_of(module: str) -> str:
    return module.partition(".")[0]


def test_the_reader_of_imports_sees_what_it_must() -> None:
    assert {package_of(m) for m in modules()} == {*MAY_IMPORT, "tripod_bringup"}
    assert "tripod_graph.run" in imports("tripod_runtime.node")
    assert "rclpy" in imports("tripod_graph.run"), "imports inside functions count"
    assert "rclpy" in {package_of(m) for m in reached("tripod_runtime.node")}
    assert "numpy" in reached("tripod_sim")


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_a_package_imports_only_what_is_below_it(package: str) -> None:
    allowed = MAY_IMPORT[package] | {package, "tripod_msgs"}
    wrong = {
        f"{module} -> {target}"
        for module in modules()
        if package_of(module) == package
        for target in imports(module)
        if target.startswith("tripod_") and package_of(target) not in allowed
    }
    assert not wrong


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_a_package_tells_type_checkers_that_it_has_types(package: str) -> None:
    """PEP 561: without the file a checker takes everything in an installed package as Any."""
    assert (ROOT / package / "py.typed").is_file()


def test_only_bringup_imports_a_node() -> None:
    wrong = {
        f"{module} -> {target}"
        for module in modules()
        if package_of(module) != "tripod_bringup"
        for target in imports(module)
        if target.startswith("tripod_") and target.endswith(".node")
    }
    assert not wrong


@pytest.mark.parametrize("package", ROS_EDGE)
def test_ros_stays_at_the_edge_of_a_package(package: str) -> None:
    touching = {
        module.removeprefix(f"{package}.")
        for module in modules()
        if package_of(module) == package and any(is_ros(m) for m in reached(module))
    }
    assert touching == ROS_EDGE[package]


def test_a_library_is_used_at_home_only() -> None:
    wrong = {
        f"{module} -> {target}"
        for module in modules()
        for target in imports(module)
        if package_of(module) not in HOME.get(package_of(target), {package_of(module)})
    }
    assert not wrong


def loaded_by(statement: str) -> set[str]:
    """Top-level names of all modules that a fresh interpreter has after `statement`."""
    code = f"import json, sys\n{statement}\nprint(json.dumps([m.partition('.')[0] for m in sys.modules]))"
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, check=True, stdout=subprocess.PIPE, timeout=60
    )
    return set(json.loads(result.stdout))


@pytest.mark.parametrize("package", ROS_EDGE)
def test_a_fresh_interpreter_loads_the_pure_modules_without_ros(package: str) -> None:
    pure = [
        m
        for m in modules()
        if package_of(m) == package
        and m.removeprefix(f"{package}.") not in ROS_EDGE[package]
        and m not in OPTIONAL
    ]
    loaded = loaded_by(f"import {', '.join(pure)}")
    assert package in loaded
    assert not {m for m in loaded if is_ros(m)}
    if package in {"tripod_graph", "tripod_sim", "tripod_study", "tripod_ik", "tripod_identify"}:
        assert not loaded & {"serial", "websockets", "mcap", "typer", "rich"}


def test_the_simulator_as_a_library_loads_neither_ros_nor_port_nor_page_nor_recorder() -> None:
    loaded = loaded_by("from tripod_sim import Simulation, load_scene; Simulation(load_scene('tripod'))")
    assert {"numba", "qdldl"} <= loaded
    assert not loaded & {"serial", "websockets", "mcap", "osqp", "typer", "rich", "meshio", "matplotlib"}
    assert not {m for m in loaded if is_ros(m)}


@pytest.mark.parametrize("package", [*MAY_IMPORT, "tripod_bringup"])
def test_importing_a_package_alone_loads_nothing_heavy(package: str) -> None:
    loaded = loaded_by(f"import {package}")
    assert package in loaded
    assert not loaded & {*HOME, "numpy", "scipy"}
    assert not {m for m in loaded if is_ros(m)}


def circle(module: str) -> list[str]:
    """Return the modules of a shortest way by which `module` imports itself, for types too; empty for none.

    Imports inside functions do not count: building imports what a scene names.
    """
    first = imports(module, loaded)
    ways, waiting = {m: [module, m] for m in sorted(first & modules().keys())}, [*first]
    while waiting and module not in ways:
        now = waiting.pop(0)
        for target in sorted(
            (imports(now, loaded) if now in modules() else set()) & modules().keys() - ways.keys()
        ):
            ways[target] = [*ways[now], target]
            waiting.append(target)
    return ways.get(module, [])


@pytest.mark.parametrize("package", [*MAY_IMPORT, "tripod_bringup"])
def test_no_module_imports_itself_by_way_of_others(package: str) -> None:
    found = {m: circle(m) for m in modules() if package_of(m) == package}
    assert not {" -> ".join(way) for way in found.values() if way}


def test_types_of_arrays_are_named_in_one_module() -> None:
    home = Path("tripod_host/arrays.py")
    names = {
        target.id
        for node in ast.parse((ROOT / home).read_text()).body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    assert {"FloatArray", "IndexArray", "Array"} <= names
    again = [
        f"{path.relative_to(ROOT)}: {target.id}"
        for folder in (*MAY_IMPORT, "tripod_bringup", "tests", "benchmarks")
        for path in (ROOT / folder).rglob("*.py")
        if path.relative_to(ROOT) != home
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name) and target.id in names
    ]
    assert not again
