"""The cheapest setting of a scene for an accuracy, and the most exact one for a budget of computing time.

A study looks at a few motions or poses; others err more or less. A setting is therefore taken for an accuracy only if
`margins` times its error in the study, plus what the study's reference may err, is within it, and that much is told as
the error to expect: under it lie at least 95 % of 200 random cases (benchmarks/accuracy_promise.py,
docs/accuracy.md).
"""

import math
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import reduce
from pathlib import Path
from typing import Any

from tripod_sim.errors import SceneError, shown
from tripod_sim.integrators.scheme import ExplicitScheme
from tripod_sim.integrators.schemes import SCHEMES, auto
from tripod_sim.scene import Scene
from tripod_sim.scene.file import load_scene, scene_from_toml, scene_to_toml, words_of
from tripod_study.accuracy.machine import product_time
from tripod_study.accuracy.margins import margins
from tripod_study.accuracy.stored import NUMBERS, StoredPoint, StoredStudy, Value, read_study, stored_studies
from tripod_study.accuracy.studied import FREE, INSIDE, studied

DRAFT = 0.3
"""Largest relative error of `draft`, where the study names no point of its own for it."""

LOAD = 0.5
"""Share of the simulated time that `real-time` lets a simulation take of this machine's."""

WORDS = ("draft", "real-time", "reference")
"""The study's draft, else the cheapest within `DRAFT`; the most exact within `LOAD`; the most exact."""

BUDGET = re.compile(r"budget (?:(\d{1,6}(?:\.\d{1,9})?) ?%|(\d{1,6}(?:\.\d{1,9})?) ?(us|ms|s))", re.ASCII)
UNITS = {"us": 1e-6, "ms": 1e-3, "s": 1.0}

PERCENT = re.compile(r"(\d{1,3}(?:\.\d{1,9})?|\.\d{1,9}) ?%", re.ASCII)


@dataclass(frozen=True)
class Budget:
    """Computing time of this machine that a simulation may take, the most exact setting being wanted.

    Attributes:
        text: As it was asked for.
        share: Of one core, in real time; infinite where `step` says it.
        step: Of a step, or of a solve in statics [s]; infinite where `share` says it.
    """

    text: str
    share: float = math.inf
    step: float = math.inf


@dataclass(frozen=True)
class Choice:
    """A setting for an accuracy.

    Attributes:
        accuracy: What was asked for.
        study: Name of the study that it is from; empty where none was asked.
        overrides: Of the scene: those of the setting, then the user's own.
        settings: Of the point that was picked.
        measured: Relative error that the study measured; None where something is `outside` the study.
        error: Relative error that is promised for other cases (see `promised`); None likewise.
        quantity: What the errors are of; where a study promises several, the largest of all counts.
        seconds: Time of this machine for a simulated second, or for a solve [s]; None where it could not be told.
        outside: What the study has not seen, such as overrides of the user: then it says nothing of the error.
        sentence: All that for people, on one line.
        told: What is known of the error, for people.
    """

    accuracy: str
    study: str
    overrides: tuple[str, ...]
    settings: Mapping[str, Value]
    measured: float | None
    error: float | None
    quantity: str
    seconds: float | None
    outside: tuple[str, ...]
    sentence: str
    told: str


def asked(accuracy: str) -> float | str | Budget:
    """Return the largest relative error that `accuracy` asks for, one of `WORDS`, or a budget. Raises SceneError.

    >>> asked("5%"), asked("draft"), asked("budget 50%")
    (0.05, 'draft', Budget(text='budget 50%', share=0.5, step=inf))
    """
    text = accuracy.strip()
    if text == "real-time":
        return Budget(f"accuracy {text}", share=LOAD)
    if text in WORDS:
        return text
    if text.startswith("budget"):
        return _budget(text)
    match = PERCENT.fullmatch(text)
    if not match or not 0 < float(match[1]) <= 100:
        raise SceneError(
            f"--accuracy is {shown(accuracy)}; it must be a percentage above 0 % and up to 100 %, in plain digits "
            f"such as 5%, or one of: {', '.join(WORDS)}"
        )
    return float(match[1]) / 100


def _budget(text: str) -> Budget:
    """Return the budget that a text such as `budget 2ms` asks for. Raises SceneError."""
    match = BUDGET.fullmatch(text)
    share, step = (float(match[1] or 0) / 100, float(match[2] or 0)) if match else (0.0, 0.0)
    if not match or share + step <= 0:
        raise SceneError(
            f"--budget is {shown(text.removeprefix('budget').strip())}; it must be a share of one core above 0 %, such "
            "as 50%, or a time above 0 of a step, such as 2ms (us, ms or s)"
        )
    return Budget(text, share=share) if match[1] else Budget(text, step=step * UNITS[match[3]])


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
    return chosen_from(scene, made, study_of(scene, made, study), accuracy, wish, overrides, speed)


