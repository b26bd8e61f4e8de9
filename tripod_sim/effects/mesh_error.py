"""Effect: the error that the mesh makes of the effector's position, estimated while the scene runs."""

import math
from dataclasses import dataclass

from tripod_sim.effect import Described, Effect, Need
from tripod_sim.errors import SceneError
from tripod_sim.tables.actuators import actuator_tables
from tripod_sim.tables.fields import number
from tripod_sim.tables.materials import initial_young
from tripod_sim.tables.short_forms import discs_of, soft_bodies


@dataclass(frozen=True)
class MeshError:
    """The error that the mesh makes of the effector's position is estimated while the scene runs. Needs a clamp.

    Attributes:
        share: Of the CPU time of the steps, what estimates may take: there is a new one as soon as that allows it.
    """

    share: float = number(0.12, above=0, high=1e6)


SLIP = 2.4e-3
"""Least length sqrt(G / clamp.stiffness) over which a strip slips in its clamp for the error of the mesh to be told
[m], about half the thickness of the Tripod's sheet: at 2.5 mm 95 % of poses are told right, at 1.2 mm 73 %."""


def check(table: MeshError, scene: Described) -> None:
    """Raise SceneError if the error is asked for where nothing tells it."""
    bodies, discs = soft_bodies(scene), discs_of(scene)
    if not discs:
        raise SceneError(
            "mesh_error estimates the error of a disc, but effector is a point or a set; leave one of both out"
        )
    if not bodies[0].material or discs[0][2].name != bodies[0].name:
        raise SceneError(
            "mesh_error estimates the first body, with strips in the clamp; the effector is "
            f"{discs[0][0]}: make that body the first one"
        )
    if scene.platform:
        raise SceneError(
            "mesh_error and platform cannot be combined: the error of one body says nothing about a "
            "platform that several bodies carry; leave one out"
        )
    if others := ", ".join(kind for kind, i, _ in actuator_tables(scene) if not i):
        raise SceneError(
            f"mesh_error and {others} cannot be combined so far: the error of the mesh is told of servos and loads; "
            "leave one out"
        )
    material, stiffness = bodies[0].material, scene.clamp.stiffness
    shear = initial_young(material) / (2 + 2 * material.poisson)
    if stiffness > shear / SLIP**2:
        raise SceneError(
            f"mesh_error: clamp.stiffness is {stiffness:g} N/m⁴, so strips of this material slip over "
            f"{1000.0 * (shear / stiffness) ** 0.5:.2g} mm in their clamps. Below {1000.0 * SLIP:g} mm a "
            "fine mesh creases at the edge and gives no error: set clamp.stiffness to at most "
            f"{_rounded_down(shear / SLIP**2):g}"
        )


def _rounded_down(value: float) -> float:
    """Return a positive number with two digits, no larger than it is."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.floor(value / unit) * unit:.2g}")


EFFECT = Effect(
    MeshError,
    rank=190,
    rest=False,
    needs=(
        Need("effector", "the error is that of the position of the effector; add [effector]"),
        Need(
            "clamp",
            "at the edge of an ideal clamp the stress is singular, so no mesh has a known error; add [clamp]",
        ),
    ),
    check=check,
    modules=("mesh_error",),
    stages={"mesh_error.estimate.MeshError": {"follow": "mesh error"}},
    steps=("mesh error",),
    seldom=f"estimates take mesh_error.share ({MeshError.share:g} unless set) of the CPU time of the steps",
)
"""A mesh of its own beside the simulation, which `simulation.py` follows."""
