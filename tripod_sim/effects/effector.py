"""Effect: the effector, a rigid disc in the centre of the piece or a point that is observed."""

import numpy as np

from tripod_sim.constraints.held import Holding
from tripod_sim.effect import Described, Draft, Effect
from tripod_sim.errors import SceneError
from tripod_sim.tables.bodies import Body
from tripod_sim.tables.robot import Effector
from tripod_sim.tables.short_forms import effectors_of


def check(_: Effector, scene: Described) -> None:
    """Raise SceneError where an effector is described twice, or one that is observed is not the only one."""
    found = effectors_of(scene)
    for field, table, _body in found:
        if table.is_disc:
            continue
        if table.point is not None and table.set:
            raise SceneError(f"{field} has both point and set; an effector is one of them: leave one out")
        if others := [other for other, _, _ in found if other != field] or ["platform"] * bool(
            scene.platform
        ):
            raise SceneError(
                f"{field} is a point or a set, and the scene also has {others[0]}, which is an effector too; "
                "a scene has one effector: leave one out"
            )


def hold(effector: Effector, draft: Draft) -> None:
    """Make the nodes of each disc rigid, and find the point that is observed in the undeformed body."""
    from tripod_sim.robot.disc import effector_disc

    own = {body.table.name: body.nodes for body in draft.assembly.bodies}
    for field, table, body in draft.model.effectors:
        if not table.is_disc:
            _observe(field, table, body, draft)
            continue
        nodes, (position, turn) = own[body.name], body.pose
        disc = nodes[effector_disc((draft.rest[nodes] - position) @ turn, table, field)]
        draft.rigid.append(Holding(field, disc))


def _observe(field: str, table: Effector, body: Body, draft: Draft) -> None:
    """Give the draft the point that is observed. Raises SceneError."""
    from tripod_sim.mesh.embedding import at_nodes
    from tripod_sim.robot.observed import ObservedPoint

    if table.point is not None:
        of = draft.assembly.body_named(body.name, field)
        draft.observed = ObservedPoint(of.embedded(np.array([table.point]), draft.rest, f"{field}.point"))
    else:
        draft.observed = ObservedPoint(at_nodes(draft.sets.nodes(table.set, f"{field}.set")))


EFFECT = Effect(
    Effector,
    rank=110,
    there=lambda scene: bool(effectors_of(scene)),
    check=check,
    modules=("robot.disc",),
    hold=hold,
)
