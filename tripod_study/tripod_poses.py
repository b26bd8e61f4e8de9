"""The Tripod at rest, in poses and under loads over the servo range: what the study `tripod_static` measures."""

import time

import numpy as np

from tripod_sim.simulation import Simulation
from tripod_study.motion import scene_of
from tripod_study.plan import Settings
from tripod_study.task import Measured, repeated

SCENE = "tripod"

QUARTER, WORK, SLIDE = -np.pi / 4, -1.4965, 0.035

POSES = (
    ((0.0, 0.0, 0.0, 0.0), (QUARTER, 0.0, 0.0, 0.0), (QUARTER, QUARTER, QUARTER, 0.0)),
    (
        (0.0, 0.0, 0.0, 0.0),
        (WORK, WORK, WORK, SLIDE),
        (WORK + 0.3, WORK, WORK, SLIDE),
        (-1.8, -1.1, WORK, SLIDE),
    ),
)
"""Joints [rad, rad, rad, m]; each chain begins at the flat piece, which sags by its weight, and goes from one to the
next."""

SIDEWAYS = "[9.81, 0.0, 0.0]"
"""Gravity [m/s²] of one more load, in the working pose: the robot on a wall."""


def task(settings: Settings) -> Measured:
    """Solve all poses; cost: CPU time of one, from the pose before."""
    simulation = Simulation(scene_of(SCENE, settings))
    observed: dict[str, list[list[float]]] = {"effector": [], "torque": [], "energy": []}

    def note(found: Simulation) -> None:
        observed["effector"].append(found.state.centres[0].tolist())
        observed["torque"].append(found.efforts.tolist())
        observed["energy"].append([found.energies().strain])

    def run() -> float:
        cpu = 0.0
        for rows in observed.values():
            rows.clear()
        for chain in POSES:
            simulation.reset()
            for joints in chain[1:]:
                start = time.thread_time()
                simulation.step(np.array(joints))
                cpu += time.thread_time() - start
                note(simulation)
        return cpu

    cpu = repeated(run)
    simulation.reset()
    note(simulation)
    work = f"[{WORK}, {WORK}, {WORK}]"
    wall: Settings = {"gravity.acceleration": SIDEWAYS, "servos.angles": work, "servos.slide": SLIDE}
    note(Simulation(scene_of(SCENE, {**settings, **wall})))
    return Measured(observed, cpu, sum(len(chain) - 1 for chain in POSES), simulation.unknowns)
