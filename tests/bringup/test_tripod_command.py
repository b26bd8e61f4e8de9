"""The `tripod` command: options in, exit codes out, and a start that is quick."""

import json
import os
import re
import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.messages import assert_names
from tripod_bringup import cli, node_command, up_command
from tripod_bringup.node_values import node_package
from tripod_bringup.run_command import _tell_note
from tripod_sim.errors import SceneError, StepError

ROOT = Path(__file__).parents[2]
RESULT = {
    "scene": "tripod",
    "effector": {"position": np.array([0.001, -1e-9, -0.00825]), "quaternion": [0.0, 0.0, 0.0, 1.0]},
    "angles": np.full(3, -np.pi / 4),
    "slide": 0.035,
    "torques": [-0.14, -0.14, -0.14],
    "energies": {"kinetic": 0.0, "strain": 0.6959},
    "time": 1.0,
    "dt": 0.005,
    "steps": np.int64(200),
    "newton_iterations": 321,
    "halvings": 0,
    "residual": float("nan"),
    "seconds": 0.11,
    "displacement": {"node": 7, "largest": 0.0123},
    "step_ms": {"median": 0.5, "p99": 1.25},
}


def tripod(*words: str) -> Any:
    """Run the command line in this process; the result has exit_code, stdout and stderr."""
    return CliRunner().invoke(cli.app, list(words))


class FakeRun:
    """Stands for `tripod_study.run.run`: keeps what it was given."""

    def __init__(self) -> None:
        self.scene = ""
        self.given: dict[str, Any] = {}
        self.error: Exception | None = None
        self.result = dict(RESULT)

    def __call__(self, scene: str, **given: Any) -> dict[str, Any]:
        self.scene, self.given = scene, given
        if self.error:
            raise self.error
        return self.result


@pytest.fixture
def fake_run(monkeypatch: pytest.MonkeyPatch) -> FakeRun:
    fake = FakeRun()
    module = types.ModuleType("tripod_study.run")
    module.run = fake  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "tripod_study.run", module)
    return fake


def test_run_passes_its_options_on(fake_run: FakeRun, tmp_path: Path) -> None:
    out = tmp_path / "run.npz"
    words = ["run", "tripod", "--duration", "2", "--servo", "0:0,0,0; 1:-1,-1,-1", "--slide", "0.035"]
    result = tripod(
        *words, "--set", "material.young=3e5", "--set", "gravity=off", "--out", str(out), "--json"
    )
    assert result.exit_code == 0
    assert fake_run.scene == "tripod"
    assert fake_run.given == {
        "duration": 2.0,
        "servo": "0:0,0,0; 1:-1,-1,-1",
        "slide": "0.035",
        "actuate": (),
        "forces": False,
        "mesh_error": False,
        "overrides": ["material.young=3e5", "gravity=off"],
        "out": out,
        "recorded": None,
        "progress": None,
        "say": None,
        "noted": _tell_note,
        "study": None,
    }


def test_run_without_options_leaves_all_to_the_scene(fake_run: FakeRun) -> None:
    tripod("run", "silicone")
    nothing = dict.fromkeys(("duration", "servo", "slide", "out", "recorded", "progress", "say", "study"))
    assert fake_run.given == {
        **nothing,
        "actuate": (),
        "forces": False,
        "mesh_error": False,
        "overrides": [],
        "noted": _tell_note,
    }


def test_run_tells_what_is_odd_of_a_scene_that_cannot_begin() -> None:
    odd = ["mesh.level=1", "mesh.cells=[2,2,2]", "solver.tolerance=1e-14"]
    result = tripod("run", "silicone", *(word for text in odd for word in ("--set", text)))
    note, error = result.stderr.splitlines()
    assert_names(note, "tripod run: note: ", "mesh.cells", "mesh.source", "'y_piece'")
    assert_names(error, "tripod run: ", "step 1", "0 s", "solver.tolerance", "1e-14 N")
    assert result.exit_code == 1


def test_run_prints_one_json_object_that_any_reader_takes(fake_run: FakeRun) -> None:
    result = tripod("run", "tripod", "--json")
    assert result.stderr == ""
    given = json.loads(result.stdout, parse_constant=pytest.fail)
    assert given["effector"]["position"] == [0.001, -1e-9, -0.00825]
    assert (given["steps"], given["residual"]) == (200, None)
    assert given.keys() == RESULT.keys()


