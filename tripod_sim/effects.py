"""The effects by name: the modules that only scenes with them need, and how to switch them on with defaults.

What a scene does not name is not imported, allocates nothing and has no stage of a step (docs/effects.md).
"""

from dataclasses import dataclass
from types import UnionType
from typing import get_args, get_type_hints

from tripod_sim.scene import EFFECTS, Scene


@dataclass(frozen=True)
class Effect:
    """One effect.

    Attributes:
        modules: Modules or packages below `tripod_sim` that no other effect needs: the code works without their files
            wherever no scene names the effect.
        stages: Names, or beginnings of names, of the stages of a step that only this effect has.
        words: Overrides that switch it on with defaults, as `tripod run --set` takes them; its name alone if empty.
    """

    modules: tuple[str, ...] = ()
    stages: tuple[str, ...] = ()
    words: tuple[str, ...] = ()


TABLE: dict[str, Effect] = {
    "gravity": Effect(("forces.gravity",), ("gravity",)),
    "inertia": Effect(
        (
            "forces.anchor",
            "integrators.schemes",
            "integrators.stage",
            "integrators.explicit",
            "integrators.explicit_kernels",
            "integrators.force_kernels",
            "integrators.frequency",
        ),
        ("inertia", "stability limit", "explicit parts"),
    ),
    "damping": Effect(("forces.rayleigh",), ("damping",)),
    "fixed": Effect(),  # nodes of a box or set: one more group of nodes, no code of its own
    "prescribed": Effect(
        ("constraints.prescribed",),
        words=('prescribed=[{set="all", axes="x", move="0: 0,0,0; 1: 0.001,0,0"}]',),
    ),
    "load": Effect(
        ("forces.set_loads",), words=('load=[{set="all", force=[0.01, 0.0, 0.0], share="even"}]',)
    ),
    "initial_velocity": Effect(
        ("start_velocities",), words=("initial_velocity=[{velocity=[0.01, 0.0, 0.0]}]",)
    ),
    "servos": Effect(("robot.arms",), ("servo arms",)),
    "servo_dynamics": Effect(("robot.servo",), ("servo dynamics",)),
    "clamp": Effect(("robot.clamp", "forces.foundation"), ("clamp",)),
    "effector": Effect(("robot.disc",)),
    "strain_limit": Effect(("forces.strain_bound", "integrators.strain_limit"), ("strain limit",)),
    "maze": Effect(("maze",)),
    "ball": Effect(("ball", "forces.loads"), ("ball",)),
    "contact": Effect(("contact",), ("contact",), ("contact={self_contact=true}",)),
    "obstacles": Effect(),  # surfaces among those that contact is built of, no code of their own
    "rigid": Effect(
        (
            "contact.rigid_bodies",
            "contact.rigid_build",
            "contact.rigid_set",
            "contact.rigid_shapes",
            "contact.rigid_start",
        ),
        words=("rigid=[{position=[0.0, 0.0, 1.0]}]",),
    ),
    "time_error": Effect(
        (
            "integrators.time_error",
            "integrators.time_error_kernels",
            "integrators.auto_steps",
            "integrators.doubling",
            "integrators.factor_store",
            "integrators.way_kernels",
            "integrators.way_steps",
            "springs.automatic",
            "springs.automatic_kernels",
        ),
        ("time error",),
    ),
    "mesh_error": Effect(("mesh_error", "forces.support"), ("mesh error",)),
    "sleep": Effect(("integrators.sleep",), ("sleep",)),
}
"""Every name of `EFFECTS`, and nothing else."""


def named(scene: Scene) -> list[str]:
    """Return the effects that a scene names."""
    return [name for name in EFFECTS if getattr(scene, name)]


def absent(scene: Scene) -> list[str]:
    """Return the effects that a scene does not name."""
    return [name for name in EFFECTS if not getattr(scene, name)]


def words(name: str) -> tuple[str, ...]:
    """Return the overrides that switch an effect on with its defaults."""
    return (TABLE[name].words if name in TABLE else ()) or (f"{name}={{}}",)


def meaning(name: str) -> str:
    """Return in one sentence what an effect is, from its table's docstring."""
    hint = get_type_hints(Scene)[name]
    kinds = [a for a in get_args(hint) if isinstance(a, type) and a is not type(None)]
    if isinstance(hint, UnionType) or kinds:
        paragraph = (kinds[0].__doc__ or "").strip().partition("\n\n")[0]
        return " ".join(paragraph.split()).partition(". ")[0].rstrip(".") + "."
    return ""
