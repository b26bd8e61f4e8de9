"""A recorded session as the arrays of a run, which pages are made of."""

from collections.abc import Callable
from typing import Any

import numpy as np

from tripod_record.segments import Segment
from tripod_runtime.resimulation import Ended, Resimulation
from tripod_study.recording import Recording

PICTURES = 1500
"""Of a page; longer recordings have fewer a second."""

RATE = 50.0
"""Pictures a second of shorter ones."""


def session_arrays(
    resimulation: Resimulation,
    segment: Segment,
    progress: Callable[[float], None] | None = None,
    *,
    forces: bool = False,
    mesh_error: bool = False,
) -> dict[str, Any]:
    """Make the session again and return its pictures; time goes on where the simulation was reset.

    `forces`, `mesh_error`: whether these are there, too; see `Recording`.

    Raises SceneError, StepError.
    """
    simulation, length = resimulation.simulation, max(1e-9 * (segment.end - segment.start), 1e-9)
    recording = Recording(simulation, PICTURES + 2, forces=forces, mesh_error=mesh_error)
    every = max(1, round(max(1 / RATE, length / PICTURES) / simulation.scene.dt))
    times: list[float] = []
    while recording.count < PICTURES + 2:
        try:
            joints = resimulation.joints()
        except Ended:
            break
        simulation.step(joints)
        resimulation.compare()
        if (resimulation.outcome.steps - 1) % every == 0:
            recording.add(simulation)
            times.append(resimulation.outcome.steps * simulation.scene.dt)
            if progress:
                progress(min(1.0, max(0.0, 1e-9 * (resimulation.stamp - segment.start) / length)))
    return recording.arrays() | {"time": np.array(times)}
