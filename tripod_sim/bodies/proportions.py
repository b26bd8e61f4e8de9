"""Inputs that are out of proportion to a body: what strains it beyond what any solver can follow, found before a step.

Each is a strain, a number without a unit: what an input would do to a body of the given stiffness, size and mass. The
energy of a body that is stretched to twice its length is about U = E V, of springs the sum of k l²; waves run through
it at c = sqrt(U / M).
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.bodies.assembly import SoftBody
from tripod_sim.effect import Draft
from tripod_sim.errors import Doubt
from tripod_sim.mesh.solid_mesh import solid_volumes
from tripod_sim.tables.bodies import Material
from tripod_sim.tables.materials import initial_young

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.constraints.prescribed import Motion

MOST = 1.0
"""Strain from which on an input is out of proportion: the body would be twice as long."""


def out_of_proportion(draft: Draft, velocities: FloatArray | None) -> tuple[Doubt, ...]:
    """Return which inputs are out of proportion to the soft bodies of a scene, one sentence each.

    Args:
        draft: Of the simulation, built.
        velocities: Of nodes at the start [m/s], shape (n, 3); None where nothing moves then.
    """
    found = list[str]()
    for body in draft.assembly.bodies:
        found += _loads(draft, body)
        if draft.model.scheme:
            found += _speeds(draft, body, velocities)
    return tuple(Doubt(text) for text in dict.fromkeys(found))


def _loads(draft: Draft, body: SoftBody) -> Iterator[str]:
    """Yield which loads strain a body too much."""
    energy, length = _stiffness(body), float(np.ptp(body.mesh.nodes, axis=0).max())
    gravity, dead = draft.model.gravity, draft.dead
    forces = {}
    if gravity:
        size = float(np.linalg.norm(gravity))
        forces[f"gravity.acceleration of {size:.4g} m/s²"] = size * float(draft.load[body.nodes].sum())
    if dead is not None:
        force = float(np.linalg.norm(dead[body.nodes], axis=1).sum())
        forces[f"the load of {force:.4g} N"] = force
    for name, force in forces.items():
        if (strain := force * length / energy) > MOST:
            yield (
                f"{name} would stretch {_name(body)} to about {1 + strain:.2g} times its length: check it, "
                "the stiffness and the mass, and that lengths are in metres"
            )


def _speeds(draft: Draft, body: SoftBody, velocities: FloatArray | None) -> Iterator[str]:
    """Yield what moves a part of a body so fast against the rest that it tears."""
    mass = float(draft.inert[body.nodes].sum())
    waves = float(np.sqrt(_stiffness(body) / mass)) if mass > 0 else np.inf
    speeds = {}
    if velocities is not None:
        spread = float(np.linalg.norm(np.ptp(velocities[body.nodes], axis=0)))
        speeds["initial_velocity moves parts of"] = spread
    for i, motion in enumerate(draft.prescribed.motions if draft.prescribed else ()):
        if not _is_all(motion.nodes, body.nodes):
            speeds[f"prescribed.{i} moves a part of"] = _fastest(motion, body.nodes)
    for name, speed in speeds.items():
        if speed > MOST * waves:
            yield (
                f"{name} {_name(body)} at {speed:.3g} m/s, faster than waves travel in it ({waves:.2g} m/s): "
                "no dt can compute that; slow the motion down"
            )


def _is_all(nodes: IndexArray, body: IndexArray) -> bool:
    return bool(np.isin(body, nodes).all())


def _fastest(motion: "Motion", body: IndexArray) -> float:
    """Return the largest speed of the nodes of a body that a motion moves [m/s]."""
    times = np.unique(np.concatenate([motion.move.times, motion.turn.times]))
    own = np.isin(motion.nodes, body)
    if len(times) < 2 or not own.any():
        return 0.0
    places = np.array([motion.places(t)[own] for t in times])
    return float((np.linalg.norm(np.diff(places, axis=0), axis=2).max(axis=1) / np.diff(times)).max())


def _stiffness(body: SoftBody) -> float:
    """Return U [J], infinite for springs without stiffness: nothing is out of proportion to them."""
    if body.net:
        energy = float((body.net.stiffness * body.net.rest_length**2).sum())
        return energy or np.inf
    assert body.solid
    volume = float(solid_volumes(body.solid).sum())
    return initial_young(body.table.material or Material()) * volume


def _name(body: SoftBody) -> str:
    return f"body {body.table.name!r}" if body.field else "the body"
