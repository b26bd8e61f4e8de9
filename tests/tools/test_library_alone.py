"""`pip install .` is enough for the simulator: no ROS, no extra."""

import subprocess
import sys
import tomllib
from importlib.metadata import distribution, packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.messages import assert_names

ROOT = Path(__file__).parents[2]
HIDING = """
import sys
from importlib.machinery import PathFinder
hidden, find = set(sys.argv[1].split(",")), PathFinder.find_spec
def find_shown(name, path=None, target=None):
    return None if name.partition(".")[0] in hidden else find(name, path, target)
PathFinder.find_spec = staticmethod(find_shown)
"""
RUN = "import runpy; sys.argv[:] = ['tripod', *sys.argv[2:]]; runpy.run_module('tripod_bringup', run_name='__main__')"


def needed() -> set[str]:
    """Names of the distributions that an installation without extras brings along."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    todo, found = list(project["dependencies"]), set[str]()
    while todo:
        requirement = Requirement(todo.pop())
        name = canonicalize_name(requirement.name)
        here = requirement.marker is None or any(
            requirement.marker.evaluate({"extra": extra}) for extra in ("", *requirement.extras)
        )
        if here and name not in found:
            found.add(name)
            todo += distribution(name).requires or []
    return found


def hidden() -> str:
    """The modules of all other distributions, separated by commas."""
    wanted = needed()
    owners = {m: {canonicalize_name(d) for d in ds} for m, ds in packages_distributions().items()}
    others = {m for m, ds in owners.items() if not ds & wanted and not m.startswith("tripod_")}
    return ",".join(sorted({*others, "tripod_msgs", "rclpy", "rpyutils"}))


def run(code: str, *words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    python = [sys.executable, "-c", HIDING + code, hidden(), *words]
    environ = {"PATH": "/usr/bin:/bin", "HOME": str(folder), "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        python, cwd=folder, env=environ, capture_output=True, text=True, check=False, timeout=600
    )


def test_what_no_installation_without_extras_has_is_hidden(tmp_path: Path) -> None:
    names = hidden().split(",")
    assert {"rclpy", "websockets", "mcap", "matplotlib", "meshio", "pytest"} <= set(names)
    assert not {"numpy", "scipy", "numba", "qdldl", "osqp", "typer", "rich", "yaml", "serial"} & set(names)
    assert "No module named 'websockets'" in run("import websockets", folder=tmp_path).stderr


@pytest.mark.parametrize(
    "words",
    [
        ("run", "pendulum", "--out", "run.npz"),
        ("run", "tripod", "--html", "run.html"),
        ("scenes",),
    ],
)
def test_commands_of_the_simulator_run(words: tuple[str, ...], tmp_path: Path) -> None:
    done = run(RUN, *words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "pendulum" in done.stdout or "effector" in done.stdout
    assert all((tmp_path / word).exists() for word in words if word.startswith("run."))


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("run", "pendulum", "--plot", "a.png"), ("--plot", "pip install matplotlib")),
        (("reach", "--out", "a.csv", "--plot", "a.png"), ("--plot", "pip install matplotlib")),
        (
            ("run", "silicone_free", "--set", "mesh.source=a.vtk"),
            ("mesh.source", "meshio", "pip install 'tripod[mesh]'"),
        ),
    ],
)
def test_what_needs_an_extra_says_so_in_one_line(
    words: tuple[str, ...], named: tuple[str, ...], tmp_path: Path
) -> None:
    (tmp_path / "a.vtk").touch()
    done = run(RUN, *words, folder=tmp_path)
    assert done.returncode == 2
    assert_names(done.stderr, *named)
    assert len(done.stderr.splitlines()) == 1, done.stderr
