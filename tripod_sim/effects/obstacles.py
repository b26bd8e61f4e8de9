"""Effect: surfaces that stand still."""

from tripod_sim.effect import Described, Effect
from tripod_sim.errors import SceneError, shown
from tripod_sim.tables.bodies import SHAPES, Obstacle, Rigid
from tripod_sim.tables.fields import check_unit
from tripod_sim.tables.short_forms import contact_of


def check_source(table: Rigid | Obstacle, field: str) -> None:
    """Raise SceneError if a shape from a file has no file, or another one has. `field` names the table."""
    from tripod_sim.shapes import fields_of

    if "source" in fields_of(table.shape):
        if "." not in table.source:
            raise SceneError(
                f"{field}.source is {shown(table.source)}; for shape {table.shape!r} allowed: the path of an OBJ or "
                "STL file"
            )
    elif table.source:
        from_file = " or ".join(repr(name) for name in SHAPES if "source" in fields_of(name))
        raise SceneError(
            f"{field}.source is {shown(table.source)}, but {field}.shape is {table.shape!r}; leave it out, or choose "
            f"shape {from_file}"
        )


def check(tables: tuple[Obstacle, ...], scene: Described) -> None:
    """Raise SceneError if nothing touches them, or an orientation is none."""
    if not contact_of(scene):
        raise SceneError("obstacles need contact, without which nothing touches them; add [contact]")
    for i, obstacle in enumerate(tables):
        check_source(obstacle, f"obstacles.{i}")
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
