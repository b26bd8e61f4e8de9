"""Model to what makes its steps: time integrators and the static solver, for terms of any kind."""

from typing import TYPE_CHECKING, Any

from tripod_host.arrays import FloatArray
from tripod_sim.constraints.held import free_motion
from tripod_sim.effect import Draft
from tripod_sim.errors import SceneError
from tripod_sim.integrators.newton import Newton
from tripod_sim.integrators.scheme import ExplicitScheme
from tripod_sim.integrators.stepper import Stepper
from tripod_sim.integrators.substeps import Substeps, halving
from tripod_sim.model import ErrorEstimate, Model
from tripod_sim.system import System

if TYPE_CHECKING:
    from tripod_sim.forces.anchor import Anchor
    from tripod_sim.integrators.stage import ImplicitStage
    from tripod_sim.springs.automatic import AutomaticSprings
    from tripod_sim.springs.loop import SpringLoop


def stepper_of(draft: Draft, system: System) -> Stepper:
    """Return the time integrator or the static solver of soft bodies that touch nothing."""
    model, inertia, mass = draft.model, draft.inertia, draft.inert
    newton = _newton(draft, system)
    if not model.scheme and model.only_springs:
        from tripod_sim.integrators.static_descent import descent_steps

        return descent_steps(newton, mass)
    if not model.scheme:
        from tripod_sim.integrators.quasi_static import quasi_static_steps

        watch = not any(body.springs for _, body in model.bodies)  # slack ones have no stiffness to watch
        solver = model.solver
        return quasi_static_steps(newton, solver.max_halvings, solver.max_turn, model.reach, watch=watch)
    if not inertia:
        return _explicit_steps(draft, system)
    if chosen := _chosen_steps(draft, system):
        return chosen
    from tripod_sim.integrators.stage import ImplicitStage

    return implicit_steps(model, ImplicitStage(newton, inertia, mass, model.drag), system, inertia, mass)


def _newton(draft: Draft, system: System) -> Newton:
    """Return what solves the stages of a step."""
    model, solver = draft.model, draft.model.solver
    if draft.bound and draft.inertia:
        from tripod_sim.integrators.strain_limit import BoundedNewton

        return BoundedNewton(system, draft.bound, solver.tolerance, solver.max_iterations)
    groups = system.groups
    one_solve = model.scheme and solver.mode == "one_solve"  # statics goes to the tolerance
    # one solve does not find which springs are at their bound, nor which cables are taut
    one_solve = one_solve and not (draft.bound or groups.actuators)
    if one_solve and model.only_springs:
        from tripod_sim.integrators.one_newton_step import OneNewtonStep

        return OneNewtonStep(system, solver.tolerance, solver.max_iterations)
    if one_solve and not model.joints:  # where nothing holds a body errors of the momentum would add up
        one_solve = not free_motion([*system.reduction.blocks, *groups.rigid], system.rest, groups.held())
    if not one_solve:
        return _solver_to_tolerance(model, system)
    from tripod_sim.integrators.one_solve import OneSolve

    return OneSolve(system, solver.tolerance, solver.max_iterations, solver.position_tolerance)


def _solver_to_tolerance(model: Model, system: System) -> Newton:
    """Return what goes to the tolerance: with a factorisation that serves many steps where the body is solid.

    Errors that are estimated need that of the end of each step, or one of each length.
    """
    solver, elastic = model.solver, system.elastic
    solid = any(term.solid for term in elastic.terms)
    if not (model.scheme and solid) or model.carried or model.estimate is ErrorEstimate.OVER_PATH:
        return Newton(system, solver.tolerance, solver.max_iterations)
    from tripod_sim.integrators.quasi_newton import QuasiNewton

    return QuasiNewton(system, solver.tolerance, solver.max_iterations)


def _spring_loop(draft: Draft, system: System) -> "SpringLoop | None":
    """Return the arrays of compiled loops of springs; None where something else than springs is to be moved."""
    if not any(body.springs for _, body in draft.model.bodies):
        return None
    from tripod_sim.springs.loop import spring_loop

    return spring_loop(system, draft.inert, draft.model.drag, draft.inertia)


def _chosen_steps(draft: Draft, system: System) -> "AutomaticSprings | None":
    """Return what chooses explicit steps of springs, where `auto` leaves the scheme to it; else None."""
    model, wanted = draft.model, draft.model.carried
    if not (wanted and model.scheme and model.scheme.is_automatic and wanted.steps == "auto"):
        return None
    loop = _spring_loop(draft, system)
    if not loop:
        return None
    if wanted.estimate == "global":
        raise SceneError(
            "time_error.estimate is 'global', which needs an implicit scheme; dt = 'auto' takes an "
            "explicit one for these springs: set inertia.scheme = 'tr_bdf2', or time_error.estimate to "
            "auto"
        )
    from tripod_sim.springs.automatic import AutomaticSprings

    forces = bool(model.markers)
    return AutomaticSprings(system, loop, wanted.tolerance, wanted.shortest, forces=forces)


def _explicit_steps(draft: Draft, system: System) -> "Stepper":
    """Return an explicit scheme, in a compiled loop if there is one, within the bound of springs if there is one."""
    model, mass, loop = draft.model, draft.inert, _spring_loop(draft, system)
    scheme, divide = model.scheme, model.divide
    assert isinstance(scheme, ExplicitScheme)
    stepper: Stepper
    if loop:
        from tripod_sim.springs.explicit import ExplicitSprings

        stepper = ExplicitSprings(system, loop, scheme, divide=divide, forces=bool(model.markers))
    else:
        from tripod_sim.integrators.explicit import ExplicitSteps

        stepper = ExplicitSteps(system, mass, scheme, drag=model.drag, divide=divide)
    if not draft.bound:
        return stepper
    from tripod_sim.integrators.strain_limit import StrainLimited

    blocks = [term.elements for term in system.elastic.terms]
    return StrainLimited(stepper, system, draft.bound, mass, blocks, model.solver.max_iterations)


def implicit_steps(
    model: Model,
    stage: "ImplicitStage",
    system: Any,
    inertia: "Anchor",
    mass: FloatArray,
) -> Substeps:
    """Return the implicit time integrator of a model; all but the model and the stage are as for `ErrorTransport`."""
    from tripod_sim.integrators.implicit import ImplicitSteps

    most, wanted, scheme = model.solver.max_halvings, model.carried, model.implicit
    pair = scheme.pair if wanted is not None and wanted.steps == "auto" else None
    steps = ImplicitSteps(pair[1] if pair else scheme, stage)
    if model.estimate is ErrorEstimate.OVER_PATH:
        stage.newton.keep_several()
    if not wanted:
        return halving(steps, most)
    from tripod_sim.integrators.time_error import ErrorTransport

    auto = wanted.steps == "auto"
    steps.errors = ErrorTransport(system, inertia, mass, local=auto, carried=wanted.carries)
    if not auto:
        return halving(steps, most)
    from tripod_sim.integrators.added_error_control import AddedErrorControl

    return Substeps(steps, AddedErrorControl(steps, most, wanted.tolerance, wanted.shortest, pair=pair))
