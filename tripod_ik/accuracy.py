"""The cheapest mesh for an accuracy of inverse kinematics, by its study: the pose that a robot then takes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from tripod_ik.tracker_settings import Goal
from tripod_sim.errors import SceneError
from tripod_sim.scene.file import load_scene
from tripod_study.accuracy.choice import Choice, asked, chosen_from
from tripod_study.accuracy.machine import product_time
from tripod_study.accuracy.stored import StoredStudy, Value, read_study, stored_studies

BESIDE = ("ik", "robot")
"""Tables of the study that are none of a scene. Its points that stop early save time; what is asked once is solved to
the end, so that the accuracy is the mesh's."""

SLIDE = 0.035
"""Inward shift of the servo bodies in the study [m]."""


def choose_model(
    scene: str,
    accuracy: str,
    overrides: Sequence[str] = (),
    *,
    study: Path | None = None,
    goal: Goal = Goal.POSITION,
    slide: float = SLIDE,
    speed: Callable[[], float | None] = product_time,
) -> Choice:
    """Return the setting of the scene that inverse kinematics solves, see `tripod_study.accuracy.choice.choose`.

    Raises:
        SceneError: anything wrong with the input, no study of the scene, no point that is so exact.
    """
    wish, made = asked(accuracy), load_scene(scene, overrides)
    path = study or next(path for path in stored_studies() if path.stem == "ik")
    found = read_study(path)
    if not any(field.startswith("ik.") for point in found.points for field in point.settings):
        raise SceneError(
            f"--study: {found.name!r} is not a study of inverse kinematics; make one with `tripod study ik`"
        )
    if found.scene != made.name:
        raise SceneError(
            f"--accuracy: the study of inverse kinematics is of scene {found.scene!r}, not of "
            f"{made.name!r}. Leave --accuracy out; where the scene has a clamp, --set mesh_error={{}} "
            "estimates the error"
        )
    strange = [f"--goal {goal}"] * (goal is not Goal.POSITION) + [f"--slide {slide:g}"] * (slide != SLIDE)
    return chosen_from(scene, made, _of_scene(found), accuracy, wish, overrides, speed, strange)


def _of_scene(study: StoredStudy) -> StoredStudy:
    """Return a study whose points have the settings of a scene alone."""

    def own(settings: Mapping[str, Value]) -> dict[str, Value]:
        return {field: v for field, v in settings.items() if field.partition(".")[0] not in BESIDE}

    return replace(
        study, points=tuple(replace(point, settings=own(point.settings)) for point in study.points)
    )