def switched(
    scene: str,
    accuracy: str,
    overrides: Sequence[str],
    *,
    study: Path | None = None,
    speed: Callable[[], float | None] = product_time,
) -> Choice:
    """Return the setting that a running scene is switched to: it wins over `overrides`, see `choose` for the rest."""
    found = study_of(scene, load_scene(scene, overrides), study)
    varied = {field for point in found.points for field in point.settings}
    fields_of = ((word, word.partition("=")[0].strip()) for word in overrides)
    kept = [word for word, field in fields_of if not {field, field.partition(".")[0]} & varied]
    return choose(scene, accuracy, kept, study=study, speed=speed)


def chosen_from(
    scene: str,
    made: Scene,
    found: StoredStudy,
    accuracy: str,
    wish: float | str | Budget,
    overrides: Sequence[str],
    speed: Callable[[], float | None],
    beside: Sequence[str] = (),
) -> Choice:
    """Return the choice from a study that fits the scene, `made` with the overrides of the user. Raises SceneError.

    `beside` is what else the user asks for that the study knows nothing of.
    """
    here = speed()
    scale = here / found.calibration if here and found.calibration else None
    point = pick(found, wish, scale, made.dt)
    picked = words_of(point.settings)
    words = (*picked, *overrides)
    load_scene(scene, words)  # a study that does not fit the scene is told here
    changed = changes(load_scene(scene), point.settings)
    seconds = point.cpu * scale if scale else None
    strange = (*outside(scene, found, picked, overrides), *beside)
    here, bound = (None, None) if strange else (measured(found, point), promised(found, point))
    return Choice(
        accuracy, found.name, words, dict(point.settings), here, bound, quantities(found), seconds, strange,
        _sentence(accuracy, found, point, changed, seconds, strange),
        not_known(found, strange) if strange else measured_words(found, point),
    )  # fmt: skip


def pick(
    study: StoredStudy, wish: float | str | Budget, scale: float | None, dt: float = math.inf
) -> StoredPoint:
    """Return the point of a study that a wish is best served by, of those that serve whatever else is changed.

    That is none of explicit steps that are not divided until they are stable: they are as far as this body goes, and
    another mass or stiffness makes them overflow.

    Args:
        study: Of the scene.
        wish: See `asked`.
        scale: Time of this machine over that of the study's; None where it is not known.
        dt: Time step of the scene [s], where a point does not say its own; infinite: no such point keeps within a time.

    Raises:
        SceneError: there is none; the message names the best.
    """
    points = [p for p in study.points if stays_stable(p)]
    if not points:
        raise SceneError(
            f"study {study.name!r} has no setting that worked and stays stable; make it again: `tripod "
            f"study {study.name!r}`"
        )
    if isinstance(wish, Budget):
        return _within(study, points, wish, scale, dt)
    exact = min(points, key=lambda p: (promised(study, p), p.cpu))
    if wish == "reference":
        return exact
    if wish == "draft" and (named := [p for p in points if p.settings == study.draft]):
        return named[0]
    allowed = DRAFT if wish == "draft" else float(wish)
    within = [p for p in points if promised(study, p) <= allowed * (1 + 1e-9)]
    if not within:
        raise SceneError(
            f"--accuracy {percent(allowed)}: no setting of study {study.name!r} is so accurate; the most "
            f"accurate one has an error of {percent(measured(study, exact))} in the study, at most "
            f"{percent(promised(study, exact))} in other motions ({settings_text(exact)}): take it with "
            "--accuracy reference"
        )
    return min(within, key=lambda p: (p.cpu, promised(study, p)))


def _within(
    study: StoredStudy, points: Sequence[StoredPoint], budget: Budget, scale: float | None, dt: float
) -> StoredPoint:
    """Return the most exact of some points that keeps within a budget. Raises SceneError, which says the cheapest."""
    option = f"--{budget.text}"
    if study.solves and math.isinf(budget.step):
        raise SceneError(
            f"{option} needs a study of a motion; study {study.name!r} is of bodies at rest. Give "
            "--accuracy a percentage, such as 5%, or --budget a time, such as 2ms"
        )
    if scale is None:
        raise SceneError(
            f"{option}: the speed of this machine could not be measured; give --accuracy a percentage, "
            "such as 5%"
        )

    def cost(p: StoredPoint) -> float:  # in parts of the budget
        own = p.settings.get("dt", dt)
        step = 1.0 if study.solves else float(own) if isinstance(own, int | float) else dt
        return max(p.cpu * scale / budget.share, p.cpu * scale * step / budget.step)

    fast = [p for p in points if cost(p) <= 1.0]
    if not fast:
        least = min(points, key=cost)
        unit, of = (budget.share, "s of this machine for a simulated second")
        if math.isinf(unit):
            unit, of = budget.step, f"s of this machine for a {'solve' if study.solves else 'step'}"
        raise SceneError(
            f"{option}: no setting of study {study.name!r} takes less than {unit:g} {of}; the cheapest "
            f"takes {cost(least) * unit:.2g} s ({settings_text(least)}): allow more time"
        )
    return min(fast, key=lambda p: (promised(study, p), p.cpu))