def test_run_ends_with_at_most_six_lines(fake_run: FakeRun) -> None:
    written = [{"file": "run.npz", "bytes": 1230000}]
    fake_run.result["written"] = written
    lines = tripod("run", "tripod", "--set", "dt=0.005").stdout.splitlines()
    rows = dict(re.split("  +", line, maxsplit=1) for line in lines)
    assert list(rows) == ["result", "time", "error", "cost", "files", "next"]
    assert_names(rows["result"], "effector", "1.00, 0.00, -8.25 mm", "-0.140, -0.140, -0.140 N m", "at rest")
    assert_names(rows["time"], "1 s", "200 steps of 5 ms")
    assert_names(rows["error"], "not known")
    assert_names(rows["cost"], "0.5 ms", "0.1 s")
    assert_names(rows["files"], "run.npz", "1.2 MB")
    assert_names(rows["next"], "tripod study tripod --set dt=0.005 --quick", "--view", "--verbose")


def test_run_prints_a_table_for_people_and_nothing_when_quiet(fake_run: FakeRun) -> None:
    fake_run.result["residual"] = 2e-5
    table = [re.split("  +", line) for line in tripod("run", "tripod", "--verbose").stdout.splitlines()]
    expected = {
        "scene": ["tripod"],
        "time": ["1 s", "200 steps", "5 ms"],
        "effector": ["1.000, 0.000, -8.250 mm"],
        "effector turned": ["0.00 degrees"],
        "angles": ["-45.00, -45.00, -45.00 degrees"],
        "slide": ["35.00 mm"],
        "torques": ["-0.1400, -0.1400, -0.1400 N m"],
        "energies": ["kinetic 0.000", "strain 695.900 mJ"],
        "residual": ["2e-05 N"],
        "solved by": ["321 Newton iterations"],
        "step took": ["0.500 ms median", "1.250 ms p99", "10 times real time"],
    }
    assert [name for name, _ in table] == list(expected)
    for name, value in table:
        assert_names(value, *expected[name])
    assert tripod("run", "tripod", "--quiet").output == ""


def test_a_scene_without_effector_and_servos_has_a_table_too(fake_run: FakeRun) -> None:
    fake_run.result.update(effector=None, angles=[], torques=[], residual=0.0)
    names = [line.split("  ")[0] for line in tripod("run", "silicone", "--verbose").stdout.splitlines()]
    assert names == ["scene", "time", "energies", "residual", "solved by", "step took"]


def test_rigid_bodies_and_contacts_have_rows(fake_run: FakeRun) -> None:
    body = {"position": [0.1, 0.0, 0.0512341], "quaternion": [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]}
    contact = {"contacts": 12, "pressed": 8, "force": 17.658, "rounds": 3, "residual": 2.5e-7, "smallest_gap": -1e-6,
               "cut": 0.0}  # fmt: skip
    fake_run.result.update(effector=None, angles=[], torques=[], rigid=[body], contact=contact)
    lines = tripod("run", "stack", "--verbose").stdout.splitlines()
    rigid, contacts, gaps = (re.split("  +", line) for line in lines[2:5])
    assert (rigid[0], contacts[0], gaps[0]) == ("rigid.0", "contacts", "gaps")
    assert_names(rigid[1], "100.000, 0.000, 51.234 mm", "turned 90.00 degrees")
    assert_names(contacts[1], "8 of 12", "17.66 N")
    assert_names(gaps[1], "-0.001 mm", "error 0.00025 mm", "3 rounds")


@pytest.mark.parametrize(
    ("error", "code", "named"),
    [
        (SceneError("material.young is -1;\nit must be positive"), 2, ("material.young is -1",)),
        (StepError("element 7 inverted"), 1, ("element 7 inverted",)),
        (PermissionError(13, "Permission denied", "run.npz"), 2, ("run.npz", "permission denied")),
        (OSError(28, "No space left", "run.npz"), 2, ("run.npz", "no space left", "free space")),
    ],
)
def test_run_tells_what_is_wrong_in_one_line(
    fake_run: FakeRun, error: Exception, code: int, named: tuple[str, ...]
) -> None:
    fake_run.error = error
    result = tripod("run", "tripod", "--json")
    assert result.exit_code == code
    assert result.stdout == ""
    assert result.stderr.count("\n") == 1 and result.stderr.startswith("tripod run: ")
    assert_names(result.stderr, *named)


@pytest.mark.parametrize(
    ("words", "suggestion"),
    [
        (["dcotor"], "doctor"),
        (["run", "tripod", "--durtion", "1"], "--duration"),
        (["up", "--no-veiw"], "--no-view"),
    ],
)
def test_a_word_that_is_unknown_is_refused_with_a_suggestion(words: list[str], suggestion: str) -> None:
    result = tripod(*words)
    assert result.exit_code == 2
    assert suggestion in result.stderr


def test_an_option_of_the_wrong_type_is_refused_by_name() -> None:
    result = tripod("run", "tripod", "--duration", "soon")
    assert result.exit_code == 2
    assert_names(result.stderr, "--duration", "number")


