"""The steps that make `.venv`: the environment, the pinned packages, the messages, the simulator's loops compiled.

Each step is done once for its inputs (see `state.py`). One that was interrupted while it wrote into `.venv` leaves
unknown things there, so `.venv` is then made again; the messages alone are simply built again.
"""

import fcntl
import os
import platform
import shutil
import subprocess
import sys
import time
import tomllib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from tools import sourced_ros
from tools.build_msgs import build_messages, interfaces_of_others, message_files, own_messages, site_packages
from tools.command import Job, Shell
from tools.errors import MissingError, StepError
from tools.prerequisites import missing_things
from tools.ros_source import PATHS, RosSource, find_ros, used_packages
from tools.state import SetupState, key_of
from tripod_host.locks import open_lock

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
LOG = VENV / "setup.log"

SPOILED = {
    "environment": ("packages", "interfaces", "messages", "loops"),
    "packages": ("interfaces", "messages", "loops"),
    "interfaces": ("messages",),
}
"""Steps that must be done again once the one before them is."""

EXTRAS_WITH_WHEELS = "build,cad,dev,docs,labs,large,msgs,plot,record,ros,step,view"
EXTRAS_WITH_SOURCED_ROS = "build,cad,dev,docs,labs,large,plot,record,step,view"


def main() -> int:
    """Do every step that is not done; return the exit code: 0 ready, 1 a step failed, 2 something is missing."""
    try:
        with _lock() as lock:
            _prepare(lock)
    except MissingError as error:
        for line in str(error).splitlines():
            print(f"setup: {line}", file=sys.stderr)
        return 2
    except StepError as error:
        print(f"setup: {error}\nsetup: everything it said is in {LOG.relative_to(ROOT)}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nsetup: interrupted; `make setup` takes it up again", file=sys.stderr)
        return 130
    return 0


def _prepare(lock: int) -> None:
    began = time.monotonic()
    if VENV.is_symlink():
        raise MissingError(
            f"{VENV} is a link to {VENV.resolve()}, which belongs to another checkout; remove the link"
        )
    ros = find_ros(os.environ, used_packages(ROOT))
    state = SetupState(VENV)
    keys = _keys(ros)
    todo = [step for step in keys if not state.is_done(step, keys[step])]
    if not todo and (VENV / "bin" / "python").exists():
        print("setup: .venv is up to date")
        return
    if lines := missing_things(os.environ, cmake=ros.sourced is not None):
        raise MissingError("\n".join(lines))
    _check_sourced_rclpy(ros)
    print(f"setup: Python {sys.version.split()[0]}, {ros.description}")
    LOG.unlink(missing_ok=True)
    shell = Shell(_environ(), LOG, lock)
    with ExitStack() as beside:
        _do(keys, state, ros, shell, beside)
    print(f"setup: ready after {time.monotonic() - began:.1f} s")


def _do(keys: dict[str, str], state: SetupState, ros: RosSource, shell: Shell, beside: ExitStack) -> None:
    """Do the steps that are not done; `beside` ends what runs beside them."""
    loops: Job | None = None
    if not _is_sound(state, keys["environment"], ros):
        with _step(state, keys, "environment", "creating .venv"):
            _create_environment(ros, shell)
    if not state.is_done("packages", keys["packages"]):
        with _step(state, keys, "packages", "installing the pinned packages (about 1.5 GB on disk)"):
            _install_libraries(shell)
            loops = _start_loops(shell)  # which needs no more than these, while pip keeps one processor busy
            beside.callback(loops.kill)
            _install_packages(ros, shell)
    if not state.is_done("interfaces", keys["interfaces"]):
        with _step(state, keys, "interfaces", "building interfaces that have no wheel"):
            _install_interfaces(ros, shell)
    if not state.is_done("messages", keys["messages"]):
        with _step(state, keys, "messages", "building the messages"):
            _install_messages(ros, shell)
    if not state.is_done("loops", keys["loops"]):
        with _step(state, keys, "loops", "compiling the loops of the simulator for this machine"):
            loops = loops or _start_loops(shell)
            beside.callback(loops.kill)
            loops.end()


