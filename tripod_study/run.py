"""One scene from start to end without ROS: what `tripod run` does."""

import time as clock
from array import array
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from tripod_host import stop
from tripod_sim.effects import named
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene
from tripod_sim.scene.file import load_scene, naming_file
from tripod_sim.scene.script import Script, script_of
from tripod_sim.simulation import Simulation
from tripod_sim.tables.short_forms import contact_of, soft_bodies
from tripod_study.recording import Recording, check_out
from tripod_study.summary.accuracy import accuracy_summary, finer
from tripod_study.summary.energy import EnergyBooks
from tripod_study.summary.errors import LargestErrors
from tripod_study.summary.stability import stability

SETTLING = 1.0
"""Simulated after the last time of a servo timeline, unless a duration is given [s]."""

MOST_STEPS = 10**9
"""Of one run."""

LOWERED = 0.01
"""By how much the coefficient of restitution of a hit may be lowered without a note."""


def run(
    scene: str,
    *,
    duration: float | None = None,
    servo: str | None = None,
    slide: str | None = None,
    actuate: Sequence[str] = (),
    overrides: Sequence[str] = (),
    out: Path | None = None,
    forces: bool = False,
    mesh_error: bool = False,
    recorded: Callable[[Recording], None] | None = None,
    progress: Callable[[float], None] | None = None,
    say: Callable[[str], None] | None = None,
    noted: Callable[[str], None] | None = None,
    study: Path | None = None,
) -> dict[str, Any]:
    """Simulate a scene and return its summary.

    Args:
        scene: Name of a shipped scene or path of a scene file.
        duration: Simulated time [s]; None: until one second after the last servo time, else as the scene says.
        servo: Angles over time [rad], `0:0,0,0; 1:-0.7854,-0.7854,-0.7854`.
        slide: Slide over time [m], or one number (see `parse_slide`).
        actuate: Values of other actuators over time, each `name=0:0; 1:0.01`. Where none of the three is given, the
            scene's `motion`.
        overrides: Words `dotted.path=value`.
        out: File (`.npz`) for every step, see `tripod_study.recording`; of the steps that were made, if the run breaks
            off.
        forces: Whether the recording has the forces on the bodies.
        mesh_error: Whether it has the error of the mesh at each node.
        recorded: Called before the first step with the recording, which grows with each step; None: there is none
            unless `out` is given.
        progress: Called with the finished fraction after each step.
        say: Called with a line on what is being built, how large it is, and with an empty one before the first step.
        noted: Called with each of the notes as soon as it is known.
        study: File of an accuracy study of the scene; None: the one that comes with tripod.

    Returns:
        effector (position [m], quaternion x y z w) or None, angles [rad], slide [m], torques [N m], with other
        actuators these (name, position, effort and their units), energies [J], time [s], steps, newton_iterations
        (linear solves in all), parts, rejected (parts taken back because they added too much error), increments (of the
        load in statics), halvings, residual [N], dt_limit (longest stable step of an explicit scheme [s], else None),
        grew_at and instability (since which step its energy has grown, 0 for never, and that in words), stalled (servos
        that stand against their load at the end: servo, load and stall_torque [N m], short [rad]), figures (accuracy in
        words; error, which the accuracy study measured and which is promised for other motions, None where it is not
        known; quantity, what that is the error of; finer, a smaller error that `--accuracy` serves, or None; names of
        the effects; stability, as `tripod_study.summary` has it), stalled_time (of each servo [s]), with the scene's
        `time_error` the largest estimates of the run (effector, largest, node, added, ball) [m], NaN and node -1 for
        what is not estimated, with `mesh_error` that of the effector at the end (effector, its length distance), the
        largest of the run, and the largest of it together with the error of the steps (largest, largest_with_steps)
        [m], NaN where there is no estimate and in statics those at the end, with a ball its position [m] and event
        (words), with contact what it took in the last step (contacts, those pressed, force [N], rounds of the response,
        its way, residual [m] of gaps and slips, smallest_gap beyond the contact distance [m], cut, and lowered, by how
        much the run lowered the coefficient of restitution of a hit at most) and with rigid bodies their poses, markers
        (set, position and moved [m], force [N] and moment about the origin [N m] of what holds or moves them, of a
        solid), notes on the scene if there are any, displacement (node and largest, how far that node is from the
        undeformed shape [m]), seconds, the CPU time of all steps [s], and step_ms, that of a step [ms], median and 99th
        percentile.

    Raises:
           SceneError: anything wrong with the input.
           StepError: the simulation could not go on.
    """
    description, script = _scene_and_script(scene, overrides, servo, slide, actuate)
    steps, description = _steps(description, script, duration), script.started(description)
    check_out("--out", out, (".npz",))
    with naming_file(scene, overrides):
        simulation = Simulation(description, progress, say=say, noted=noted)
    if say:
        say("")
    recording = (
        Recording(simulation, steps, forces=forces, mesh_error=mesh_error) if out or recorded else None
    )
    if recording and recorded:
        recorded(recording)
    books = EnergyBooks(simulation.energies(), *simulation.joint_work())
    taken = array("d")
    totals = dict.fromkeys(("iterations", "parts", "rejected", "increments", "halvings"), 0)
    errors = LargestErrors()
    least = LeastStabilityMargin(simulation, steps)
    stalled_steps, unstable, lowered = [0] * len(simulation.efforts), array("d"), 0.0
    snapped = array("d")
    kept = partial(recording.save, out) if recording and out else lambda: None
    stop.before(kept)  # also a run that is interrupted keeps what it has
    try:
        for k in range(steps):
            joints = script.joints(simulation.command, (k + 1) * description.dt) if script else None
            start = clock.process_time()
            report = simulation.step(joints)
            taken.append(clock.process_time() - start)
            for name in totals:
                totals[name] += getattr(report, name)
            errors.add(report)
            least.look()
            if report.contact:
                lowered = max(lowered, report.contact.lowered)
            if report.unstable:
                unstable.append(simulation.state.time)
            if report.snapped:
                snapped.append(simulation.state.time)
            if joints is not None or description.prescribed:  # what works on the body
                books.add(simulation.energies(), *simulation.joint_work(), simulation.state.time)
            for stall in report.stalled:
                stalled_steps[stall.servo] += 1
            if recording:
                recording.add(simulation)
            if progress:
                progress((k + 1) / steps)
    finally:  # a run that breaks off keeps what it has
        kept()
        stop.no_more(kept)
    books.add(simulation.energies(), *simulation.joint_work(), simulation.state.time)
    rest, accuracy = not description.inertia, accuracy_summary(scene, description, own=study)
    figures = stability(
        simulation.report, totals["halvings"], books.balance, description.dt, least.seen, at_rest=rest
    )
    simulation.note(
        *_unstable(unstable, steps),
        *_snapped(snapped),
        *_astray(errors.largest, simulation),
        *_lowered_restitution(lowered),
    )
    pose, ball, servos = simulation.effector, simulation.ball, len(simulation.driven_frames)
    return {
        "scene": description.name,
        "effector": {"position": pose.position.tolist(), "quaternion": pose.quaternion.tolist()}
        if pose
        else None,
        "angles": simulation.state.joints[:servos].tolist(),
        "slide": float(simulation.state.joints[len(simulation.efforts)]),
        "torques": simulation.efforts[:servos].tolist(),
        **_actuators(simulation),
        "energies": asdict(simulation.energies()),
        "time": simulation.state.time,
        "dt": description.dt,
        "steps": steps,
        "newton_iterations": totals["iterations"],
        "parts": totals["parts"],
        "rejected": totals["rejected"],
        "increments": totals["increments"],
        "halvings": totals["halvings"],
        "residual": simulation.report.residual,
        "dt_limit": limit if np.isfinite(limit := simulation.report.dt_limit) else None,
        "grew_at": simulation.report.grew_at,
        "instability": simulation.report.instability,
        "figures": {
            "accuracy": accuracy.line,
            "quantity": accuracy.quantity,
            "size": accuracy.size,
            "finer": finer(accuracy),
            "error": {"measured": accuracy.measured, "bound": accuracy.bound},
            "effects": named(description),
            "stability": asdict(figures),
        },
        "stalled": [asdict(stall) for stall in simulation.report.stalled],
        "stalled_time": [count * description.dt for count in stalled_steps],
        "seconds": float(np.sum(taken)),
        "displacement": _displacement(simulation),
        "step_ms": {"median": float(np.median(taken) * 1e3), "p99": float(np.percentile(taken, 99) * 1e3)},
        **_errors(simulation, errors),
        **({"markers": _markers(simulation)} if description.marker else {}),
        **({"notes": list(simulation.notes)} if simulation.notes else {}),
        **({"ball": {"position": ball.position.tolist(), "event": simulation.ball_event}} if ball else {}),
        **_contact_summary(simulation, lowered),
    }


