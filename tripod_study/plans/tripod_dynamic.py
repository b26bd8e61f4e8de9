"""The Tripod in motion: servo 0 turns by 0.3 rad in 30 ms from the working pose, then holds."""

import numpy as np

from tripod_sim.simulation import Simulation
from tripod_study.motion import Watch, motion, scene_of
from tripod_study.plan import Plan, Point, Quantity, Reference, Settings, grid, points_of
from tripod_study.task import Measured

SCENE = "tripod"

WORK, SLIDE, TURN, RAMP = -1.4965, 0.035, 0.3, 0.030
"""Angles before [rad], slide [m], the move of servo 0 [rad] and the time it takes [s]."""

BASE: Settings = {"servos.angles": f"[{WORK}, {WORK}, {WORK}]", "servos.slide": SLIDE}

DURATION, INTERVAL = 0.12, 0.01
"""Of the motion and between the instants at which it is looked at [s]."""

CLAMP = "{stiffness=1.4e10}"
"""The scene's compliant clamp. It is a setting, so that the draft, whose clamp is sharp, is held against it."""

DEFAULT: Settings = {
    "mesh.element": "h20",
    "mesh.level": 8,
    "clamp": CLAMP,
    "inertia.scheme": "tr_bdf2",
    "dt": 0.002,
    "solver.mode": "one_solve",
    "solver.tolerance": 1e-4,
}

LINEAR: Settings = {
    **DEFAULT,
    "mesh.element": "h8_modes",
    "mesh.level": 12,
    "inertia.scheme": "implicit_euler",
    "dt": 0.005,
}

SHARP: Settings = {**LINEAR, "mesh.level": 2, "clamp": "off"}

FINE: Settings = {"inertia.scheme": "tr_bdf2", "solver.mode": "newton", "solver.tolerance": 1e-7}


def same_mesh(settings: Settings) -> tuple[Settings, ...]:
    """Return the reference of the time error: the point's own mesh, small steps."""
    return tuple({**settings, **FINE, "dt": dt} for dt in (2e-4, 1e-4))


def finest(_: Settings) -> tuple[Settings, ...]:
    """Return the reference of the whole error: H20 with the compliant clamp, edges as 1/2 to 1/3 to 1/4, small steps.

    What limits it is the mesh, mostly how many elements are across a strip; steps of twice the length change it by less
    than 0.1 %. H27 comes from the other side, and more slowly. Factors serve many steps, iterations one.
    """
    fine = {**DEFAULT, **FINE, "solver.linear": "ldl", "solver.tolerance": 1e-6, "dt": 2.5e-4}
    return tuple({**fine, "mesh.level": level} for level in (9, 10, 11))


def quick_finest(_: Settings) -> tuple[Settings, ...]:
    """Return a reference that takes seconds."""
    fine = {**DEFAULT, **FINE, "mesh.element": "h20", "dt": 5e-4}
    return ({**fine, "mesh.level": 8}, {**fine, "mesh.level": 14})


def plan(*, quick: bool) -> Plan:
    """Return the study; `quick`: few points, against a coarser reference."""
    if quick:
        newton = {**LINEAR, "solver.mode": "newton"}
        points = [
            *grid(newton, inertia__scheme=("implicit_euler", "tr_bdf2"), dt=(0.005, 0.002, 0.001)),
        ]
    else:
        schemes, better = ("implicit_euler", "bdf2", "tr_bdf2"), ("bdf2", "tr_bdf2")
        steps = (0.01, 0.005, 0.002, 0.001, 0.0005, 0.00025)
        quadratic = {**DEFAULT, "mesh.element": "h20"}
        points = [
            *grid(SHARP, inertia__scheme=schemes, dt=(0.01, 0.005, 0.002, 0.001)),
            *grid({**LINEAR, "solver.mode": "newton"}, inertia__scheme=schemes, dt=steps),
            *grid(LINEAR, mesh__level=(2, 8, 12), inertia__scheme=schemes, dt=steps[:-1]),
            *grid(quadratic, mesh__level=(13, 8), inertia__scheme=schemes, dt=steps[1:4]),
            *grid(quadratic, mesh__level=(13, 8, 14), inertia__scheme=better, dt=(0.002, 0.001, 0.0005)),
            *grid(quadratic, mesh__level=(14,), inertia__scheme=better, dt=(0.00025,)),
            *grid(quadratic, mesh__level=(14,), inertia__scheme=("tr_bdf2",), dt=(0.000625,)),
            *grid(quadratic, mesh__level=(13,), inertia__scheme=better, dt=(0.0025, 0.01 / 3)),
            *grid(
                {**quadratic, "inertia.scheme": "tr_bdf2", "solver.mode": "newton"},
                mesh__level=(8, 14, 9),
                dt=(0.001, 0.0005),
            ),
            *grid(quadratic, mesh__level=(9,), inertia__scheme=("tr_bdf2",), dt=(0.001, 0.0005)),
        ]
    return Plan(
        name="tripod_dynamic",
        title="The Tripod in motion: servo 0 by 0.3 rad in 30 ms from the working pose",
        scene=SCENE,
        module=__name__,
        version=3,
        base=BASE,
        default=DEFAULT,
        draft=SHARP,
        points=points_of(DEFAULT, [Point(SHARP, "draft"), *points]),
        quantities=(
            Quantity(
                "move", "m", "how far the effector has moved since the start", "finest mesh", scale="largest"
            ),
            Quantity(
                "pose", "m", "where the effector is", "finest mesh",
                scale="largest", promised=True,
            ),
            Quantity(
                "move, time alone",
                "m",
                "the same as move, against the same mesh",
                "same mesh",
                scale="largest",
                rows="move",
            ),
            Quantity("torque", "N m", "torques of the servos", "finest mesh", scale="largest"),
        ),
        references=(
            Reference("finest mesh", quick_finest)
            if quick
            else Reference("finest mesh", finest, order=2.0, sizes=(1 / 2, 1 / 3, 1 / 4)),
            Reference("same mesh", same_mesh, order=2.0, sizes=(2.0, 1.0)),
        ),
        order_knob="dt",
        order_quantity="move, time alone",
        quick=quick,
        limit=7200.0,
        note="With the compliant clamp, but for the draft, whose clamp is sharp. Errors of the pose, of its "
        "distance from the flat piece, are promised beside those of the move; `time alone` leaves out what the mesh "
        "errs.",
    )  # fmt: skip


def command(time: float) -> np.ndarray:
    """Return the joints at a time [s]."""
    return np.array([WORK + TURN * min(time / RAMP, 1.0), WORK, WORK, SLIDE])


def task(settings: Settings) -> Measured:
    """Run the motion; cost: CPU time of a simulated second."""

    def watch(simulation: Simulation) -> Watch:
        start = simulation.state.centres[0].copy()
        return lambda: {
            "move": (simulation.state.centres[0] - start).tolist(),
            "pose": simulation.state.centres[0].tolist(),
            "torque": simulation.torques.tolist(),
        }

    return motion(scene_of(SCENE, {**BASE, **settings}), DURATION, INTERVAL, watch, command)
