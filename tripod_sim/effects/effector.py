"""Effect: the effector, a rigid disc in the centre of the piece or a point that is observed."""

from typing import TYPE_CHECKING

import numpy as np

from tripod_sim.constraints.held import Holding
from tripod_sim.effect import Described, Draft, Effect
from tripod_sim.errors import SceneError
from tripod_sim.tables.bodies import Body
from tripod_sim.tables.robot import Effector, EffectorPoint
from tripod_sim.tables.short_forms import effectors_of

if TYPE_CHECKING:
    from tripod_sim.robot.observed import ObservedPoint


def check(_: Effector, scene: Described) -> None:
    """Raise SceneError where an effector is described twice, or one that is observed is not the only one."""
    found = effectors_of(scene)
    for field, table, _body in found:
        _check_more(field, table)
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


def _check_more(field: str, table: Effector) -> None:
    """Raise SceneError where a further place has no name of its own, or is not one of point and set."""
    names = [place.name for place in table.more]
    for i, place in enumerate(table.more):
        here = f"{field}.more.{i}"
        if not place.name.isidentifier() or names.count(place.name) > 1:
            raise SceneError(f'{here}.name is {place.name!r}; give each a word of its own, such as "middle"')
        if (place.point is None) is not bool(place.set):
            raise SceneError(f"{here} has to have either point or set; give one of them")


def hold(effector: Effector, draft: Draft) -> None:
    """Make the nodes of each disc rigid, and find the point that is observed in the undeformed body."""
    from tripod_sim.robot.disc import effector_disc

    own = {body.table.name: body.nodes for body in draft.assembly.bodies}
    for field, table, body in draft.model.effectors:
        if field == draft.model.effectors[0][0]:
            draft.places = {
                p.name: _observed(f"{field}.more.{i}", p, body, draft) for i, p in enumerate(table.more)
            }
        if not table.is_disc:
            draft.observed = _observed(field, table, body, draft)
            continue
        nodes, (position, turn) = own[body.name], body.pose
        disc = nodes[effector_disc((draft.rest[nodes] - position) @ turn, table, field)]
        draft.rigid.append(Holding(field, disc))


def _observed(field: str, table: Effector | EffectorPoint, body: Body, draft: Draft) -> "ObservedPoint":
    """Return what is observed. Raises SceneError."""
    from tripod_sim.mesh.embedding import at_nodes
    from tripod_sim.robot.observed import ObservedPoint

    if table.point is not None:
        of = draft.assembly.body_named(body.name, field)
        return ObservedPoint(of.embedded(np.array([table.point]), draft.rest, f"{field}.point"))
    return ObservedPoint(at_nodes(draft.sets.nodes(table.set, f"{field}.set")))


EFFECT = Effect(
    Effector,
    rank=110,
    there=lambda scene: bool(effectors_of(scene)),
    check=check,
    modules=("robot.disc",),
    hold=hold,
)
