"""Effect: a rigid disc in the centre of the piece."""

from tripod_sim.constraints.held import Holding
from tripod_sim.effect import Draft, Effect
from tripod_sim.tables.robot import Effector
from tripod_sim.tables.short_forms import discs_of


def hold(effector: Effector, draft: Draft) -> None:
    """Make the nodes of each disc rigid."""
    from tripod_sim.robot.disc import effector_disc

    own = {body.table.name: body.nodes for body in draft.assembly.bodies}
    for field, table, body in draft.model.discs:
        nodes, (position, turn) = own[body.name], body.pose
        disc = nodes[effector_disc((draft.rest[nodes] - position) @ turn, table, field)]
        draft.rigid.append(Holding(field, disc))


EFFECT = Effect(
    Effector, rank=110, there=lambda scene: bool(discs_of(scene)), modules=("robot.disc",), hold=hold
)
