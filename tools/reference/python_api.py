"""The page of the Python library, from signatures and docstrings."""

import inspect
import re
from collections.abc import Iterator
from enum import Enum
from functools import cached_property
from importlib import import_module
from typing import Any

from tools.reference.docstrings import cell, docstring

HEAD = """\
# Python library

What a program of yours may use without ROS and without a robot. SI units, radians, Z up; arrays are NumPy's, float64,
the nodes along the first axis. A wrong value raises an error whose text names the offender, its value and what is
allowed.

The [first page](../index.md) has a program to begin with, the [tutorials](../first_robot.md) the scenes. This page is
written from the code.
"""
PARTS: tuple[tuple[str, str, dict[str, tuple[str, ...]]], ...] = (
    (
        "Simulation",
        "Describe a scene, step it, read what it does.",
        {
            "tripod_sim": ("load_scene", "scene_names", "Simulation", "SceneError", "StepError"),
            "tripod_sim.scene": ("Scene", "scene_from_toml", "scene_to_toml"),
            "tripod_sim.simulation": ("Pose", "Energies"),
            "tripod_sim.acting_forces": ("Forces",),
            "tripod_sim.state": ("State",),
            "tripod_sim.integrators.report": ("StepReport",),
            "tripod_sim.compliance": ("Compliance",),
            "tripod_study.spatial_error": ("spatial_error", "SpatialError"),
        },
    ),
    (
        "Recordings and pictures",
        "Keep a run, read it again, turn it into a page. Keys of the file: [file formats](../file_formats.md).",
        {
            "tripod_study.recording": ("Recording",),
            "tripod_view.player.of_run": ("film_of",),
            "tripod_view.player.film": ("Film", "Deforming", "Piece", "Curve", "Event", "FilmError"),
            "tripod_view.player.html": ("write_html",),
            "tripod_record.bag": ("Bag",),
            "tripod_record.errors": ("RecordError",),
        },
    ),
    (
        "Inverse kinematics",
        "From a wanted pose to servo angles: [how it works](../inverse_kinematics.md).",
        {
            "tripod_ik.solve_once": ("solve_once",),
            "tripod_ik.tracker_settings": ("Goal",),
            "tripod_ik.model": ("StaticModel",),
            "tripod_ik.inverse": ("InverseSolver", "Solution", "Outcome"),
            "tripod_ik.state": ("LinearState",),
            "tripod_ik.tasks": ("PositionTask", "TiltTask", "PostureTask", "orientation_tasks"),
            "tripod_ik.limits": ("AngleLimit", "StepLimit", "SpeedLimit"),
            "tripod_ik.row_limits": ("TorqueLimit", "EffectorBox"),
            "tripod_ik.problem": ("build_ik", "IkProblem"),
            "tripod_ik.solver": ("solve_ik", "IkSolver", "IkResult"),
            "tripod_ik.reach": ("reach", "Reach"),
            "tripod_ik.errors": ("IkError",),
        },
    ),
    (
        "Maze and robot",
        "Play the maze; turn angles into pulses.",
        {
            "tripod_play.solve": ("solve", "Solution", "Eye"),
            "tripod_play.errors": ("PlayError",),
            "tripod_driver.calibration": ("Calibration", "ServoCalibration", "CalibrationError"),
        },
    ),
)
"""Title, a sentence, and the names of each module, in the order of the page."""


def page() -> str:
    """Return the page as Markdown."""
    lines = [HEAD]
    for title, about, modules in PARTS:
        lines += [f"## {title}\n", f"{about}\n"]
        for module, names in modules.items():
            lines += [f"`from {module} import {', '.join(names)}`\n"]
            for name in names:
                lines += _entry(name, getattr(import_module(module), name))
    return "\n".join(lines) + "\n"


def _entry(name: str, what: Any) -> Iterator[str]:
    yield f"### {name}\n"
    if inspect.isclass(what) and issubclass(what, Exception):
        yield f"{docstring(what).prose}\n"
        return
    if inspect.isclass(what) and issubclass(what, Enum):
        yield f"{docstring(what).prose}\n"
        yield f"One of {', '.join(f'`{name}.{one.name}`' for one in what)}.\n"
        return
    yield f"```python\n{name}{signature(what)}\n```\n"
    yield from _text(what)
    if not inspect.isclass(what):
        return
    init = what.__dict__.get("__init__")
    if init is not None and init.__doc__:
        yield from _text(init)
    own = [vars(base) for base in reversed(what.__mro__) if base.__module__.startswith("tripod_")]
    for method, value in {name: value for part in own for name, value in part.items()}.items():
        if method.startswith("_") or not _is_documented(value):
            continue
        if isinstance(value, property | cached_property):
            yield f"- **`{method}`**: {cell(docstring(value).prose)}\n"
            continue
        function = getattr(value, "__func__", value)
        yield f"#### {name}.{method}\n\n```python\n{method}{signature(function)}\n```\n"
        yield from _text(function)


def _is_documented(value: Any) -> bool:
    kinds = (property, cached_property, classmethod, staticmethod)
    return (inspect.isfunction(value) or isinstance(value, kinds)) and bool(getattr(value, "__doc__", None))


def signature(what: Any) -> str:
    """Return the arguments with their types, one a line where they are many, without `self`."""
    try:
        found = inspect.signature(what)
    except (TypeError, ValueError):
        return "(...)"
    parameters = [p for name, p in found.parameters.items() if name not in ("self", "cls")]
    words, keyword = [], False
    for p in parameters:
        if p.kind is p.KEYWORD_ONLY and not keyword:
            words.append("*")
            keyword = True
        kind = "" if p.annotation is p.empty else f": {_type(p.annotation)}"
        default = "" if p.default is p.empty else f" = {_value(p.default)}"
        words.append(("*" if p.kind is p.VAR_POSITIONAL else "") + p.name + kind + default)
    back = found.return_annotation
    arrow = "" if inspect.isclass(what) or back is found.empty else f" -> {_type(back)}"
    line = f"({', '.join(words)}){arrow}"
    return line if len(line) < 80 or not words else "(\n    " + ",\n    ".join(words) + f",\n){arrow}"


def _value(default: Any) -> str:
    text = repr(default)
    return "..." if "<" in text or " object at " in text else text


def _type(annotation: Any) -> str:
    text = annotation if isinstance(annotation, str) else inspect.formatannotation(annotation)
    text = re.sub(r"\b(?:collections\.abc|pathlib|typing)\.|\btripod_\w+\.(?:\w+\.)*", "", text)
    arrays = {"float64": "FloatArray", "int64": "IntArray", "bool": "BoolArray"}
    for kind, name in arrays.items():
        text = text.replace(f"numpy.ndarray[tuple[Any, ...], numpy.dtype[numpy.{kind}]]", name)
    return text


def _text(what: Any) -> Iterator[str]:
    parts = docstring(what)
    if parts.prose:
        yield f"{parts.prose}\n"
    for section, entries in parts.named.items():
        title = {"Args": "Arguments"}.get(section, section)
        yield f"{title}:\n"
        for name, text in entries.items():
            yield f"- `{name}`: {text}"
        yield ""
    for section, text in parts.free.items():
        yield f"{section}: {text}\n"
