"""Effect: the error of the time steps, estimated while the scene runs."""

from collections.abc import Callable
from dataclasses import replace

from tripod_sim.effect import Described, Effect, Need, Parts
from tripod_sim.errors import SceneError
from tripod_sim.integrators.scheme import Scheme
from tripod_sim.integrators.schemes import auto
from tripod_sim.model import ErrorEstimate, Model
from tripod_sim.tables.method import TimeError
from tripod_sim.tables.short_forms import contact_of, rigids_of, servo_tables, soft_bodies


def halves(scene: Described) -> bool:
    """Return whether steps of half the length tell the error of the time steps (see `steps.doubling`)."""
    carried = scene.inertia is None or scene.inertia.integrator.has_error_estimate
    return not carried or contact_of(scene) is not None or scene.strain_limit is not None


def by_path(scene: Described) -> bool:
    """Return whether steps are chosen by what they err over their path (see `steps.path_error_control`)."""
    wanted = scene.time_error
    return bool(
        wanted and scene.inertia and wanted.steps == "auto" and (wanted.accuracy > 0 or halves(scene))
    )


def check(wanted: TimeError, scene: Described) -> None:
    """Raise SceneError if the estimate lacks what it needs."""
    if wanted.accuracy and wanted.steps == "fixed":
        raise SceneError(
            f"time_error.accuracy is {wanted.accuracy:g}, but steps of a fixed dt cannot follow it; set "
            "dt = 'auto', or leave time_error.accuracy out"
        )
    if wanted.estimate == "local" and wanted.steps == "fixed":
        raise SceneError(
            "time_error.estimate is 'local', but a fixed dt does not use it; set dt = 'auto', or "
            "time_error.estimate to auto or global"
        )
    if halves(scene) and wanted.steps == "auto" and wanted.estimate == "global":
        raise SceneError(
            "time_error.estimate is 'global', which dt = 'auto' does not offer with contact, "
            "strain_limit or an explicit scheme; set a fixed dt, such as dt = 0.001, or "
            "time_error.estimate to auto"
        )
    if wanted.steps == "auto" and wanted.shortest > scene.dt:
        raise SceneError(
            f"time_error.shortest is {wanted.shortest:g} s; it must be at most dt, {scene.dt:g} s"
        )


FINEST = 0.01
"""Finest accuracy that is promised for soft bodies."""


def not_promised(scene: Described) -> str:
    """Return why no promise is given for the accuracy that a scene asks for; empty where one is given.

    A promise is given where benchmarks/time_promise.py and benchmarks/time_error_scenes.py keep it: for rigid bodies
    that do not bounce, and for one solid or net, with obstacles or without. A ball in a maze is watched by two others,
    which tell what its place depends on (`TimeErrorReport.ball`).
    """
    if not (scene.time_error and scene.time_error.accuracy and by_path(scene)):
        return ""
    bodies, contact, accuracy = soft_bodies(scene), contact_of(scene), scene.time_error.accuracy
    if scene.maze and not contact:
        return ""
    scheme = scene.inertia.integrator
    reasons = {
        "bodies bounce (restitution above 0), and errors grow with each bounce": contact
        and contact.restitution > 0,
        "a rigid body rolls on a soft one, and the estimate does not see where to": bodies
        and rigids_of(scene),
        "a soft body is moved, by servos or [[prescribed]], for which the promise is not measured": bodies
        and (servo_tables(scene) or scene.prescribed),
        "there are several soft bodies, for which the promise is not measured": len(bodies) > 1,
        "a soft body touches itself, for which the promise is not measured": contact and contact.self_contact,
        "the strain of springs is limited, for which the promise is not measured": scene.strain_limit,
        f"inertia.scheme is '{scheme.name}', with which the promise is not measured for soft bodies": bodies
        and scheme not in (auto.SCHEME, chosen_scheme(scene)),
        f"solver.mode is '{scene.solver.mode}', which ends a step where solver.position_tolerance says": bodies
        and scene.solver.mode == "one_solve",
        "a body of several materials touches something, and errors can grow there far above the estimate": contact
        and any(body.region for body in bodies),
        "a soft body with a [[load]] touches something, and errors can grow there far above the estimate": contact
        and bodies
        and scene.load,
        "a solid that nothing holds lands on edges, and keeps it in 9 of 10 scenes only": contact
        and not scene.fixed
        and any(body.springs is None for body in bodies),
        f"soft bodies keep {100 * FINEST:g} %, but not always less": bodies and accuracy < FINEST,
    }
    return next((why for why, holds in reasons.items() if holds), "")