def _actuators(simulation: Simulation) -> dict[str, Any]:
    """Return what actuators that are no servos do at the end: position and effort, with their units."""
    if not (simulation.joints and simulation.joints.others):
        return {}
    positions, efforts = simulation.joints.moved(simulation.command[:-1], simulation.efforts)
    rows = zip(simulation.joints.actuators, positions.tolist(), efforts.tolist(), strict=True)
    servos = len(simulation.driven_frames)
    found = [
        {"name": a.name, "position": position, "position_unit": a.position_unit, "effort": effort,
         "effort_unit": a.effort_unit}
        for a, position, effort in rows
    ]  # fmt: skip
    return {"actuators": found[servos:]}


def _displacement(simulation: Simulation) -> dict[str, Any]:
    """Return the node that is farthest from its place in the undeformed shape, and how far [m]."""
    moved = np.linalg.norm(simulation.positions - simulation.mesh.nodes, axis=1)
    return {"node": int(np.argmax(moved)), "largest": float(np.max(moved))}


def _scene_and_script(
    source: str, overrides: Sequence[str], servo: str | None, slide: str | None, actuate: Sequence[str]
) -> tuple[Scene, Script]:
    """Return a scene and what its actuators do; its motion is dropped where the user gives one. Raises SceneError."""
    scene = load_scene(source, overrides)
    own = servo is None and slide is None and not actuate
    with naming_file(source, overrides) if own else nullcontext():
        script = script_of(scene, servo, slide, actuate)
    return (scene if own else replace(scene, motion=None)), script


