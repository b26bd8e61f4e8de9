"""The Tripod at rest: element, mesh level, law and solver against the effector's position over the servo range."""

import time

import numpy as np

from tripod_sim.simulation import Simulation
from tripod_study.motion import scene_of
from tripod_study.plan import Plan, Point, Quantity, Settings, always, grid, points_of
from tripod_study.task import Measured, repeated

SCENE = "tripod"

BASE: Settings = {"inertia": "off", "damping": "off"}

CLAMP = "{stiffness=1.4e10}"
"""The scene's compliant clamp, that of docs/accuracy.md, 4 G / h²: at the edge of the sharp one the solution is
singular, and no mesh known to 0.1 %."""

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

DEFAULT: Settings = {
    "mesh.element": "h20",
    "mesh.level": 8,
    "clamp": CLAMP,
    "material.law": "neo_hooke",
    "solver.linear": "auto",
    "solver.tolerance": 1e-4,
    "solver.max_turn": 0.1,
}


LINEAR: Settings = {**DEFAULT, "mesh.element": "h8_modes", "mesh.level": 12}


FINE: Settings = {**DEFAULT, "solver.max_turn": 0.3}
RUNGS: list[Settings] = [
    {**FINE, "mesh.element": "h27", "solver.tolerance": 1e-5, "mesh.level": level} for level in (8, 9, 10)
]
QUICK_RUNGS: list[Settings] = [{**FINE, "mesh.level": level} for level in (8, 9)]
"""The reference's meshes, H27, edges as 1 to 1/2 to 1/3; and some that take seconds."""


def plan(*, quick: bool) -> Plan:
    """Return the study; `quick`: few points, against a coarser reference."""
    sofa = Point(
        {**LINEAR, "mesh.element": "t4", "mesh.level": 5, "material.law": "corotational"},
        "sofa (coarse)",
    )
    if quick:
        points = [
            *grid({**DEFAULT, "solver.max_turn": 0.3}, mesh__element=("h8_modes",), mesh__level=(1, 8)),
            *grid({**DEFAULT, "solver.max_turn": 0.3}, mesh__element=("h20",), mesh__level=(1, 8)),
        ]
    else:
        turn = {**LINEAR, "solver.max_turn": 0.3}
        points = [
            *grid(LINEAR, mesh__level=(1, 2, 3, 8, 12), solver__max_turn=(0.1, 0.3)),
            *grid(LINEAR, solver__tolerance=(1e-2, 1e-4, 1e-6)),
            *grid(LINEAR, solver__linear=("ldl", "cg")),
            *grid(DEFAULT, solver__tolerance=(1e-2, 1e-4, 1e-6)),
            *grid(DEFAULT, mesh__level=(13,), solver__max_turn=(0.1, 0.3)),
            *grid(LINEAR, material__law=("neo_hooke", "stable_neo_hooke", "corotational")),
            *grid(turn, mesh__element=("h8_modes",), mesh__level=(4, 9)),
            *grid(turn, mesh__element=("h8_mean", "h8", "t10"), mesh__level=(1, 2)),
            *grid(turn, mesh__element=("h8_mean",), mesh__level=(8, 9)),
            *grid(turn, mesh__element=("h20",), mesh__level=(1, 2, 8, 9, 10)),
            *grid({**turn, "mesh.element": "h20"}, mesh__level=(8, 9), solver__tolerance=(1e-2, 1e-3)),
            *grid(turn, mesh__element=("h8_modes", "h20"), mesh__level=(8, 9), solver__max_turn=(0.6,)),
            *grid(turn, mesh__element=("h27",), mesh__level=(1, 8, 9)),
            *grid(turn, mesh__element=("t4",), mesh__level=(1, 5, 6, 7)),
            *grid(turn, mesh__element=("t4",), mesh__level=(5, 6), material__law=("corotational",)),
        ]
    return Plan(
        name="tripod_static",
        title="The Tripod at rest, seven poses and loads over the servo range",
        scene=SCENE,
        module=__name__,
        version=1,
        base=BASE,
        default=DEFAULT,
        points=points_of(DEFAULT, [sofa, *points]),
        quantities=(
            Quantity("effector", "m", "position of the effector, the worst of all poses"),
            Quantity("torque", "N m", "torques of the servos", scale="largest"),
            Quantity("energy", "J", "strain energy", scale="largest"),
        ),
        references=(
            always(QUICK_RUNGS, order=2.0, sizes=(1.0, 1 / 2))
            if quick
            else always(RUNGS, order=2.0, sizes=(1.0, 1 / 2, 1 / 3)),
        ),
        solves=True,
        group="mesh.element",
        quick=quick,
        limit=1500.0,
        note="With the compliant clamp (clamp.stiffness = 1.4e10): the sharp clamp's reference is known to 1 % only, "
        "see docs/accuracy.md. A solve goes from one pose to the next, up to 1.5 rad.",
    )


def task(settings: Settings) -> Measured:
    """Solve all poses; cost: CPU time of one, from the pose before."""
    simulation = Simulation(scene_of(SCENE, {**BASE, **settings}))
    observed: dict[str, list[list[float]]] = {"effector": [], "torque": [], "energy": []}

    def note(found: Simulation) -> None:
        observed["effector"].append(found.state.centres[0].tolist())
        observed["torque"].append(found.torques.tolist())
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
    note(Simulation(scene_of(SCENE, {**BASE, **settings, **wall})))
    return Measured(observed, cpu, sum(len(chain) - 1 for chain in POSES), simulation.unknowns)
