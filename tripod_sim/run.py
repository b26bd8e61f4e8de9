"""One scene from start to end without ROS: what `tripod run` does."""

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tripod_sim.errors import SceneError
from tripod_sim.scene import Scene
from tripod_sim.scene_file import load_scene
from tripod_sim.simulation import Simulation
from tripod_sim.timeline import Timeline, parse_slide, parse_timeline

FloatArray = NDArray[np.float64]

SETTLING = 1.0
"""Simulated after the last time of a servo timeline, unless a duration is given [s]."""

MOST_BYTES = 4e9
"""Largest recording of `out` held in memory [bytes]."""


def run(
    scene: str,
    *,
    duration: float | None = None,
    servo: str | None = None,
    slide: str | None = None,
    overrides: Sequence[str] = (),
    out: Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> dict[str, Any]:
    """Simulate a scene and return its summary.

    Args:
        scene: Name of a shipped scene or path of a scene file.
        duration: Simulated time [s]; None: until one second after the last servo time, else as the scene says.
        servo: Angles over time [rad], `0:0,0,0; 1:-0.7854,-0.7854,-0.7854`.
        slide: Slide over time [m], or one number (see `parse_slide`).
        overrides: Words `dotted.path=value`.
        out: File for every step's time, positions, effector pose, angles, torques.
        progress: Called with the finished fraction after each step.

    Returns:
        effector (position [m], quaternion x y z w) or None, angles [rad], slide [m], torques [N m], energies [J],
        time [s], steps, newton_iterations (linear solves in all), parts, halvings, residual [N], and step_ms, the
        wall time of a step [ms], median and 99th percentile.

    Raises:
        SceneError: anything wrong with the input.
        StepError: the simulation could not go on.
    """
    description = load_scene(scene, overrides)
    servos, slides = _timelines(description, servo, slide)
    if duration is None:
        last = max([t.times[-1] for t in (servos, slides) if t is not None], default=0.0)
        duration = float(last) + SETTLING if last > 0 else description.duration
    if not 0 < duration < 1e9:
        raise SceneError(f"--duration is {duration:g} s; it must be positive and finite")
    steps = max(1, round(duration / description.dt))
    description = _starting(description, servos, slides)
    simulation = Simulation(description)
    recording = _Recording(simulation, steps, out) if out else None
    taken = np.empty(steps)
    totals = dict.fromkeys(("iterations", "parts", "halvings"), 0)
    for k in range(steps):
        joints = _joints(simulation, servos, slides, (k + 1) * description.dt)
        start = clock.perf_counter()
        report = simulation.step(joints)
        taken[k] = clock.perf_counter() - start
        for name in totals:
            totals[name] += getattr(report, name)
        if recording:
            recording.add(k, simulation)
        if progress:
            progress((k + 1) / steps)
    if recording:
        recording.save()
    pose = simulation.effector
    return {
        "scene": description.name,
        "effector": {"position": pose.position.tolist(), "quaternion": pose.quaternion.tolist()}
        if pose
        else None,
        "angles": simulation.state.joints[:-1].tolist(),
        "slide": float(simulation.state.joints[-1]),
        "torques": simulation.torques.tolist(),
        "energies": asdict(simulation.energies()),
        "time": simulation.state.time,
        "dt": description.dt,
        "steps": steps,
        "newton_iterations": totals["iterations"],
        "parts": totals["parts"],
        "halvings": totals["halvings"],
        "residual": simulation.report.residual,
        "step_ms": {"median": float(np.median(taken) * 1e3), "p99": float(np.percentile(taken, 99) * 1e3)},
    }


def _timelines(scene: Scene, servo: str | None, slide: str | None) -> tuple[Timeline | None, Timeline | None]:
    for option, text in (("--servo", servo), ("--slide", slide)):
        if text is not None and not scene.servos:
            raise SceneError(f"{option}: scene {scene.name!r} has no servos")
    servos = parse_timeline(servo, 3, "--servo") if servo is not None else None
    slides = parse_slide(slide, servos) if slide is not None else None
    if s := scene.servos:
        if servos and not ((servos.values >= s.angle_min) & (servos.values <= s.angle_max)).all():
            raise SceneError(
                f"--servo: angles reach {servos.values.min():g} to {servos.values.max():g} rad; allowed is "
                f"{s.angle_min:g} to {s.angle_max:g} rad"
            )
        if slides and not ((slides.values >= 0) & (slides.values <= s.slide_max)).all():
            raise SceneError(
                f"--slide: reaches {slides.values.min():g} to {slides.values.max():g} m; allowed is 0 to "
                f"{s.slide_max:g} m"
            )
    return servos, slides


def _starting(scene: Scene, servos: Timeline | None, slides: Timeline | None) -> Scene:
    """Return the scene with its servos where the timelines begin."""
    if not scene.servos:
        return scene
    angles = servos.at(0.0) if servos else np.array(scene.servos.angles)
    slide = float(slides.at(0.0)[0]) if slides else scene.servos.slide
    a = angles.tolist()
    return replace(scene, servos=replace(scene.servos, angles=(a[0], a[1], a[2]), slide=slide))


def _joints(
    simulation: Simulation, servos: Timeline | None, slides: Timeline | None, time: float
) -> FloatArray | None:
    if servos is None and slides is None:
        return None
    joints = simulation.state.joints.copy()
    if servos:
        joints[:-1] = servos.at(time)
    if slides:
        joints[-1] = slides.at(time)[0]
    return joints


class _Recording:
    """Every step of a run, in memory until it is saved whole; the file is tried first."""

    def __init__(self, simulation: Simulation, steps: int, path: Path) -> None:
        nodes, servos = len(simulation.mesh.nodes), len(simulation.torques)
        size = 8.0 * steps * (3 * nodes + 2 * servos + 9)
        if size > MOST_BYTES:
            raise SceneError(f"--out would take {size / 1e9:.1f} GB; shorten --duration or enlarge dt")
        self._path, self._part = path, path.with_name(path.name + ".part")
        try:
            self._part.touch()
            self._part.unlink()
        except OSError as error:
            raise SceneError(f"--out {str(path)!r} cannot be written: {error.strerror}") from None
        self._has_pose = simulation.effector is not None
        self._arrays = {
            "time": np.empty(steps),
            "positions": np.empty((steps, nodes, 3)),
            "effector": np.full((steps, 7), np.nan),
            "angles": np.empty((steps, servos)),
            "slide": np.empty(steps),
            "torques": np.empty((steps, servos)),
        }

    def add(self, k: int, simulation: Simulation) -> None:
        a, state, pose = self._arrays, simulation.state, simulation.effector
        a["time"][k], a["positions"][k] = state.time, state.positions
        a["angles"][k], a["slide"][k], a["torques"][k] = (
            state.joints[:-1],
            state.joints[-1],
            simulation.torques,
        )
        if pose:
            a["effector"][k, :3], a["effector"][k, 3:] = pose.position, pose.quaternion

    def save(self) -> None:
        kept = {name: a for name, a in self._arrays.items() if self._has_pose or name != "effector"}
        try:
            with self._part.open("wb") as file:
                np.savez(file, allow_pickle=False, **kept)
            self._part.replace(self._path)
        except OSError as error:
            raise SceneError(f"--out {str(self._path)!r} cannot be written: {error.strerror}") from None