def promise_note(scene: Described) -> str:
    """Return the note on an accuracy that is not promised; empty where it is, or none is asked for."""
    why = not_promised(scene)
    if not why:
        return ""
    return (
        f"time_error.accuracy = {scene.time_error.accuracy:g} is not promised here: {why}. Check with a fixed dt, "
        "inertia.scheme = 'tr_bdf2', and half of that dt"
    )


def chosen_scheme(scene: Described) -> Scheme:
    """Return the scheme of steps that are chosen by their path, where that is left open."""
    return auto.SCHEME.at_hits if halves(scene) else auto.SCHEME.smooth


def lower(wanted: TimeError, scene: Described, model: Model) -> Model:
    """Say how the error is found; choose a scheme for steps that are chosen by their path, where that is left open."""
    if not by_path(scene):
        found = ErrorEstimate.HALF_STEPS if halves(scene) else ErrorEstimate.CARRIED
        return replace(model, time_error=wanted, estimate=found)
    if model.scheme and model.scheme.is_automatic:
        model = replace(model, scheme=chosen_scheme(scene))
    note = promise_note(scene)
    notes = (*model.notes, *([note] if note else []))
    return replace(model, time_error=wanted, estimate=ErrorEstimate.OVER_PATH, notes=notes)


def finish(wanted: TimeError, model: Model, parts: Parts, build: Callable[[Model], Parts]) -> Parts:
    """Let steps be chosen by their path, or find their error by others of half the length."""
    from tripod_sim.integrators.step_control import HalveOnFailure
    from tripod_sim.integrators.substeps import Substeps

    assert model.scheme
    if model.estimate is ErrorEstimate.OVER_PATH:
        from tripod_sim.steps.path_error_control import PathErrorControl

        distance = model.contact.contact_distance if model.contact else 0.0
        nets = [body.springs is not None for _, body in model.bodies]
        control = PathErrorControl(parts, wanted, model.scheme, distance, solid=not all(nets), net=any(nets))
        watches = (*parts.watches, *([control.swing_note] if wanted.accuracy else []))
        return replace(parts, stepper=Substeps(control.integrator, control), chosen=control, watches=watches)
    if parts.errors:
        return parts
    from tripod_sim.steps.doubling import Doubling

    twin = build(replace(model, dt=0.5 * model.dt, time_error=None, estimate=None))
    doubling = Doubling(parts, twin, 1 if model.jumps else model.scheme.order)
    return replace(parts, stepper=Substeps(doubling, HalveOnFailure(0)), doubling=doubling)


TIME_ERROR = "time error"

EFFECT = Effect(
    TimeError,
    rank=180,
    rigid=True,
    rest=False,
    needs=(Need("inertia", "a scene at rest has no time steps; add [inertia], or leave time_error out"),),
    check=check,
    modules=(
        "integrators.time_error",
        "integrators.time_error_kernels",
        "integrators.added_error_control",
        "steps.doubling",
        "integrators.factor_store",
        "integrators.path_error_kernels",
        "steps.path_error_control",
        "springs.automatic",
        "springs.automatic_kernels",
    ),
    stages={
        "integrators.time_error.ErrorTransport": {
            "keep_residual": TIME_ERROR,
            "carry": TIME_ERROR,
            "would_add": TIME_ERROR,
            "report": TIME_ERROR,
        },
        "steps.doubling.Doubling": {"advance": TIME_ERROR},
    },
    steps=(TIME_ERROR,),
    lower=lower,
    finish=finish,
)