def stays_stable(point: StoredPoint) -> bool:
    """Return whether the steps of a point stay stable on another body: implicit, or divided as that one needs."""
    scheme = SCHEMES[str(point.settings.get("inertia.scheme", auto.SCHEME.name))]
    divided = point.settings.get("inertia.substeps", "auto") == "auto"
    return not isinstance(scheme, ExplicitScheme) or (scheme.is_stable and divided)


def expected(study: StoredStudy, point: StoredPoint) -> tuple[float, ...]:
    """Return the relative errors to expect of a point: `margins` times its own, and what the reference may err."""
    shares = ((point.error, point.bound), *point.others)
    return tuple(
        factor * error + max(0.0, bound - error)
        for factor, (error, bound) in zip(margins(study.name, len(shares)), shares, strict=True)
    )


def promised(study: StoredStudy, point: StoredPoint) -> float:
    """Return the relative error that no quantity which a study promises is expected to exceed at a point."""
    return max(expected(study, point))


def measured(study: StoredStudy, point: StoredPoint) -> float:
    """Return the largest relative error that a study measured at a point, what its reference may err included."""
    return max(_measured(point))


def _measured(point: StoredPoint) -> tuple[float, ...]:
    return (point.bound, *(bound for _, bound in point.others))


def measured_words(study: StoredStudy, point: StoredPoint) -> str:
    """Return the error that a study measured at a point, for people."""
    error, others = percent(measured(study, point)), _other_cases(study)
    source = f"measured in the accuracy study {study.name}; not bounded for {others}"
    return f"error about {error} ({source}) of: {quantities(study)}"


def not_known(study: StoredStudy, strange: Sequence[str]) -> str:
    """Return that a study does not tell the error of a scene, since it has not seen what is `strange` in it."""
    return f"not known: study {study.name} was not made with {'; '.join(strange)}"


def _other_cases(study: StoredStudy) -> str:
    return "other poses" if study.solves else "other motions"


def quantities(study: StoredStudy) -> str:
    """Return what a study promises the error of, in words."""
    return "; ".join((study.quantity, *study.others))


def percent(error: float) -> str:
    """Return a relative error for people."""
    return f"{float(f'{100 * error:.2g}'):g} %"


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
        f"no accuracy study of scene {scene!r} where it {kind}; make one with `tripod study "
        f"{shlex.quote(scene)}`, then name its file with --study FILE"
    )


def study_of(scene: str, made: Scene, study: Path | None) -> StoredStudy:
    """Return the study in the file `study`, or the one that comes with tripod. Raises SceneError if none fits."""
    if study is None:
        return shipped(made, scene)
    found = read_study(study)
    check_fits(found, made, scene)
    return found


def check_fits(study: StoredStudy, made: Scene, scene: str) -> None:
    """Raise SceneError if a study that the user named is not of this scene, `made` from the one of this name."""
    if study.scene != made.name:
        raise SceneError(
            f"--study: the file is a study of scene {study.scene!r}, not of {made.name!r}; make one with "
            f"`tripod study {made.name!r}`"
        )
    given = [value for field, value in study.base.items() if field.partition(".")[0] == "inertia"]
    moved = given != ["off"] if given else load_scene(scene).inertia is not None
    if (moved and not study.solves) != (made.inertia is not None):
        kind = (
            "a motion, and the scene is static"
            if made.inertia is None
            else "static solves, and the scene moves"
        )
        raise SceneError(
            f"--study: the file is a study of {kind}; make one of this scene with `tripod study`"
        )


