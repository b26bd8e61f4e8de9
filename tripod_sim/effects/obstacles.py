"""Effect: surfaces that stand still."""

from tripod_sim.effect import Described, Effect
from tripod_sim.effects.contact import contact_of
from tripod_sim.errors import SceneError
from tripod_sim.tables.bodies import Obstacle
from tripod_sim.tables.fields import check_unit


def check(tables: tuple[Obstacle, ...], scene: Described) -> None:
    """Raise SceneError if nothing touches them, or an orientation is none."""
    if not contact_of(scene):
        raise SceneError("obstacles need contact, without which nothing touches them; add [contact]")
    for i, obstacle in enumerate(tables):
        check_unit(f"obstacles.{i}.orientation", obstacle.orientation)


EFFECT = Effect(
    Obstacle,
    rank=160,
    several=True,
    rigid=True,
    rest=False,
    check=check,
)
"""Surfaces among those that contact is built of, no code of their own."""
