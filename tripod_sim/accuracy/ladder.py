"""What a scene may come down to while it runs: the settings of its study that cost less, the most exact first."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from tripod_sim.accuracy.choice import (
    DRAFT,
    changes,
    check_fits,
    outside,
    point_of,
    promised,
    shipped,
    stays_stable,
)
from tripod_sim.accuracy.machine import product_time
from tripod_sim.accuracy.stored import StoredPoint, StoredStudy, read_study
from tripod_sim.effects.contact import contact_of
from tripod_sim.errors import SceneError
from tripod_sim.scene import Scene
from tripod_sim.scene_file import load_scene, words_of
from tripod_sim.scene_short import joints_of
from tripod_sim.study.front import front

SETTINGS = ("mesh", "material", "clamp", "inertia", "dt", "solver", "ball")
"""Tables that may change under a scene that runs; what else it has stays."""

SHAPE = ("mesh", "clamp")
"""Those of them that change which nodes there are, or where they rest."""

STEP = 1.25
"""What a rung costs at least, over the next cheaper one: less is not worth a change."""


ASKED = "the settings asked for"


@dataclass(frozen=True)
class Rung:
    """A setting.

    Attributes:
        words: Overrides of the scene, all of them; those of the setting come last.
        cost: CPU time of a simulated second, or of a solve, in the study's own unit.
        error: To expect, relative; None where the study does not tell it of this scene.
        text: The settings, for people.
    """

    words: tuple[str, ...]
    cost: float
    error: float | None
    text: str


def ladder(
    source: str,
    words: Sequence[str],
    *,
    cost: float,
    study: Path | None = None,
    speed: Callable[[], float | None] = product_time,
) -> tuple[Rung, ...]:
    """Return the scene as it is, then what is cheaper, each rung more so than the last, none less exact than `draft`.

    Args:
        source: Name of the scene or path of its file.
        words: Overrides that it runs with.
        cost: CPU time of this machine for a simulated second of it [s]; asked only where the study has no such point.
        study: File of a study; None: the one that comes with tripod.
        speed: See `accuracy.choice.choose`; called likewise only then.

    Raises:
        SceneError: nothing cheaper is known, or the scene cannot change while it runs; the message says why.
    """
    made = load_scene(source, words)
    if why := rigid(made):
        raise SceneError(f"its settings cannot change while it runs: {why}")
    found = read_study(study) if study else shipped(made, source)
    check_fits(found, made, source)
    here = point_of(found, made)
    if here:
        rungs = [Rung(tuple(words), here.cpu, _error(source, found, here, words), ASKED)]
    elif not found.solves and found.calibration and (product := speed()):
        rungs = [Rung(tuple(words), cost * found.calibration / product, None, ASKED)]
    else:
        raise SceneError(f"study {found.name} has no point with these settings")
    stable = list(filter(stays_stable, found.points))
    best = front([promised(found, p) for p in stable], [p.cpu for p in stable])
    for point in (stable[i] for i in reversed(best)):
        if point.cpu * STEP > rungs[-1].cost or promised(found, point) > DRAFT:
            continue
        setting = tuple(words_of(point.settings))
        try:
            other = load_scene(source, (*words, *setting))
        except SceneError:  # what the user has set does not go with it
            continue
        if follows(made, other):
            error = _error(source, found, point, words)
            rungs.append(Rung((*words, *setting), point.cpu, error, changes(made, point)))
    if len(rungs) == 1:
        raise SceneError(f"study {found.name} has nothing cheaper that it could go on with")
    return tuple(rungs)


def rigid(scene: Scene) -> str:
    """Return why the settings of a scene cannot change while it runs, empty if they can."""
    for name in ("rigid", "platform", "body", "time_error", "prescribed"):
        if getattr(scene, name):
            return f"it has [{name}]"
    return "it has contact" if contact_of(scene) else ""


def follows(scene: Scene, other: Scene) -> bool:
    """Return whether a scene can go on with the settings of another.

    One whose nodes stay keeps all its state. Where they change, servos have to say where the body rests.
    """
    changed = {f.name for f in fields(Scene) if getattr(scene, f.name) != getattr(other, f.name)}
    if not changed <= {*SETTINGS, "description"} or not changed:
        return False
    if bool(scene.inertia) != bool(other.inertia):
        return False
    return joints_of(scene) is not None or not changed & set(SHAPE)


def _error(source: str, study: StoredStudy, point: StoredPoint, words: Sequence[str]) -> float | None:
    """Return the error to expect of a point; None where something else of the scene is not as the study has it."""
    others = [w for w in words if w.partition("=")[0].strip() not in point.settings]
    strange = outside(source, study, words_of(point.settings), others)
    return None if strange else promised(study, point)
