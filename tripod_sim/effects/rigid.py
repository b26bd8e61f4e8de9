"""Effect: rigid bodies, beside soft ones or alone."""

from tripod_sim.effect import Described, Effect, Need
from tripod_sim.effects.obstacles import check_source
from tripod_sim.tables.bodies import Rigid
from tripod_sim.tables.fields import check_unit


def check(tables: tuple[Rigid, ...], scene: Described) -> None:
    """Raise SceneError if a body is described wrongly."""
    for i, body in enumerate(tables):
        check_source(body, f"rigid.{i}")
        check_unit(f"rigid.{i}.orientation", body.orientation)


EFFECT = Effect(
    Rigid,
    rank=170,
    several=True,
    rigid=True,
    rest=False,
    needs=(Need("contact", "without it nothing touches the bodies; add [contact]"),),
    check=check,
    modules=(
        "contact.rigid_bodies",
        "contact.rigid_build",
        "contact.rigid_set",
        "contact.rigid_start",
    ),
    words=("rigid=[{position=[0.0, 0.0, 1.0]}]",),
)
