"""The maze up to the ball's first bounce: mesh, integrator, step and the ball's own step, against the ball's path."""

from tripod_sim.study.plan import Knob, Plan, Point, Quantity, Reference, Settings, grid, unique

SCENE = "maze"

WORK, SLIDE, TURN, RAMP = -1.4965, 0.035, 0.1, 0.030
"""Angles before [rad], slide [m], the move of servo 0 [rad], which tilts the plate, and the time it takes [s]."""

DURATION, INTERVAL = 0.2, 0.005
"""Of the motion and between the instants at which it is looked at [s]."""

DEFAULT: Settings = {
    "mesh.level": 2,
    "inertia.scheme": "implicit_euler",
    "dt": 0.005,
    "solver.mode": "newton",
    "ball.substep": 5e-4,
}


def rungs(_: Settings) -> tuple[Settings, ...]:
    """Return the reference: small steps on the finer mesh, and half of them on the finest."""
    fine = {**DEFAULT, "inertia.scheme": "tr_bdf2", "ball.substep": 1e-5}
    return ({**fine, "mesh.level": 3, "dt": 5e-4}, {**fine, "mesh.level": 4, "dt": 2.5e-4})


def quick_rungs(_: Settings) -> tuple[Settings, ...]:
    """Return a reference that takes seconds."""
    fine = {**DEFAULT, "inertia.scheme": "tr_bdf2", "ball.substep": 1e-4}
    return ({**fine, "dt": 0.001}, {**fine, "dt": 5e-4})


def plan(*, quick: bool) -> Plan:
    """Return the study; `quick`: few points, against a coarser reference."""
    two = ("implicit_euler", "tr_bdf2")
    points = (
        grid(DEFAULT, mesh__level=(1,), inertia__scheme=two, dt=(0.005,))
        if quick
        else [
            *grid(DEFAULT, mesh__level=(1, 2, 3), inertia__scheme=two, dt=(0.005, 0.0025, 0.001, 0.0005)),
            *grid(DEFAULT, inertia__scheme=("bdf2",), dt=(0.005, 0.0025, 0.001, 0.0005)),
            *grid(DEFAULT, inertia__scheme=("tr_bdf2",), dt=(0.001,), ball__substep=(1e-3, 5e-5, 1e-5)),
            *grid(DEFAULT, inertia__scheme=two, dt=(0.005, 0.001), solver__mode=("one_solve",)),
        ]
    )
    return Plan(
        name="maze",
        title="The ball in the maze, from the tilt of the plate to its first bounce",
        scene=SCENE,
        module=__name__,
        version=1,
        base={},
        knobs=(
            Knob("level", "mesh.level", "resolution of the mesh"),
            Knob("scheme", "inertia.scheme", "time integrator"),
            Knob("dt", "dt", "time step [s]"),
            Knob("mode", "solver.mode", "Newton to the tolerance, or one linear solve a stage"),
            Knob("substep", "ball.substep", "longest part of a step in which the ball moves [s]"),
        ),
        default=DEFAULT,
        points=unique([Point(DEFAULT, "maze as shipped"), *points]),
        quantities=(
            Quantity("path", "m", "the ball's centre in the plate's frame until its first bounce"),
            Quantity("bounce", "s", "time of the first bounce", scale="largest"),
            Quantity("place", "m", "the ball's centre in world at the first bounce", scale="largest"),
        ),
        references=(Reference("reference", quick_rungs if quick else rungs),),
        group="inertia.scheme",
        quick=quick,
        limit=300.0,
    )
