"""Effect: forces on sets of nodes, or displacements of them, that are commanded."""

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tripod_sim.effect import Described, Draft, Effect
from tripod_sim.errors import SceneError
from tripod_sim.tables.actuators import Force, check_actuators
from tripod_sim.tables.sets import Load

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.forces.actuator import ActuatorTerm


def check(tables: tuple[Force, ...], scene: Described) -> None:
    """Raise SceneError if a force is described wrongly."""
    check_actuators(scene)
    for i, table in enumerate(tables):
        if not any(table.direction):
            raise SceneError(
                f"force.{i}.direction is {table.direction}; a direction cannot be zero, give one such as [0, 0, 1]"
            )


def act(tables: tuple[Force, ...], draft: Draft) -> None:
    """Add them, as terms with a commanded coordinate."""
    from tripod_sim.forces.actuator import EffortWatch
    from tripod_sim.forces.commanded_force import CommandedDisplacement, CommandedForce
    from tripod_sim.forces.set_loads import set_load

    solids = [body.among(draft.assembly.nodes) for body in draft.assembly.bodies if body.solid]
    for i, table in enumerate(tables):
        along = np.array(table.direction) / np.linalg.norm(table.direction)
        unit = Load(table.set, force=tuple(along.tolist()), mass=1.0, share=table.share)
        loads = set_load(unit, f"force.{i}", draft.sets, solids, len(draft.rest))
        term: ActuatorTerm = CommandedForce(loads.force, draft.rest)
        if table.command == "displacement":
            term = CommandedDisplacement(along, loads.inert, draft.rest, table.stiffness)
        draft.add_actuator(term, table.actuator)
        if most := table.actuator.effort_max:
            draft.watches.append(EffortWatch(
                partial(getattr, term, "effort"), -most, most,
                f"force.{i}: the force of {table.name} is {{:.3g}} N, beyond force_max, {most:g} N: move less, or "
                "allow more",
            ))  # fmt: skip


EFFECT = Effect(
    Force,
    rank=67,
    several=True,
    check=check,
    modules=("forces.commanded_force",),
    words=('force=[{name="push", set="all", direction=[0.0, 0.0, 1.0], range=[-1.0, 1.0]}]',),
    act=act,
)