def _steps(scene: Scene, script: Script, duration: float | None) -> int:
    """Return how many steps a run takes. Raises SceneError."""
    if duration is None:
        duration = script.end + SETTLING if script.end > 0 else scene.duration
    longest = MOST_STEPS * scene.dt
    if not 0 < duration <= longest:
        raise SceneError(
            f"the duration is {duration:g} s; it must be positive and at most {longest:g} s, {MOST_STEPS} "
            "steps of dt"
        )
    return max(1, round(duration / scene.dt))


LOOKS = 20
"""Times in a run at which is looked how firm the body is."""


class LeastStabilityMargin:
    """The least stability margin of a run.

    Attributes:
        seen: It, and when that was [s]; None where it is not known.
    """

    def __init__(self, simulation: Simulation, steps: int) -> None:
        """Look at the start, and then `LOOKS` times."""
        self._simulation, self._every = simulation, max(1, steps // LOOKS)
        self._known = (
            bool(simulation.effector)
            and not contact_of(simulation.scene)
            and any(body.mesh for body in soft_bodies(simulation.scene))
        )
        self.seen: list[float] | None = None
        self.look()

    def look(self) -> None:
        """Note how firm the body is, if it is time to."""
        state = self._simulation.state
        if not self._known or state.step % self._every:
            return
        try:
            stability_margin = self._simulation.compliance().stability_margin
        except StepError:  # singular just here
            return
        if stability_margin and (self.seen is None or stability_margin.value < self.seen[0]):
            self.seen = [stability_margin.value, state.time]


def _unstable(times: Sequence[float], steps: int) -> list[str]:
    """Return what is to say of static steps that ended, at some times [s], in unstable equilibria."""
    if not times:
        return []
    return [
        (
            f"{len(times)} of {steps} steps ended in an unstable equilibrium, first at {times[0]:.4g} s: "
            "a real body would leave it (snap or buckle). Run it with [inertia] to see where it goes; if "
            "a finer mesh or another mesh.element does not report this, the mesh is the cause"
        )
    ]


def _snapped(times: Sequence[float]) -> list[str]:
    """Return what is to say of static steps that ended, at some times [s], on another branch of equilibria."""
    if not times:
        return []
    more = f" and in {len(times) - 1} later steps" if len(times) > 1 else ""
    return [
        (
            f"the body snapped through in the step to {times[0]:.4g} s{more}: near the limit point before, a small "
            "change of load moves it far. Run it with [inertia] to see how it gets there"
        )
    ]


def _astray(error: float, simulation: Simulation) -> list[str]:
    """Return what is to say of a linear estimate of the error of the time steps [m], NaN if there is none."""
    if np.isnan(error) or contact_of(simulation.scene):  # with contact it is told by steps of half the length
        return []
    size = float(np.ptp(simulation.mesh.nodes, axis=0).max())
    if error <= size:
        return []
    return [
        (
            f"the estimated error of the time steps exceeded the size of the body ({1000.0 * size:.3g} "
            "mm): dt is too large, or the estimate fails here; compare with half of dt, or take another scheme"
        )
    ]


def _lowered_restitution(lowered: float) -> list[str]:
    """Return what is to say of hits whose coefficient of restitution was lowered by at most `lowered`."""
    if lowered <= LOWERED:
        return []
    return [
        (
            f"contact.restitution was lowered by up to {lowered:.2g} at hits that would have gained "
            "energy, so they bounce less than the scene says; set a smaller contact.restitution or "
            "contact.friction, or a smaller dt"
        )
    ]


def _errors(simulation: Simulation, errors: LargestErrors) -> dict[str, Any]:
    """Return the largest errors of the time steps and of the mesh, of those that the scene asks for."""
    found = dict[str, Any]()
    if simulation.report.time_error:
        found["time_error"] = {
            name: getattr(errors, name) for name in ("effector", "largest", "node", "added", "ball")
        }
    if mesh := simulation.mesh_error():
        if (
            not simulation.scene.inertia
        ):  # which steps were estimated depends on the machine; the end always is
            errors = LargestErrors()
        errors.add_mesh(simulation.report, mesh)
        found["mesh_error"] = {
            "effector": list(mesh.effector),
            "distance": mesh.distance,
            "largest": errors.mesh,
            "largest_with_steps": errors.both,
        }
    return found


def _markers(simulation: Simulation) -> list[dict[str, Any]]:
    """Return for each marker where it is, how far it has moved [m], and what holds or moves it with [N, N m]."""
    found = []
    for i, (table, here) in enumerate(zip(simulation.scene.marker, simulation.markers, strict=True)):
        numbers = {"position": here, "moved": here - simulation.undeformed(i)}
        numbers["force"], numbers["moment"] = simulation.reactions(i)
        found.append({"set": table.set} | {name: values.tolist() for name, values in numbers.items()})
    return found


def _contact_summary(simulation: Simulation, lowered: float) -> dict[str, Any]:
    """Return rigid bodies and contacts at the end; nothing in a scene without contact.

    `lowered`: by how much the coefficient of restitution was lowered at most.
    """
    contact = simulation.report.contact
    if not contact:
        return {}
    found: dict[str, Any] = {
        "contact": {
            "contacts": contact.contacts,
            "pressed": contact.pressed,
            "force": contact.force,
            "rounds": contact.rounds,
            "way": contact.way,
            "residual": contact.residual,
            "smallest_gap": contact.smallest_gap if contact.contacts else None,
            "cut": contact.cut,
            "lowered": lowered,
        }
    }
    own = len(simulation.scene.rigid)  # a ball that is one of them is told by its name
    if poses := simulation.rigid[:own]:
        found["rigid"] = [
            {"position": p.position.tolist(), "quaternion": p.quaternion.tolist()} for p in poses
        ]
    return found
