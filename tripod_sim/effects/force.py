"""Effect: forces that are commanded, on sets of nodes."""

import numpy as np

from tripod_sim.effect import Described, Draft, Effect
from tripod_sim.errors import SceneError
from tripod_sim.tables.actuators import Force, check_actuators
from tripod_sim.tables.sets import Load


def check(tables: tuple[Force, ...], scene: Described) -> None:
    """Raise SceneError if a force is described wrongly."""
    check_actuators(scene)
    for i, table in enumerate(tables):
        if not any(table.direction):
            raise SceneError(
                f"force.{i}.direction is {table.direction}; a direction cannot be zero, give one such as [0, 0, 1]"
            )


def act(tables: tuple[Force, ...], draft: Draft) -> None:
    """Add the forces, as terms with a commanded coordinate."""
    from tripod_sim.forces.commanded_force import CommandedForce
    from tripod_sim.forces.set_loads import set_load

    solids = [body.among(draft.assembly.nodes) for body in draft.assembly.bodies if body.solid]
    for i, table in enumerate(tables):
        along = np.array(table.direction) / np.linalg.norm(table.direction)
        unit = Load(table.set, force=tuple(along.tolist()), share=table.share)
        shares = set_load(unit, f"force.{i}", draft.sets, solids, len(draft.rest)).force
        draft.add_actuator(CommandedForce(shares, draft.rest), table.actuator)


EFFECT = Effect(
    Force,
    rank=67,
    several=True,
    check=check,
    modules=("forces.commanded_force",),
    words=('force=[{name="push", set="all", direction=[0.0, 0.0, 1.0], range=[-1.0, 1.0]}]',),
    act=act,
)
