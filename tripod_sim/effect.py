"""What an effect is: a table of a scene, what that needs, and what it puts into a simulation that is being built.

Each effect is a module of `tripod_sim.effects`, found there by its name, and no other module lists it. A simulation of
soft bodies is built in phases (`build.py`), in each of which every effect that the scene names does its part:

    hold     name nodes that are rigid, driven, fixed or moved
    place    put bodies where they can start
    extend   append nodes of its own
    weigh    give nodes weight and inertia
    act      put terms into the potential
    step     say what makes the steps, where that is not the scheme of [inertia]
    finish   change the parts of the simulation, of bodies of any kind

Functions import what they need themselves, so that an absent effect is not imported.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tripod_host.arrays import BoolArray, FloatArray
from tripod_sim.constraints.held import Holding
from tripod_sim.model import Model
from tripod_sim.tables.fields import Described
from tripod_sim.tables.joints import Actuator

if TYPE_CHECKING:
    from tripod_sim.constraints.groups import DrivenFrame, Groups
    from tripod_sim.constraints.prescribed import Prescribed
    from tripod_sim.forces.actuator import ActuatorTerm
    from tripod_sim.forces.anchor import Anchor
    from tripod_sim.forces.strain_bound import StrainBound
    from tripod_sim.forces.term import Term


Parts = Any
"""The `tripod_sim.steps.parts.Parts` of a simulation, which name all of physics."""


@dataclass(eq=False)
class Draft:
    """A simulation of soft bodies while it is being built.

    Attributes:
        model: What is built.
        assembly: The bodies (`bodies.assembly.Assembly`).
        sets: Their sets of nodes (`mesh.node_sets.NodeSets`).
        rest: Undeformed positions of all nodes [m], shape (n, 3); until `extend` those of the bodies alone.
        rigid: The nodes of each rigid body.
        driven: The arms of servos.
        fixed, moved: What is fixed, and what moves along timelines.
        prescribed: These timelines; None without any.
        groups: What all of these make; from `extend` on.
        load, inert: What nodes weigh and what inertia they have [kg], each of shape (n,); from `weigh` on.
        dead: Dead loads on nodes [N], shape (n, 3); None without any.
        terms: Of the potential, besides strain energy and inertia.
        inertia: The term of inertia; None without one.
        damping: b, the viscosity of solids and springs over their stiffness undeformed [s].
        bound: Of the stretch of springs; None without one.
        plate, ball: The maze on the disc, and how its ball moves; None without.
        observed: The effector where it is no disc (`robot.observed`); None without.
        places: Further places of it that are observed, by name.
        notes: What users should know of it, one sentence each.
        watches: See `tripod_sim.steps.parts.Parts`.
        prepared: What an effect keeps for a later phase, by its name.
    """

    model: Model
    assembly: Any
    sets: Any
    rest: FloatArray
    rigid: list[Holding] = field(default_factory=list)
    driven: "tuple[DrivenFrame, ...]" = ()
    fixed: list[Holding] = field(default_factory=list)
    moved: list[Holding] = field(default_factory=list)
    prescribed: "Prescribed | None" = None
    groups: "Groups" = None  # type: ignore[assignment]
    load: FloatArray = field(default_factory=lambda: np.zeros(0))
    inert: FloatArray = field(default_factory=lambda: np.zeros(0))
    dead: FloatArray | None = None
    terms: "list[Term]" = field(default_factory=list)
    inertia: "Anchor | None" = None
    damping: float = 0.0
    bound: "StrainBound | None" = None
    plate: Any = None
    ball: Any = None
    observed: Any = None
    places: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    watches: list[Callable[[FloatArray], str]] = field(default_factory=list)
    prepared: dict[str, Any] = field(default_factory=dict)

    def add_actuator(self, term: "ActuatorTerm", joint: Actuator) -> None:
        """Add a term with a commanded coordinate; of all effects in the order of `Joints.others`."""
        term.value, term.span, term.high = joint.start, joint.span, joint.high
        self.terms.append(term)


class Need(NamedTuple):
    """Another effect that one needs.

    Attributes:
        name: Of the other.
        why: In words.
    """

    name: str
    why: str


Phase = Callable[[Any, Draft], None]
"""Takes the table of the scene, or all of them where there may be several, and changes the draft."""


@dataclass(frozen=True)
class Effect:
    """One effect.

    Attributes:
        table: Its dataclass; the first sentence of the docstring says what it is.
        rank: Place among the others, in lists and in each phase.
        several: Whether a scene may have several of the tables.
        rigid: Whether rigid bodies that are alone may have it.
        rest: Whether a body at rest has it, on its own.
        needs: Others that it cannot be without.
        there: Whether a scene has it, where not its own field alone says so.
        found: Returns the table of a scene, or None, where that need not be its own field.
        check: Raises SceneError where the table does not go with the rest of the scene.
        modules: Modules or packages below `tripod_sim` that no other effect needs: the code works without their files
            wherever no scene names the effect.
        stages: Methods of classes below `tripod_sim` that are stages of a step, as `explain.stages.STAGES`.
        steps: Names, or beginnings of names, of the stages that only this effect has.
        seldom: What it does too seldom for a few typical steps to show, in one line; empty for nothing.
        words: Overrides that switch it on with defaults, as `tripod run --set` takes them; its name alone if empty.
        hold, place, extend, weigh, act: Phases of building, see the module.
        step: Returns the parts of the simulation, given table, draft and system, where the effect makes the steps.
        start: Returns velocities of nodes at the start [m/s], shape (n, 3), given table, sets, undeformed positions and
            what is held, both of that shape.
        lower: Returns the model with what others have to know of the effect, given table, scene and the model so far.
        finish: Returns the parts with what the effect makes of them, given table, model, parts and what builds others.
    """

    table: type
    rank: int
    several: bool = False
    rigid: bool = False
    rest: bool = True
    needs: tuple[Need, ...] = ()
    there: Callable[[Described], bool] | None = None
    found: Callable[[Described], Any] | None = None
    check: Callable[[Any, Described], None] | None = None
    modules: tuple[str, ...] = ()
    stages: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    steps: tuple[str, ...] = ()
    seldom: str = ""
    words: tuple[str, ...] = ()
    place: Phase | None = None
    hold: Phase | None = None
    extend: Phase | None = None
    weigh: Phase | None = None
    act: Phase | None = None
    step: Callable[[Any, Draft, Any], Parts] | None = None
    start: Callable[[Any, Any, FloatArray, BoolArray], FloatArray] | None = None
    lower: Callable[[Any, Described, Model], Model] | None = None
    finish: Callable[[Any, Model, Parts, Callable[[Model], Parts]], Parts] | None = None
