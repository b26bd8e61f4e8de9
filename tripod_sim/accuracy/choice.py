"""The cheapest setting of a scene for an accuracy.

A study looks at a few motions or poses; others err more or less. A setting is therefore taken for an accuracy only if
`margin` times its error in the study, plus what the study's reference may err, is within it, and that much is told as
the error to expect: under it lie at least 95 % of 200 random cases (benchmarks/accuracy_promise.py,
docs/accuracy_promise.md).
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any

from tripod_sim.accuracy.machine import product_time
from tripod_sim.accuracy.stored import StoredPoint, StoredStudy, Value, read_study, stored_studies
from tripod_sim.errors import SceneError, shown
from tripod_sim.scene import Scene
from tripod_sim.scene_file import load_scene
from tripod_sim.tables.motion import EXPLICIT

MARGIN = 3.0
"""Error in other cases over that in a study's own, where it was not measured."""

MEASURED = {"tripod_static": 1.5, "tripod_dynamic": 3.5, "pendulum": 4.0, "cloth": 12.0}
"""The same by study, measured by benchmarks/accuracy_promise.py. A study that moves one servo, or lets a cloth fall, is
gentler than motions in which all servos turn, or cloths that are thrown and fold."""

DRAFT = 0.3
"""Largest relative error of `draft`."""

LOAD = 0.5
"""Share of the simulated time that `real-time` lets a simulation take of this machine's."""

WORDS = ("draft", "real-time", "reference")
"""The cheapest within `DRAFT`; the most exact within `LOAD`; the most exact."""

INSIDE = ("servos.angles", "servos.slide", "duration", "name", "description", "motion.servo", "motion.slide")
"""Fields that are free: what is promised is promised for any start, any motion and any length of a run."""

PERCENT = re.compile(r"(\d{1,3}(?:\.\d{1,9})?|\.\d{1,9}) ?%", re.ASCII)


@dataclass(frozen=True)
class Choice:
    """A setting for an accuracy.

    Attributes:
        accuracy: What was asked for.
        study: Name of the study that it is from; empty where none was asked.
        overrides: Of the scene: those of the setting, then the user's own.
        settings: Of the point that was picked.
        error: To expect, relative (see `promised`).
        quantity: What the error is of.
        seconds: Time of this machine for a simulated second, or for a solve [s]; None where it could not be told.
        outside: Overrides of the user that the study knows nothing of: with them the error is not promised.
        sentence: All that for people, on one line.
    """

    accuracy: str
    study: str
    overrides: tuple[str, ...]
    settings: Mapping[str, Value]
    error: float
    quantity: str
    seconds: float | None
    outside: tuple[str, ...]
    sentence: str


def asked(accuracy: str) -> float | str:
    """Return the largest relative error that `accuracy` asks for, or one of `WORDS`. Raises SceneError.

    >>> asked("5%"), asked("draft")
    (0.05, 'draft')
    """
    text = accuracy.strip()
    if text in WORDS:
        return text
    match = PERCENT.fullmatch(text)
    if not match or not 0 < float(match[1]) <= 100:
        raise SceneError(
            f"--accuracy is {shown(accuracy)}; it must be a percentage above 0 % and up to 100 %, in plain digits "
            f"such as 5%, or one of: {', '.join(WORDS)}"
        )
    return float(match[1]) / 100


def choose(
    scene: str,
    accuracy: str,
    overrides: Sequence[str] = (),
    *,
    study: Path | None = None,
    speed: Callable[[], float | None] = product_time,
) -> Choice:
    """Return the setting of a scene for an accuracy.

    Args:
        scene: Name of a shipped scene or path of a scene file.
        accuracy: See `asked`.
        overrides: Of the user; they win.
        study: File of a study; None: the one that comes with tripod.
        speed: Returns the CPU time of the product that studies are calibrated with, on this machine [s].

    Raises:
        SceneError: anything wrong with the input, no study of the scene, no point that is so exact.
    """
    wish = asked(accuracy)
    made = load_scene(scene, overrides)
    found = read_study(study) if study else shipped(made, scene)
    if study:
        _check_fits(found, made)
    here = speed()
    scale = here / found.calibration if here and found.calibration else None
    point = pick(found, wish, scale)
    picked = [f"{field}={_literal(value)}" for field, value in point.settings.items()]
    words = (*picked, *overrides)
    load_scene(scene, words)  # a study that does not fit the scene is told here
    error, seconds = promised(found, point), point.cpu * scale if scale else None
    outside = _outside(scene, found, picked, overrides)
    return Choice(
        accuracy, found.name, words, dict(point.settings), error, found.quantity, seconds, outside,
        _sentence(accuracy, found, _changes(scene, point), error, seconds, outside),
    )  # fmt: skip