def _keys(ros: RosSource) -> dict[str, str]:
    """What each step depends on, in the order of the steps, besides those that spoil it."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    what = [project["build-system"], project["project"], project["tool"]["setuptools"]]
    packages = sorted(p.parent.name for p in ROOT.glob("tripod_*/__init__.py"))
    python = [sys.version, os.path.realpath(sys.executable)]
    return {
        "environment": key_of(str(ROOT), python, ros.sourced is not None),
        "packages": key_of(what, packages, ROOT / "constraints.txt"),
        "interfaces": key_of(
            ros.sourced, *message_files(interfaces_of_others(ROOT, ros)), Path(sourced_ros.__file__)
        ),
        "messages": key_of(ros.sourced, *message_files(own_messages(ROOT))),
        "loops": key_of(platform.machine(), *_sources_with_loops()),
    }


def _sources_with_loops() -> list[Path]:
    found = sorted((ROOT / "tripod_sim").glob("**/*.py"))
    return [path for path in found if "njit" in path.read_text(encoding="utf-8")]


@contextmanager
def _lock() -> Iterator[int]:
    """Hold the lock on the set-up of this checkout; wait while another process holds it."""
    path = ROOT / ".setup.lock"  # not the folder: who can read that can lock it, and keep all others waiting
    try:
        file = open_lock(path)
    except OSError as error:
        raise MissingError(f"{path}: {error.strerror}") from None
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("setup: waiting for another set-up of this checkout to end", flush=True)
            fcntl.flock(file, fcntl.LOCK_EX)
        yield file
    finally:
        os.close(file)


@contextmanager
def _step(state: SetupState, keys: dict[str, str], name: str, text: str) -> Iterator[None]:
    """Run the body as the step `name`: say so with its duration, and keep `state` right whatever happens."""
    print(f"setup: {text} ...", flush=True)
    began = time.monotonic()
    state.begin(name, spoiled=SPOILED.get(name, ()))
    try:
        yield
    except StepError:
        state.fail()
        raise
    state.finish(name, keys[name])
    print(f"setup: {text}: {time.monotonic() - began:.1f} s", flush=True)


def _environ() -> dict[str, str]:
    """The environment of pip and cmake: that of the shell without what would lead another Python astray."""
    astray = {"PYTHONHOME", "PYTHONPATH", "PYTHONSTARTUP", "VIRTUAL_ENV", "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}
    kept = {k: v for k, v in os.environ.items() if k not in astray}
    path = os.pathsep.join([str(VENV / "bin"), os.environ.get("PATH", os.defpath)])
    return {**kept, "PATH": path, "PIP_USER": "0", "PIP_NO_INPUT": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}


def _check_sourced_rclpy(ros: RosSource) -> None:
    if not ros.sourced:
        return
    words = [sys.executable, "-c", "import rclpy"]
    result = subprocess.run(words, capture_output=True, text=True, check=False)
    if result.returncode:
        reason = (result.stderr.strip().splitlines() or ["no reason given"])[-1]
        raise MissingError(
            f"Python {sys.version.split()[0]} ({sys.executable}) cannot import rclpy of the sourced ROS ({reason}); "
            "name the Python that this ROS was built for: make setup PYTHON=/usr/bin/python3"
        )


def _is_sound(state: SetupState, key: str, ros: RosSource) -> bool:
    """Whether `.venv` is there, whole and of the right kind; one that somebody else made is taken over if so."""
    if not (VENV / "bin" / "python").exists():
        return False
    if state.interrupted in {"environment", "packages"}:
        print("setup: the last set-up was interrupted; making .venv again")
        return False
    if state.is_done("environment", key):
        return True
    if state.known:
        print(
            f"setup: this is Python {sys.version.split()[0]} ({sys.executable}); .venv was made with another one, with "
        )
        print("setup: or without ROS, or elsewhere; making it again")
        return False
    words = [str(VENV / "bin" / "python"), "-c", "import pip, sys; print(sys.version)"]
    result = subprocess.run(words, env=_environ(), capture_output=True, text=True, check=False)
    config = (VENV / "pyvenv.cfg").read_text(encoding="utf-8") if (VENV / "pyvenv.cfg").exists() else ""
    sees_system = "include-system-site-packages = true" in config
    if result.returncode or result.stdout.strip() != sys.version or sees_system != bool(ros.sourced):
        print("setup: .venv does not work or is of another kind; making it again")
        return False
    state.finish("environment", key)
    return True


def _create_environment(ros: RosSource, shell: Shell) -> None:
    kept = {SetupState.FILE}
    for path in VENV.iterdir():
        if path.name in kept:
            continue
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()
    shell.run(sys.executable, "-m", "venv", *(["--system-site-packages"] if ros.sourced else []), VENV)


def _pip() -> list[str | Path]:
    """The words that install; what is never imported is never compiled, which would take a third of the time."""
    words = ("-m", "pip", "install", "--no-compile", "-c", ROOT / "constraints.txt")
    return [VENV / "bin" / "python", *words]


def _install_libraries(shell: Shell) -> None:
    """Install what the simulator alone needs."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    shell.run(*_pip(), *project["dependencies"])


def _install_packages(ros: RosSource, shell: Shell) -> None:
    pip = _pip()
    shell.run(*pip, "setuptools")
    extras = EXTRAS_WITH_SOURCED_ROS if ros.sourced else EXTRAS_WITH_WHEELS
    # what has no wheel is built with the setuptools just installed, not with whichever is the newest
    shell.run(*pip, "--no-build-isolation", "-e", f"{ROOT}[{extras}]")


def _install_interfaces(ros: RosSource, shell: Shell) -> None:
    if ros.sourced:  # which has them all
        sourced_ros.install(site_packages(VENV), VENV, ros.sourced)
    build_messages(interfaces_of_others(ROOT, ros), VENV, ros, shell)


def _start_loops(shell: Shell) -> Job:
    return shell.start(VENV / "bin" / "python", "-m", "tools.compile_loops")


def _install_messages(ros: RosSource, shell: Shell) -> None:
    if ros.sourced:
        shell = shell.with_environ(**{name: os.environ.get(name, "") for name in PATHS})
    build_messages(own_messages(ROOT), VENV, ros, shell)
