"""Which code points were measured with: physics that changed must not be mixed with what was measured before."""

import hashlib
import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import tripod_sim
import tripod_study

SUFFIXES = (".py", ".toml", ".obj", ".txt")
"""Of code, scenes, meshes and mazes."""

CARRYING = ("scene/description.py", "scene/script.py", "tables/timeline.py")
"""Files of tripod_sim that describe a simulation or read its motion."""

SHOWN = re.compile(rb"\n(#[^\n]*\n)*\[motion\]\n.*?(?=\n(#[^\n]*\n)*\[|\Z)", re.DOTALL)
"""Of a scene: what only `tripod run` does with it."""

MEASURING = ("motion.py", "task.py", "watch.py")
"""Files of tripod_study that have a part in what a point shows."""


@cache
def fingerprint(module: str) -> str:
    """Return a digest of the files whose code measures the points of a study, 16 hexadecimal digits.

    These are all files of tripod_sim that simulate, those of tripod_study that measure and, where the study comes from
    another package, the files of that. The module itself is left out: points that are added to a study change no other
    point, and a task that changes raises the study's version.

    Args:
        module: Of the study's task, such as `tripod_study.watch`.
    """
    found = find_spec(module)
    assert found
    assert found.origin
    own, simulator, study = (
        Path(found.origin),
        Path(str(tripod_sim.__file__)),
        Path(str(tripod_study.__file__)),
    )
    files = simulating(simulator.parent, study.parent)
    if study.parent not in own.parents:
        files |= {f"{own.parent.name}/{p}": path for p, path in sources(own.parent).items() if path != own}
    return digest(files)


def simulating(simulator: Path, study: Path) -> dict[str, Path]:
    """Return the files of the folders of tripod_sim and tripod_study that simulate or measure, by package and path."""
    return {
        f"tripod_sim/{name}": path for name, path in sources(simulator).items() if name not in CARRYING
    } | {f"tripod_study/{name}": path for name, path in sources(study).items() if name in MEASURING}


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