def pick(study: StoredStudy, wish: float | str, scale: float | None) -> StoredPoint:
    """Return the point of a study that a wish is best served by, of those that serve whatever else is changed.

    That is none of explicit steps that are not divided until they are stable: they are as far as this body goes, and
    another mass or stiffness makes them overflow.

    Args:
        study: Of the scene.
        wish: See `asked`.
        scale: Time of this machine over that of the study's; None where it is not known.

    Raises:
        SceneError: there is none; the message names the best.
    """
    points = [p for p in study.points if _stays_stable(p)]
    if not points:
        raise SceneError(f"study {study.name!r} has no point that worked and stays stable")
    exact = min(points, key=lambda p: (promised(study, p), p.cpu))
    if wish == "reference":
        return exact
    if wish == "real-time":
        if study.solves:
            raise SceneError(
                f"--accuracy real-time needs a study of a motion; {study.name!r} is of static solves: name a percentage"
            )
        if scale is None:
            raise SceneError("--accuracy real-time: this machine's speed is not known; name a percentage")
        fast = [p for p in points if p.cpu * scale <= LOAD]
        if not fast:
            least = min(points, key=lambda p: p.cpu)
            raise SceneError(
                f"--accuracy real-time: no setting of study {study.name!r} takes less than {LOAD:g} s of this machine "
                f"for a simulated second; the fastest takes {least.cpu * scale:.2g} s"
            )
        return min(fast, key=lambda p: (promised(study, p), p.cpu))
    allowed = DRAFT if wish == "draft" else float(wish)
    within = [p for p in points if promised(study, p) <= allowed * (1 + 1e-9)]
    if not within:
        raise SceneError(
            f"--accuracy {percent(allowed)}: no setting of study {study.name!r} is so exact; the best promises "
            f"{percent(promised(study, exact))} ({settings_text(exact)}): --accuracy reference takes it"
        )
    return min(within, key=lambda p: (p.cpu, promised(study, p)))


def _stays_stable(point: StoredPoint) -> bool:
    """Return whether the steps of a point stay stable on another body: implicit, or divided as that one needs."""
    scheme, substeps = (
        point.settings.get("inertia.scheme", "auto"),
        point.settings.get("inertia.substeps", "auto"),
    )
    return scheme != "explicit_euler" and (scheme not in EXPLICIT or substeps == "auto")


def margin(study: StoredStudy) -> float:
    """Return the error that other cases may have over that of the study's own."""
    return MEASURED.get(study.name, MARGIN)


def promised(study: StoredStudy, point: StoredPoint) -> float:
    """Return the relative error to expect of a point: `margin` times its error, and what the reference may err."""
    return margin(study) * point.error + max(0.0, point.bound - point.error)


def percent(error: float) -> str:
    """Return a relative error for people."""
    return f"{100 * error:.2g} %"


def shipped(made: Scene, scene: str) -> StoredStudy:
    """Return the study that comes with tripod for a scene: of motions if it moves, else of static solves."""
    moves = made.inertia is not None
    if not scene.endswith(".toml"):
        paths = [p for p in stored_studies() if p.stem == scene or p.stem.startswith(f"{scene}_")]
        for path in sorted(paths, key=lambda p: len(p.stem)):
            found = read_study(path)
            if found.scene == scene and found.solves != moves:
                return found
    kind = "moves" if moves else "is static"
    raise SceneError(
        f"--accuracy: there is no study of scene {scene!r} where it {kind}; make one with `tripod study` (--help lists "
        "the scenes) and name its file by --study, or leave --accuracy out"
    )


def _check_fits(study: StoredStudy, made: Scene) -> None:
    """Raise SceneError if a study that the user named is not of this scene."""
    if study.scene != made.name:
        raise SceneError(f"--study: it is of scene {study.scene!r}, not of {made.name!r}")
    if study.solves == (made.inertia is not None):
        kind = "static solves, and the scene moves" if study.solves else "a motion, and the scene is static"
        raise SceneError(f"--study: it is of {kind}")


def _outside(
    scene: str, study: StoredStudy, picked: Sequence[str], overrides: Sequence[str]
) -> tuple[str, ...]:
    """Return the overrides of the user that change what was studied, and what was studied and is not in the scene."""
    found, named = [], {word.partition("=")[0].strip() for word in overrides}
    made = load_scene(scene, [*picked, *overrides])
    for k, word in enumerate(overrides):
        field = word.partition("=")[0].strip()
        if field in INSIDE or (field in study.base and holds(made, field, study.base[field])):
            continue
        try:
            other = load_scene(scene, [*picked, *overrides[:k], *overrides[k + 1 :]])
        except SceneError:  # the scene needs it
            other = None
        if other != made:
            found.append(word)
    for field, value in study.base.items():
        if field not in INSIDE and field not in named and not holds(made, field, value):
            found.append(f"the study has {field}={_literal(value)}")
    return tuple(found)


def holds(made: Scene, field: str, value: Value) -> bool:
    """Return whether a field of a scene has a value; `off` is an effect that is absent."""
    try:
        found: Any = reduce(getattr, field.split("."), made)
    except AttributeError:
        found = None
    return not found if value == "off" else found == value


def _literal(value: Value) -> str:
    return (
        str(value).lower() if isinstance(value, bool) else (value if isinstance(value, str) else repr(value))
    )


def settings_text(point: StoredPoint) -> str:
    """Return the settings of a point for people."""
    return ", ".join(f"{field}={_literal(value)}" for field, value in point.settings.items())


def _changes(scene: str, point: StoredPoint) -> str:
    """Return in words which settings of a point are not those of the scene as it is."""
    made = load_scene(scene)
    changed = {f: v for f, v in point.settings.items() if not holds(made, f, v)}
    return ", ".join(f"{f}={_literal(v)}" for f, v in changed.items()) or "the scene as it is"


def _sentence(
    accuracy: str,
    study: StoredStudy,
    changes: str,
    error: float,
    seconds: float | None,
    outside: Sequence[str],
) -> str:
    """Return the choice for people, on one line."""
    unit = "solve" if study.solves else "simulated second"
    time = (
        f"{seconds:.2g} s of this machine for each {unit}"
        if seconds is not None
        else "time on this machine unknown"
    )
    made = f"{'quick ' if study.quick else ''}study {study.name}"
    text = (
        f"accuracy {accuracy.strip()}: {changes} ({made}); expect an error below {percent(error)} of: "
        f"{study.quantity}; {time}"
    )
    return (
        f"{text}; outside the study, which promises nothing then: {'; '.join(outside)}" if outside else text
    )