@pytest.mark.parametrize(
    "words",
    [
        ["run"],
        ["up"],
        ["doctor"],
        ["print", "scene"],
        ["print", "maze"],
        ["bag", "info"],
        *[[n] for n in node_command.NODES],
    ],
)
def test_every_command_has_help_with_examples(words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(_name: str) -> tuple[()]:
        raise ImportError("not here")

    monkeypatch.setattr(node_command, "parameter_table", absent)  # importing the nodes is tested elsewhere
    result = tripod(*words, "--help")
    assert result.exit_code == 0
    assert f"$ tripod {' '.join(words)}" in result.stdout


def test_help_of_a_node_lists_its_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    parameters = pytest.importorskip("tripod_graph.parameters")
    table = (parameters.Parameter("rate", 50.0, "Packets a second.", unit="Hz", low=1, high=100),)
    monkeypatch.setattr(node_command, "parameter_table", lambda _name: table)
    lines = [line.split() for line in tripod("driver", "--help").stdout.splitlines()]
    assert ["rate", "50.0", "Hz", "1", "to", "100"] in lines
    assert ["Packets", "a", "second."] in lines


def fake_node(monkeypatch: pytest.MonkeyPatch, name: str) -> list[list[str]]:
    """Put a node in the place of the real one; returns the command lines it gets."""
    parameters = pytest.importorskip("tripod_graph.parameters")
    calls: list[list[str]] = []
    module = types.ModuleType(f"{node_package(name)}.node")
    table = (parameters.Parameter("port", "auto", "A port"),)
    monkeypatch.setattr(node_command, "parameter_table", lambda _name: table)

    def main(arguments: list[str]) -> int:
        calls.append(arguments)
        return 5

    module.main = main  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, f"{node_package(name)}.node", module)
    return calls


def test_a_node_command_runs_the_node_and_returns_its_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    calls = fake_node(monkeypatch, "driver")
    assert tripod("driver", "--set", "port=mock").exit_code == 5
    assert calls == [['port:="mock"']]
    tripod("driver", "--subnet")
    assert calls[1] == ["--subnet"]


