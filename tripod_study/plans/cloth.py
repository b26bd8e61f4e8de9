"""The cloth, hung at two corners: time integrator, step and linear solver against small steps of RK4."""

from tripod_sim.simulation import Simulation
from tripod_study.motion import Watch, motion, scene_of
from tripod_study.plan import NODES, Plan, Quantity, Settings, always, grid, points_of
from tripod_study.task import Measured

SCENE = "cloth"

DURATION, INTERVAL = 1.0, 0.1
"""Of the motion and between the instants at which it is looked at [s]."""

DEFAULT: Settings = {
    "inertia.scheme": "implicit_euler",
    "dt": 0.005,
    "solver.mode": "newton",
    "solver.linear": "auto",
    "solver.linear_tolerance": 1e-8,
    "solver.tolerance": 1e-6,
}


RUNGS, QUICK_RUNGS = (
    [{**DEFAULT, "inertia.scheme": "rk4", "dt": dt} for dt in steps] for steps in ((2e-4, 1e-4), (5e-4, 2e-4))
)
"""The reference, RK4 with two steps, and one that takes seconds."""


def plan(*, quick: bool) -> Plan:
    """Return the study; `quick`: few points, against larger steps."""
    iterative = {**DEFAULT, "solver.linear": "cg"}
    points = (
        grid(DEFAULT, inertia__scheme=("semi_implicit_euler", "tr_bdf2"), dt=(0.01, 0.005))
        if quick
        else [
            *grid(DEFAULT, inertia__scheme=("implicit_euler", "bdf2", "tr_bdf2"), dt=(0.01, 0.005, 0.002, 0.001)),
            *grid(DEFAULT, inertia__scheme=("semi_implicit_euler", "rk4"), dt=(0.01, 0.005, 0.002, 0.001, 0.0005)),
            *grid(
                iterative, inertia__scheme=("implicit_euler", "tr_bdf2"), dt=(0.005,),
                solver__linear_tolerance=(1e-2, 1e-5, 1e-8),
            ),
            *grid(
                DEFAULT, inertia__scheme=("implicit_euler", "tr_bdf2"), dt=(0.005, 0.002),
                solver__mode=("one_solve",),
            ),
            *grid(DEFAULT, inertia__scheme=("tr_bdf2",), dt=(0.005,), solver__tolerance=(1e-4, 1e-2)),
        ]
    )  # fmt: skip
    return Plan(
        name="cloth",
        title="The cloth of 20 x 20 nodes, hung at two corners, first second",
        module=__name__,
        version=1,
        default=DEFAULT,
        points=points_of(DEFAULT, points),
        quantities=(
            NODES,
            Quantity("edge", "m", "the middle of the free edge, the worst instant of the first second"),
        ),
        references=(always(QUICK_RUNGS if quick else RUNGS),),
        quick=quick,
        order_knob="dt",
        order_quantity="nodes",
        limit=180.0,
        note="Explicit schemes divide their steps until they are stable: their error and cost follow the divided step.",
    )


def task(settings: Settings) -> Measured:
    """Run the motion; cost: CPU time of a simulated second."""

    def watch(simulation: Simulation) -> Watch:
        assert simulation.scene.springs
        n = simulation.scene.springs.nodes
        return lambda: {
            "nodes": simulation.positions.ravel().tolist(),
            "edge": simulation.positions[n // 2 - 1 : n // 2 + 1].mean(axis=0).tolist(),
        }

    return motion(scene_of(SCENE, settings), DURATION, INTERVAL, watch)
