"""Inverse kinematics in closed loop over the dynamic simulator: what tests and benchmarks of tracking share."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from tests.scenes import SHARP
from tripod_graph.names import WORKING_POSE
from tripod_host.arrays import FloatArray
from tripod_host.rotations import quaternion_matrix
from tripod_ik.model import linear_state
from tripod_ik.tracker import Tracker
from tripod_ik.tracker_settings import TrackerSettings
from tripod_sim import Simulation, load_scene

BLEND = 1.0  # [s]: targets leave the start smoothly within it
SETTLED = 2.0  # [s]: from here on the error counts

Path = Callable[[float], tuple[FloatArray, FloatArray | None]]
"""Position [m] relative to the start, and normal, at a time [s]."""


def blend(t: float) -> float:
    u = min(max(t / BLEND, 0.0), 1.0)
    return u**3 * (6 * u * u - 15 * u + 10)


def circle(t: float) -> tuple[FloatArray, None]:
    """10 mm of radius, 2 s a turn, 2 mm above the working pose."""
    return blend(t) * np.array([0.01 * np.cos(np.pi * t), 0.01 * np.sin(np.pi * t), 0.002]), None


def vertical_sine(t: float) -> tuple[FloatArray, None]:
    """Up and down by 6 mm in 2 s, about 4 mm above the working pose."""
    return blend(t) * np.array([0.0, 0.0, 0.004 + 0.006 * np.sin(np.pi * t)]), None


def tilting(t: float) -> tuple[FloatArray, FloatArray]:
    """The tilt runs around at 0.3 rad in 4 s, 21 mm above the working pose; lower there is not always room for it."""
    angle = 0.3 * blend(t - 1.0) * np.array([np.cos(np.pi / 2 * t), np.sin(np.pi / 2 * t)])
    n = np.array([angle[1], -angle[0], 0.0])
    size = np.linalg.norm(n)
    normal = np.array([0, 0, np.cos(size)]) + (np.sin(size) / size * n if size else 0.0)
    return blend(t) * np.array([0.0, 0.0, 0.021]), normal


@dataclass(frozen=True, eq=False)
class Followed:
    """Times [s], effector and target [m], both normals; one row a step, from `SETTLED` on. `limits` that acted."""

    times: FloatArray
    effector: FloatArray
    target: FloatArray
    normals: FloatArray
    target_normals: FloatArray
    limits: frozenset[str]

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(np.sum((self.effector - self.target) ** 2, axis=1))))

    @property
    def tilt_rms(self) -> float:
        cosine = np.sum(self.normals * self.target_normals, axis=1)
        return float(np.sqrt(np.mean(np.arccos(np.clip(cosine, -1, 1)) ** 2)))

    def lag(self, path: Path) -> float:
        """The delay of the target [s] that explains most of the error."""
        start = self.target[0] - path(self.times[0])[0]
        lags = np.arange(-0.02, 0.15, 0.0005)
        errors = [
            np.mean(
                [
                    np.sum((start + path(t - lag)[0] - p) ** 2)
                    for t, p in zip(self.times, self.effector, strict=True)
                ]
            )
            for lag in lags
        ]
        return float(lags[int(np.argmin(errors))])


def follow(
    path: Path, settings: TrackerSettings, overrides: tuple[str, ...] = (), *, seconds: float = 4.0
) -> Followed:
    """Follow `path` from the working pose; each step of the simulator asks for one command."""
    *angles, slide = WORKING_POSE
    scene = load_scene(SHARP, [f"servos.angles={angles}", f"servos.slide={slide}", *overrides])
    simulation, tracker, rows, limits = Simulation(scene), Tracker(settings), [], set()
    home, dt = simulation.state.centres[0].copy(), scene.dt
    for k in range(round(seconds / dt)):
        now = k * dt
        move, normal = path(now + dt)  # where it is to be at the end of the step
        tracker.aim(home + move, normal, now)
        step = tracker.update(linear_state(simulation.compliance()), now)
        simulation.step(np.append(step.result.command, slide))
        if now >= SETTLED:
            pose = simulation.effector
            up = quaternion_matrix(pose.quaternion)[:, 2]
            rows.append((now + dt, pose.position, home + move, up, up if normal is None else normal))
            limits |= set(step.result.active_limits)
    return Followed(*(np.array(column) for column in zip(*rows, strict=True)), frozenset(limits))