def test_a_node_command_refuses_what_the_node_does_not_know(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    calls = fake_node(monkeypatch, "driver")
    result = tripod("driver", "--set", "prot=mock")
    assert result.exit_code == 2
    assert_names(result.stderr, "'prot'", "'port'")
    assert tripod("driver", "--set", "port").exit_code == 2
    assert calls == []


def test_scenes_are_listed_with_what_they_are() -> None:
    lines = tripod("print", "scene").stdout.splitlines()
    assert {line.split()[0] for line in lines} >= {"silicone", "tripod"}
    listing = json.loads(tripod("print", "scene", "--json").stdout)
    assert {entry["name"] for entry in listing} >= {"silicone", "tripod"}
    assert all(entry["description"] for entry in listing)


def test_bag_info_of_nothing_says_so(tmp_path: Path) -> None:
    result = tripod("bag", "info", str(tmp_path / "gone.mcap"))
    assert result.exit_code == 2
    assert "gone.mcap" in result.stderr


@pytest.fixture
def options(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Keep what `tripod up` would do instead of doing it."""
    pytest.importorskip("rclpy")
    kept: list[Any] = []

    def up(given: Any, _screen: Any) -> int:
        kept.append(given)
        return 12

    monkeypatch.setattr(up_command, "up", up)
    return kept


def test_up_passes_its_options_on_and_returns_the_code(options: list[Any]) -> None:
    words = [
        "--port",
        "/dev/ttyACM0",
        "--record",
        "bags",
        "--no-view",
        "--view-port",
        "9000",
        "--duration",
        "3",
    ]
    assert tripod("up", *words, "--subnet", "--namespace", "left", "--set", "driver.rate=25").exit_code == 12
    given = options[0]
    assert (given.record, given.view, given.view_port) == (Path("bags"), False, 9000)
    assert (given.duration, given.subnet, given.demo, given.namespace) == (3.0, True, False, "/left")
    assert given.values["driver"] == {"port": "/dev/ttyACM0", "rate": "25"}


def test_a_demo_without_a_terminal_records_and_ends_by_itself(options: list[Any]) -> None:
    tripod("up", "--demo")
    assert (options[0].record, options[0].duration) == (Path("recordings"), 20.0)
    assert options[0].values["driver"] == {"port": "mock"}
    tripod("up")
    assert (options[1].record, options[1].duration) == (None, None)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--scene", "tirpod"], ["'tirpod'", "'tripod'"]),
        (["--duration", "nan"], ["--duration"]),
        (["--duration", "inf"], ["--duration"]),
        (["--set", "drvier.rate=1"], ["'drvier'", "'driver'"]),
        (["--set", "driver.angle_mx=3"], ["'angle_mx'", "'angle_max'"]),
        (["--set", "record.max_size=5"], ["record.max_size", "--record DIR"]),
        (["--port", "com1"], ["driver", "port 'com1'", "mock, pty, auto", "/dev/ttyACM0"]),
        (
            ["--set", "driver.calibration=gone.yaml"],
            ["driver", "gone.yaml", "No such file", "tripod calibrate"],
        ),
        (["cross", "--set", "driver.start=[0, 0, 0]"], ["driver", "'start'", "3 values", 4]),
        (["--set", "ik.weights=[1]"], ["ik", "'weights'", "1 values", 3, "x, y, z"]),
        (["--set", "ik.scene=gone"], ["ik", "scene 'gone'", ".toml"]),
        (["--set", "ik.posterior=gone"], ["ik", "'posterior'", "gone", "No such file"]),
        (["--set", "sim.accuracy=much"], ["sim", "accuracy", "'much'"]),
        (["--set", "sim.study=gone"], ["sim", "study 'gone'", "No such file"]),
        (["--set", "view.target_low=[1, 0, 0]"], ["view", "target_low", "[1.0, 0.0, 0.0]", "target_high"]),
        (["--view-port", "70000"], ["--view-port", 65535]),
        (["--namespace", "9left"], ["namespace '9left'", "letters, digits and _"]),
    ],
)
def test_up_refuses_bad_arguments_before_it_does_anything(
    options: list[Any], words: list[str], named: list[object]
) -> None:
    result = tripod("up", *words)
    assert result.exit_code == 2
    assert_names(result.stderr, *named)
    assert options == []


def test_looking_at_the_driver_writes_nothing(
    options: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it keeps of a board is left alone: a port may be another's."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert tripod("up", "--set", "driver.start=[0, 0, 0]").exit_code == 12
    assert len(options) == 1
    assert list(tmp_path.iterdir()) == []


def command(*words: str) -> list[str]:
    return [sys.executable, "-c", "from tripod_bringup.cli import main; main()", *words]


def environment(**more: str) -> dict[str, str]:
    return dict(os.environ, PYTHONPATH=str(ROOT), **more)


def test_help_imports_neither_ros_nor_numpy() -> None:
    """How long that takes is for benchmarks/."""
    code = (
        "import sys\nfrom tripod_bringup.cli import main\n"
        "try: main()\nexcept SystemExit: pass\n"
        "heavy = {'rclpy', 'numpy', 'numba', 'scipy', 'yaml', 'serial', 'matplotlib', 'tripod_sim', 'tripod_ik'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "--help"], env=environment(), capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    ("words", "code"),
    [(["--help"], 141), (["print", "parameters", "driver"], 141), (["print", "scene", "nosuch"], 2)],
)
def test_a_reader_that_left_is_told_by_one_exit_code_whatever_library_notices(
    words: list[str], code: int
) -> None:
    """Rich prints the help and Click the parameters; what is wrong with the words is still told."""
    reader, output = os.pipe()
    os.close(reader)
    with os.fdopen(output, "wb") as stdout:
        done = subprocess.run(
            command(*words), env=environment(), stdout=stdout, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == code
    assert (done.stderr == "") == (code == 141)


def test_the_version_is_that_of_the_distribution() -> None:
    done = subprocess.run(command("--version"), env=environment(), capture_output=True, text=True, check=True)
    assert done.stdout.startswith("tripod ")


def test_a_record_directory_that_cannot_be_written_stops_up_before_anything_starts(tmp_path: Path) -> None:
    words = ["up", "--record", "/proc/none", "--no-view"]
    more = {"XDG_RUNTIME_DIR": str(tmp_path), "ROS_DOMAIN_ID": "99"}
    done = subprocess.run(
        command(*words), env=environment(**more), capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert_names(done.stderr, "tripod up: ", "record", "/proc/none")


def test_a_second_up_on_the_domain_is_refused_with_the_process_of_the_first(tmp_path: Path) -> None:
    from tripod_bringup.lock import only_one

    more = {"XDG_RUNTIME_DIR": str(tmp_path), "ROS_DOMAIN_ID": "99"}
    with only_one(99, "/", tmp_path):
        done = subprocess.run(
            command("up"), env=environment(**more), capture_output=True, text=True, timeout=300, check=False
        )
    assert done.returncode == 3
    assert_names(done.stderr, f"process {os.getpid()}", "domain 99")


def test_progress_is_drawn_only_in_a_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    from tripod_bringup.run_command import progress_bar

    with progress_bar(shown=False) as hidden:
        assert hidden is None
    with progress_bar(shown=True) as shown:
        assert isinstance(shown, Callable)  # type: ignore[arg-type]
        shown(0.5)
    assert capsys.readouterr().out == ""
