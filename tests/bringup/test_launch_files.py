"""The launch files say what the programs understand: their arguments and parameters, and those of colcon's build."""

import json
import re
import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

pytest.importorskip("rclpy")

from tests.messages import raises_naming
from tripod_bringup.node_command import NODES, parameter_table
from tripod_bringup.parameters_command import parameter_file
from tripod_graph import names

ROOT = Path(__file__).parents[2]
NAMED = {"namespace", "scene", "port", "protocol", "calibration", "record", "params_file", "use_sim_time"}
NAMED |= {"rviz", "foxglove", "autostart"}


def test_the_parameter_file_is_as_the_command_writes_it() -> None:
    written = (ROOT / "config" / "tripod.yaml").read_text(encoding="utf-8")
    assert written == parameter_file(list(NODES)), "run `tripod print parameters > config/tripod.yaml`"


@pytest.fixture
def launched(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """The launch file, with what it takes from launch replaced by what notes it: launch has no wheel."""

    def noting(kind: str) -> Any:
        return lambda *words, **named: SimpleNamespace(kind=kind, words=words, **named)

    class Configuration:
        def __init__(self, name: str) -> None:
            self.name = name

        def perform(self, context: dict[str, str]) -> str:
            return context[self.name]

    modules: dict[str, dict[str, Any]] = {
        "launch": {"LaunchContext": dict, "LaunchDescription": list},
        "launch.actions": {n: noting(n) for n in ("DeclareLaunchArgument", "OpaqueFunction")},
        "launch.conditions": {"IfCondition": lambda text: text.lower() in ("true", "1")},
        "launch.substitutions": {
            "LaunchConfiguration": Configuration,
            "PathJoinSubstitution": lambda parts: parts,
        },
        "launch_ros": {},
        "launch_ros.actions": {n: noting(n) for n in ("Node", "LifecycleNode")},
        "launch_ros.substitutions": {"FindPackageShare": lambda name: name},
        "launch_ros.parameter_descriptions": {"ParameterValue": lambda value, value_type: value_type(value)},
    }
    for name, content in modules.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    return runpy.run_path(str(ROOT / "launch" / "tripod.launch.py"))


def defaults(launched: dict[str, Any]) -> dict[str, str]:
    return {name: default for name, default, _ in launched["ARGUMENTS"]}


def test_it_has_the_arguments_that_the_docs_name(launched: dict[str, Any]) -> None:
    declared = [
        a.words[0] for a in launched["generate_launch_description"]() if a.kind == "DeclareLaunchArgument"
    ]
    assert set(declared) >= NAMED


def test_its_nodes_are_programs_of_the_build_and_know_their_parameters(launched: dict[str, Any]) -> None:
    given = {
        **defaults(launched),
        "namespace": "left",
        "record": "bags",
        "scene": "maze",
        "set": "mesh.level=1",
        "calibration": "r.yaml",
    }
    found = [n for n in launched["nodes"](given) if getattr(n, "package", "") == "tripod"]
    assert [n.executable for n in found] == ["sim", "ik", "view", "driver", "record"]
    built = re.search(r"foreach\(node (.*)\)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"))
    assert built and {n.executable for n in found} <= set(built[1].split())
    for node in found:
        table = {p.name for p in parameter_table(node.executable)} | {"use_sim_time"}
        assert node.namespace == "left" and node.name == node.executable
        assert set(node.parameters[-1]) <= table
    by_name = {n.executable: n for n in found}
    for model in ("sim", "ik"):
        assert by_name[model].parameters == [{"scene": "maze", "set": "mesh.level=1", "use_sim_time": False}]
    assert by_name["record"].parameters[-1]["directory"] == "bags" and by_name["record"].condition
    assert by_name["driver"].kind == "LifecycleNode"
    assert by_name["driver"].parameters[-1]["autostart"] is True
    assert not by_name["view"].condition


def test_only_what_is_asked_for_runs(launched: dict[str, Any], tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.touch()
    given = {**defaults(launched), "sim": "false", "params_file": str(file), "use_sim_time": "true"}
    found = launched["nodes"](given)
    runs = [n.executable for n in found if getattr(n, "condition", True)]
    assert runs == ["ik", "driver"]
    assert found[1].parameters == [str(file), {"use_sim_time": True}]


@pytest.mark.parametrize(("said", "meant"), [("True", True), ("1", True), ("False", False), ("0", False)])
def test_yes_and_no_are_said_as_in_any_launch(launched: dict[str, Any], said: str, meant: bool) -> None:
    found = launched["nodes"]({**defaults(launched), "autostart": said, "use_sim_time": said, "ik": said})
    ik, driver = found[1], found[3]
    assert driver.parameters[-1]["autostart"] is meant and driver.parameters[-1]["use_sim_time"] is meant
    assert ik.condition is meant and ik.parameters[-1]["use_sim_time"] is meant


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("autostart", "yes", "true, false"),
        ("servos", "three", "whole number"),
        ("params_file", "/nowhere/p.yaml", "file"),
    ],
)
def test_what_cannot_be_starts_nothing(launched: dict[str, Any], name: str, value: str, allowed: str) -> None:
    with raises_naming(ValueError, f"'{name}'", f"'{value}'", allowed):
        launched["nodes"]({**defaults(launched), name: value})


@pytest.mark.parametrize("file", ["tripod.launch.py", "two_tripods.launch.py", "own.launch.py"])
def test_a_misspelled_argument_starts_nothing(
    launched: dict[str, Any], monkeypatch: pytest.MonkeyPatch, file: str
) -> None:
    monkeypatch.setattr(sys, "argv", ["ros2", "launch", "tripod", file, "port:=mock", "calib:=robot.yaml"])
    if file == "own.launch.py":  # whose argument it may be, where this launch file is included
        assert launched["nodes"](defaults(launched))
    else:
        with raises_naming(ValueError, "argument 'calib'", *defaults(launched)):
            launched["nodes"](defaults(launched))


def test_the_layouts_show_topics_that_exist() -> None:
    known = {value for name, value in vars(names).items() if name.isupper() and isinstance(value, str)}
    rviz = yaml.safe_load((ROOT / "config" / "tripod.rviz").read_text(encoding="utf-8"))
    displays = rviz["Visualization Manager"]["Displays"]
    shown = [d[k]["Value"] for d in displays for k in ("Topic", "Description Topic") if k in d]
    layout = json.loads((ROOT / "config" / "foxglove.json").read_text(encoding="utf-8"))["configById"]
    shown += list(layout["3D!tripod"]["topics"])
    shown += [
        path["value"].partition(".")[0] for name, p in layout.items() if "Plot" in name for path in p["paths"]
    ]
    assert "/robot_description" in shown
    assert len(shown) > 8
    assert {topic.removeprefix("/") for topic in shown} <= known
