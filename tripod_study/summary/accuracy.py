"""What accuracy a scene has and what others cost, by the study that is stored of it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tripod_sim.errors import SceneError
from tripod_sim.scene import Scene
from tripod_study.accuracy.choice import (
    LOAD,
    asked,
    measured,
    measured_words,
    not_known,
    pick,
    point_of,
    promised,
    quantities,
    settings_text,
    study_of,
    unseen,
)
from tripod_study.accuracy.stored import StoredStudy
from tripod_study.front import front

WISHES = ("draft", "real-time", "5%", "1%", "reference")
"""What is offered, by the words of `--accuracy`."""

MOST_DOTS = 400
"""Points that are told of a study."""


@dataclass(frozen=True)
class Offer:
    """What an accuracy costs.

    Attributes:
        wish: As `--accuracy` takes it.
        settings: Of the point that serves it; empty where none does.
        measured: Relative error that the study measured; None where there is none, or of a scene that the study has not
            seen.
        bound: Relative error that is promised for other motions or poses; None likewise.
        seconds: Of this machine for a simulated second, or a solve [s]; None where this machine's speed is not known.
        why_not: Why there is none, in one sentence; empty where there is.
    """

    wish: str
    settings: str = ""
    measured: float | None = None
    bound: float | None = None
    seconds: float | None = None
    why_not: str = ""


@dataclass(frozen=True)
class AccuracyFigures:
    """What is known of the accuracy of a scene.

    Attributes:
        study: Its name; empty where there is none.
        quantity: What errors are of.
        size: What they are relative to [m]; None where that is not one length.
        solves: Whether costs are of static solves, not of simulated seconds.
        measured: Relative error of the scene as it is, measured by the study in its own motion, what its reference may
            err included; None where its settings are not in the study, or anything else is not as the study had it.
        bound: Relative error that is promised for other motions; None likewise.
        line: What is known of the error, for people.
        settings: Of the scene, as of an offer; empty where the study has no point with them.
        here_seconds: Of this machine, as the study has it [s]; None where that or the machine's speed is not known.
        offers: See `WISHES`.
        dots: Cost [s] and measured error of each point that worked.
        front: Those that no other point beats in both.
        scaled: Whether costs are of this machine; else they are of the study's.
    """

    study: str = ""
    quantity: str = ""
    size: float | None = None
    solves: bool = False
    measured: float | None = None
    bound: float | None = None
    line: str = ""
    settings: str = ""
    here_seconds: float | None = None
    offers: tuple[Offer, ...] = ()
    dots: tuple[tuple[float, float], ...] = ()
    front: tuple[tuple[float, float], ...] = ()
    scaled: bool = False


def accuracy_summary(
    source: str, scene: Scene, speed: float | None = None, own: Path | None = None
) -> AccuracyFigures:
    """Return what is known of the accuracy of a scene.

    Args:
        source: Its name or the path of its file; studies are stored of shipped scenes.
        scene: As it is simulated.
        speed: CPU time of the product that studies are calibrated with, on this machine [s]; None if it is not known.
        own: File of a study; None: the one that comes with tripod.
    """
    try:
        study = study_of(source, scene, own)
    except SceneError as error:
        return AccuracyFigures(line=f"not known: {error}")
    scale = speed / study.calibration if speed and study.calibration else None
    factor = scale or 1.0
    strange = unseen(source, study, scene)
    point = None if strange else point_of(study, scene)
    if strange:
        line = not_known(study, strange)
    elif point:
        line = measured_words(study, point)
    else:
        line = f"not known: study {study.name} has no point with these settings"
    dots = sorted((p.cpu * factor, measured(study, p)) for p in study.points)
    return AccuracyFigures(
        study=study.name,
        quantity=quantities(study),
        size=study.size,
        solves=study.solves,
        measured=measured(study, point) if point else None,
        bound=promised(study, point) if point else None,
        line=line,
        settings=settings_text(point) if point else "",
        here_seconds=point.cpu * scale if point and scale else None,
        offers=tuple(_offer(wish, study, scene, scale, seen=not strange) for wish in WISHES),
        dots=tuple(dots[:MOST_DOTS]),
        front=tuple(dots[i] for i in front([error for _, error in dots], [seconds for seconds, _ in dots])),
        scaled=scale is not None,
    )


def finer(figures: AccuracyFigures) -> str | None:
    """Return the largest percentage among the offers that promises a smaller error than the scene has; None: none."""
    now = figures.measured if figures.bound is None else figures.bound
    for offer in figures.offers:
        if offer.wish.endswith("%") and offer.bound is not None and now is not None and offer.bound < now:
            return offer.wish
    return None


def _offer(wish: str, study: StoredStudy, scene: Scene, scale: float | None, *, seen: bool) -> Offer:
    try:
        point = pick(study, asked(wish), scale)
    except SceneError as error:
        return Offer(wish, why_not=str(error).partition(": ")[2])
    seconds = point.cpu * scale if scale else None
    here, bound = (measured(study, point), promised(study, point)) if seen else (None, None)
    return Offer(wish, settings_text(point), here, bound, seconds)


def as_table(figures: AccuracyFigures) -> dict[str, Any]:
    """Return the figures as JSON has them, with the share of real time that `real-time` may take."""
    return {
        **{k: v for k, v in vars(figures).items() if k != "offers"},
        "offers": [vars(offer) for offer in figures.offers],
        "load": LOAD,
    }