def outside(
    scene: str, study: StoredStudy, picked: Sequence[str], overrides: Sequence[str]
) -> tuple[str, ...]:
    """Return what is not as it was studied: overrides of the user, what the study shares, the scene's own file."""
    found, named = [], {word.partition("=")[0].strip() for word in overrides}
    made = load_scene(scene, [*picked, *overrides])
    for k, word in enumerate(overrides):
        field = word.partition("=")[0].strip()
        if field in study.base and holds(made, field, study.base[field]):
            continue
        try:
            other = load_scene(scene, [*picked, *overrides[:k], *overrides[k + 1 :]])
        except SceneError:  # the scene needs it
            other = None
        if other is None or differing(other, made):
            found.append(word)
    for field, value in study.base.items():
        if field not in INSIDE and field not in named and not holds(made, field, value):
            found += [f"{field} as it is here: the study has {word}" for word in words_of({field: value})]
    if study.studied and study.studied != studied(load_scene(scene), study.varied):
        found.append("the file of the scene, or a file that it names, as it is now")
    return tuple(found)


def unseen(scene: str, study: StoredStudy, made: Scene) -> tuple[str, ...]:
    """Return the fields in which a scene differs from the one that a study varied, those left out that it varied."""
    base = words_of({field: value for field, value in study.base.items() if field not in INSIDE})
    varied = {field for point in study.points for field in point.settings}
    return tuple(
        field
        for field in differing(load_scene(scene, base), made)
        if not {field, field.partition(".")[0]} & varied
    )


def differing(made: Scene, other: Scene) -> list[str]:
    """Return the fields in which two scenes differ, those left out that are free."""
    found = []
    for name in (f.name for f in fields(Scene) if f.name not in FREE):
        a, b = getattr(made, name), getattr(other, name)
        if name == "time_error" and "auto" not in (a and a.steps, b and b.steps):
            continue  # it tells, and leaves the motion as it is
        if is_dataclass(a) and is_dataclass(b):
            found += [f"{name}.{f.name}" for f in fields(a) if getattr(a, f.name) != getattr(b, f.name)]
        elif a != b:
            found.append(name)
    return [field for field in found if field not in INSIDE]


def holds(made: Scene, field: str, value: Value) -> bool:
    """Return whether a field of a scene has a value, which may be the text of an override: `off`, `500kPa`, `{a=1}`."""
    if isinstance(value, str) and NUMBERS.fullmatch(value):
        numbers = (word.split("=") for word in value[1:-1].split(", "))
        return all(holds(made, f"{field}.{name}", float(number)) for name, number in numbers)
    try:
        found: Any = reduce(getattr, field.split("."), made)
    except AttributeError:
        found = None
    if not isinstance(value, str) or value == found:
        return bool(found == value)
    if value == "off":
        return not found
    try:
        return scene_from_toml(scene_to_toml(made), words_of({field: value})) == made
    except SceneError:
        return False


def point_of(study: StoredStudy, scene: Scene) -> StoredPoint | None:
    """Return the point of a study whose settings, and whose base, are those of a scene; None if there is none."""
    if not all(holds(scene, field, value) for field, value in study.base.items() if field not in INSIDE):
        return None
    fitting = (p for p in study.points if all(holds(scene, f, v) for f, v in p.settings.items()))
    return next(fitting, None)


def settings_text(point: StoredPoint) -> str:
    """Return the settings of a point for people."""
    return ", ".join(words_of(_rounded(point.settings)))


def _rounded(settings: Mapping[str, Value]) -> dict[str, Value]:
    """Return settings with numbers as people write them: four digits, for texts only."""
    return {f: float(f"{v:.4g}") if isinstance(v, float) else v for f, v in settings.items()}


def changes(made: Scene, settings: Mapping[str, Value]) -> str:
    """Return in words which of these settings are not those of a scene."""
    changed = {f: v for f, v in settings.items() if not holds(made, f, v)}
    return ", ".join(words_of(_rounded(changed))) or "the scene as it is"


def _sentence(
    accuracy: str,
    study: StoredStudy,
    point: StoredPoint,
    changed: str,
    seconds: float | None,
    strange: Sequence[str],
) -> str:
    """Return the choice for people, on one line: what is set, what error that has, what time it takes."""
    unit = "solve" if study.solves else "simulated second"
    time = (
        f"{seconds:.2g} s of this machine for each {unit}"
        if seconds is not None
        else "time on this machine unknown"
    )
    wish = accuracy.strip() if accuracy.startswith("budget") else f"accuracy {accuracy.strip()}"
    made = f"{'quick ' if study.quick else ''}study {study.name}"
    error = f"error {not_known(study, strange)}" if strange else _error_words(study, point)
    return f"{wish}: {changed} ({made}); {error}; {time}"


def _error_words(study: StoredStudy, point: StoredPoint) -> str:
    """Return the error that a study measured at a point, and what it promises for other cases."""
    here, bound = percent(measured(study, point)), percent(promised(study, point))
    return f"error about {here} in the study, at most {bound} in {_other_cases(study)} ({quantities(study)})"
