"""Short forms of a scene written out: `[mesh]` with `[material]`, and `[springs]`, are its first bodies."""

from typing import TYPE_CHECKING

from tripod_sim.tables.bodies import Body

if TYPE_CHECKING:
    from tripod_sim.scene import Scene

FIRST, SECOND = "body", "springs"
"""Names of what the short form describes; where that is one body it has the first."""


def soft_bodies(scene: "Scene") -> tuple[Body, ...]:
    """Return the soft bodies of a scene, those of the short form first."""
    return (*_short(scene), *scene.body)


def field_of(scene: "Scene", number: int) -> str:
    """Return how a message names body `number`: nothing for the short form, else `body.0.` and so on."""
    first = len(_short(scene))
    return f"body.{number - first}." if number >= first else ""


def springs_alone(scene: "Scene") -> bool:
    """Return whether one body of springs is all, so that the compiled loops of `springs` can move it."""
    return scene.springs is not None and len(soft_bodies(scene)) == 1


def _short(scene: "Scene") -> tuple[Body, ...]:
    found = []
    if scene.mesh or scene.material:
        found.append(Body(FIRST, mesh=scene.mesh, material=scene.material, region=scene.region))
    if scene.springs:
        found.append(Body(SECOND if found else FIRST, springs=scene.springs))
    return tuple(found)
