"""Rigid bodies that pass through something at the start: named, or lifted out."""

from dataclasses import replace

from tripod_host.arrays import FloatArray
from tripod_sim.constraints.groups import RigidMotion
from tripod_sim.contact.rigid_set import RigidSet
from tripod_sim.contact.start import height_that_frees, passing
from tripod_sim.errors import SceneError
from tripod_sim.mesh.surfaces import Part


def overlaps(one: Part, other: Part) -> bool:
    """Return whether two bodies where they are, at most one of them soft, pass through each other."""
    return bool(passing(one, [other]).size or passing(other, [one]).size)


def place_bodies(
    rigid: RigidSet, others: list[tuple[str, Part]], up: FloatArray, distance: float, *, lifts: bool
) -> None:
    """Refuse rigid bodies that pass through something where they begin; or lift them, changing `rigid.start`.

    Args:
        rigid: The bodies.
        others: What else there is, by name.
        up: Unit vector.
        distance: Contact distance [m].
        lifts: Whether to lift, one body after the other.

    Raises:
        SceneError: naming both, or no lift suffices.
    """
    placed = list(others)
    for k, field in enumerate(rigid.fields):
        centre, here = rigid.start.centres[k], rigid.placed(k, rigid.start)

        def hit(part: Part) -> str:
            return next((name for name, other in placed if overlaps(part, other)), "")

        if not lifts and (name := hit(here)):
            raise SceneError(
                f"{field} passes through {name} at the start, {field}.position is "
                f"{tuple(centre.round(6).tolist())} m; move one of them, or set contact.start = 'lift'"
            )
        if lifts:

            def clear(height: float, part: Part = here) -> bool:
                return not hit(replace(part, vertices=part.vertices + height * up))

            height = height_that_frees(clear, distance, f"{field} from what it passes through")
            centre += height * up
            here = replace(here, vertices=here.vertices + height * up)
        placed.append((field, here))


def check_beside(rigid: RigidSet, soft: Part) -> None:
    """Raise SceneError if a rigid body passes through the soft one, where both begin."""
    for k, field in enumerate(rigid.fields):
        if overlaps(rigid.placed(k, rigid.start), soft):
            raise SceneError(
                f"{field} passes through the soft body at the start, where servos.angles bring it; move "
                f"{field}, or change servos.angles"
            )


def put_back(rigid: RigidSet, state: RigidMotion, number: int, beside: list[tuple[str, Part]]) -> None:
    """Put a body to where it begins, at rest, others staying where they are.

    Args:
        rigid: The bodies.
        state: Where they are; changed.
        number: Of the body.
        beside: What else may be there now, by name.

    Raises:
        SceneError: something is there now; `state` is as it was.
    """
    here = rigid.placed(number, rigid.start)
    others = [(field, rigid.placed(k, state)) for k, field in enumerate(rigid.fields) if k != number]
    for name, other in others + beside:
        if overlaps(here, other):
            raise SceneError(
                f"{rigid.fields[number]} cannot return to its start: {name} is there now; move that away "
                "first, or reset all"
            )
    for of, begin in zip(state, rigid.start, strict=True):
        of[number] = begin[number]
