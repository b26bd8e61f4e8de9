"""Scene to model: short forms are written out here, once, and each effect says what of it others have to know."""

from tripod_sim.effects import EFFECTS, has, table_of
from tripod_sim.model import Model
from tripod_sim.scene.scene import Scene
from tripod_sim.tables.fields import unusual
from tripod_sim.tables.short_forms import (
    effectors_of,
    field_of,
    joints_of,
    rigids_of,
    servo_tables,
    soft_bodies,
)


def lowered(scene: Scene) -> Model:
    """Return what `scene` describes, written out."""
    bodies = soft_bodies(scene)
    effects = tuple((effect, table_of(scene, name)) for name, effect in EFFECTS.items() if has(scene, name))
    model = Model(
        dt=scene.dt,
        solver=scene.solver,
        bodies=tuple((field_of(scene, k), body) for k, body in enumerate(bodies)),
        rigid=tuple(rigids_of(scene)),
        obstacles=scene.obstacles,
        joints=joints_of(scene),
        effectors=tuple(effectors_of(scene)),
        posed=any(body.name == bodies[0].name for _, _, body in servo_tables(scene)),
        platforms=scene.platform,
        ties=scene.tie,
        sets=scene.set,
        markers=scene.marker,
        effects=effects,
        doubts=tuple(unusual(scene)),
    )
    for effect, table in effects:
        if effect.lower:
            model = effect.lower(table, scene, model)
    return model
