"""The commands of README.md and of the tutorials, typed literally from where these pages put the reader."""

import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.messages import assert_names
from tests.terminal import Terminal

ROOT = Path(__file__).parents[2]
README, FIRST, OWN, ROBOT = ("README.md", "docs/first_robot.md", "docs/own_robot.md", "docs/on_the_robot.md")
WAITS = {
    r"make demo": r"moved by the inverse kinematics \|",
    r"tripod up( --scene \S+)?": r"nothing moves the robot \|",
    r"tripod run .*--view": r"Ctrl-C",
}
"""Commands that run until Ctrl-C, and what they show by then."""
BOARD = ("tripod doctor --ask", "make firmware", "tripod flash", "tripod calibrate", "tripod up --port auto")
"""Begin commands that need a board or a compiler for one; test_readme.py checks their options."""
ELSEWHERE = ("make demo", "python3 -m venv", "../simulator/bin/", "tripod teleop")
"""Begin commands with a test of their own below, or in test_library_alone.py: they install, or need two terminals."""
FAILS = {'tripod ik --scene bridge.toml --target "3mm 2mm -8mm"': 1, "make demo": 130}
"""Exit codes that the pages announce, and that of make after Ctrl-C."""


def text(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def commands(page: str) -> list[str]:
    """All lines that a reader types, in their order."""
    return [line for block in re.findall(r"```sh\n(.*?)```", text(page), re.S) for line in block.splitlines()]


def typed(page: str) -> list[str]:
    """Those that are typed here, in one terminal."""
    return [line for line in commands(page) if not line.startswith((*BOARD, *ELSEWHERE))]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A clone, as `git clone` and `make setup` leave it: the environment is the one of this test."""
    words = {"git clone ADDRESS tripod": f"git clone -q {shlex.quote(str(ROOT))} tripod"}
    assert "git clone ADDRESS tripod" in commands(README)
    terminal = Terminal(tmp_path, os.environ)
    assert terminal.type(words["git clone ADDRESS tripod"])[0] == 0
    terminal.close()
    (tmp_path / "tripod" / ".venv").symlink_to(ROOT / ".venv")
    return tmp_path / "tripod"


@pytest.fixture
def terminal(checkout: Path, domain: int) -> Iterator[Terminal]:
    found = Terminal(checkout, {**os.environ, "PYTHONPATH": str(ROOT), "ROS_DOMAIN_ID": str(domain)})
    yield found
    found.close()


def works(terminal: Terminal, line: str) -> str:
    """Type a line, end what waits for it by Ctrl-C; return what it showed."""
    until = next((seen for pattern, seen in WAITS.items() if re.fullmatch(pattern, line)), None)
    if until is None:
        code, shown = terminal.type(line)
    else:
        first = terminal.start(line, until)
        code, rest = terminal.finish()
        shown = first + rest
    assert code == FAILS.get(line, 0), f"{line}\n{shown}"
    return shown


def test_the_first_commands_of_the_readme_lead_to_a_page(terminal: Terminal) -> None:
    lines = typed(README)
    assert lines[:2] == ["git clone ADDRESS tripod", "cd tripod"]
    assert "source .venv/bin/activate" in lines
    for line in lines[2:]:  # the terminal begins in the clone
        shown = works(terminal, line)
        assert "--view" not in line or re.search(r"http://127\.0\.0\.1:\d+/\S+", shown)


def test_the_program_of_the_readme_reaches_the_working_pose(capsys: pytest.CaptureFixture[str]) -> None:
    [program] = re.findall(r"```python\n(.*?)```", text(README), re.S)
    assert len([line for line in program.splitlines() if line]) <= 10
    exec(program, {})
    height = float(re.findall(r"-?\d\.\d+(?:e-\d+)?", capsys.readouterr().out)[2])
    assert height == pytest.approx(-10.25e-3, abs=0.2e-3)


@pytest.mark.slow
def test_make_demo_shows_the_robot_that_follows(domain: int) -> None:
    """In this checkout, where `make setup` has been done."""
    demo = Terminal(ROOT, {**os.environ, "ROS_DOMAIN_ID": str(domain)})
    shown = works(demo, "make demo")
    demo.close()
    assert_names(shown, "http://127.0.0.1", "real-time factor")


@pytest.mark.slow
def test_your_first_soft_robot(terminal: Terminal, checkout: Path) -> None:
    shown = {line: works(terminal, line) for line in typed(FIRST)}
    assert sum("--view" in line for line in shown) >= 5
    answer = next(said for line, said in shown.items() if line.startswith("tripod ik"))
    angles = re.search(r"angles\s+(\S+), (\S+), (\S+) rad", answer)
    [check] = [line for line in shown if "--slide" in line]
    assert angles
    assert [f"{float(a):.3f}" for a in angles.groups()] == check.split("1:")[1].split('"')[0].split(",")
    np.testing.assert_allclose(effector(shown[check]), [5.0, 0.0, -6.0], atol=0.05)
    assert (checkout / "robot.html").stat().st_size > 10_000


@pytest.mark.slow
def test_your_own_robot(terminal: Terminal, checkout: Path) -> None:
    [program] = re.findall(r"```python\n(.*?)```", text(OWN), re.S)
    [scene, part] = re.findall(r"```toml\n(.*?)```", text(OWN), re.S)
    shown = {}
    for line in typed(OWN):
        shown[line] = works(terminal, line)
        if line == "cd my_robot":
            (checkout / "my_robot" / "make_mesh.py").write_text(program)
            (checkout / "my_robot" / "bridge.toml").write_text(scene)
            (checkout / "my_robot" / "notched.toml").write_text(part)
    for said in (said for line, said in shown.items() if "inertia=off" in line):
        error = re.search(r"effector (about \S+ mm)", said)
        assert error
        assert_names(text(OWN), f"{effector(said)[2]:.1f} mm", error[1])
    reached = next(said for line, said in shown.items() if '0 -8mm"' in line)
    degrees = re.search(r"(-[\d.]+), (-[\d.]+) degrees", reached)
    assert degrees
    np.testing.assert_allclose(np.array(degrees.groups(), float), [-90.2, -72.7], atol=0.06)


def effector(shown: str) -> list[float]:
    """The position of the effector in a summary [mm]."""
    found = re.search(r"effector +at (\S+), (\S+), (\S+) mm", shown)
    assert found, shown
    return [float(value) for value in found.groups()]


@pytest.mark.slow
def test_two_terminals_of_on_the_robot(terminal: Terminal, checkout: Path, domain: int) -> None:
    first, second = ["source .venv/bin/activate", "tripod up"], ["source .venv/bin/activate", "tripod teleop"]
    assert commands(ROBOT)[:4] == first + second
    own = re.compile(r"(POSE|PARK|SLIDE)=.*|tripod up \$SLIDE")  # the next test types these
    assert all(line.startswith(BOARD) or own.fullmatch(line) for line in commands(ROBOT)[4:])
    terminal.type(first[0])
    terminal.start(first[1], WAITS[r"tripod up( --scene \S+)?"])
    keys = Terminal(checkout, {**os.environ, "PYTHONPATH": str(ROOT), "ROS_DOMAIN_ID": str(domain)})
    keys.type(second[0])
    keys.start(second[1], r"servos go")
    assert keys.finish("q")[0] == 0
    keys.close()
    assert terminal.finish()[0] == 0


@pytest.mark.slow
def test_the_slide_that_is_fastened(terminal: Terminal) -> None:
    lines = commands(ROBOT)
    first = next(k for k, line in enumerate(lines) if line.startswith("POSE="))
    terminal.type("source .venv/bin/activate")
    for line in lines[first : first + 3]:
        assert terminal.type(line)[0] == 0
    assert "sim parked" in terminal.start(lines[first + 3], WAITS[r"tripod up( --scene \S+)?"])
    assert terminal.finish()[0] == 0
