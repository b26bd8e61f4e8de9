"""Which code points were measured with: physics that changed must not be mixed with what was measured before."""

import hashlib
import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import tripod_sim

SUFFIXES = (".py", ".toml", ".obj", ".txt")
"""Of code, scenes, meshes and mazes."""

PASSIVE = ("accuracy", "explain", "figures", "studies", "study")
"""Folders of tripod_sim that simulate nothing."""

CARRYING = (
    "description.py", "markers.py", "messages.py", "node.py", "realtime.py", "recording.py", "run.py", "script.py",
    "timeline.py", "transforms.py",
)  # fmt: skip
"""Files of tripod_sim that carry a simulation to people, files and ROS."""

SHOWN = re.compile(rb"\n(#[^\n]*\n)*\[motion\]\n.*?(?=\n(#[^\n]*\n)*\[|\Z)", re.DOTALL)
"""Of a scene: what only `tripod run` does with it."""

MEASURING = ("study/motion.py", "study/task.py")
"""Files of these that do have a part in what a point shows."""


@cache
def fingerprint(module: str) -> str:
    """Return a digest of the files whose code measures the points of a study, 16 hexadecimal digits.

    That is all of tripod_sim that simulates and, where the study comes from another package, the rest of that. The
    module itself is left out: points that are added to a study change no other point, and a task that changes raises
    the study's version.

    Args:
        module: Of the study's task, such as `tripod_sim.study.plans.cloth`.
    """
    found = find_spec(module)
    assert found
    assert found.origin
    own, here = Path(found.origin), Path(str(tripod_sim.__file__)).parent
    files = simulating(here)
    if here not in own.parents:
        files |= {f"{own.parent.name}/{p}": path for p, path in sources(own.parent).items() if path != own}
    return digest(files)


def simulating(folder: Path) -> dict[str, Path]:
    """Return the files of a folder of tripod_sim that simulate, by their path in it."""
    return {
        name: path
        for name, path in sources(folder).items()
        if name in MEASURING or (name.partition("/")[0] not in PASSIVE and name not in CARRYING)
    }


def sources(folder: Path) -> dict[str, Path]:
    """Return the files of a folder that decide what its code does, by their path in it."""
    return {
        path.relative_to(folder).as_posix(): path
        for path in folder.rglob("*")
        if path.suffix in SUFFIXES and path.is_file()
    }


def digest(files: dict[str, Path]) -> str:
    """Return a digest of files by name; the ends of their lines do not count."""
    made = hashlib.sha256()
    for name in sorted(files):
        text = files[name].read_bytes().replace(b"\r\n", b"\n")
        text = SHOWN.sub(b"", text) if name.endswith(".toml") else text
        made.update(f"{name}\0{hashlib.sha256(text).hexdigest()}\n".encode())
    return made.hexdigest()[:16]
