"""The cloth that falls on a sphere: response to contact, contact distance and step against its resting shape."""

from tripod_sim.simulation import Simulation
from tripod_sim.study.motion import Watch, motion, scene_of
from tripod_sim.study.plan import Plan, Point, Quantity, Reference, Settings, grid, knobs_of, unique
from tripod_sim.study.task import Measured

SCENE = "drape"

DURATION, INTERVAL = 1.0, 0.1
"""Of the motion and between the instants at which it is looked at [s]: the fall, and the folds that it makes."""

DEFAULT: Settings = {
    "contact.response": "lagrange",
    "contact.contact_distance": 0.002,
    "contact.alarm_distance": 0.006,
    "contact.tolerance": 1e-3,
    "dt": 0.01,
}


def near(settings: Settings, distance: float) -> dict[str, str | float | int | bool]:
    """Return settings with another contact distance and, three times as far, alarm distance [m]."""
    return {**settings, "contact.contact_distance": distance, "contact.alarm_distance": 3 * distance}


def rungs(_: Settings) -> tuple[Settings, ...]:
    """Return the reference: multipliers, small steps, a small distance."""
    return tuple({**near(DEFAULT, 5e-4), "dt": dt} for dt in (0.001, 0.0005))


def quick_rungs(_: Settings) -> tuple[Settings, ...]:
    """Return a reference that takes seconds."""
    return tuple({**DEFAULT, "dt": dt} for dt in (0.01, 0.005))


def plan(*, quick: bool) -> Plan:
    """Return the study; `quick`: few points, against a coarser reference."""
    responses = ("lagrange", "penalty")
    points = (
        grid(DEFAULT, contact__response=responses, dt=(0.02, 0.01))
        if quick
        else [
            point
            for distance in (0.0005, 0.002, 0.005)
            for point in grid(
                near(DEFAULT, distance), contact__response=responses, dt=(0.02, 0.01, 0.005, 0.002)
            )
        ]
        + grid(DEFAULT, contact__tolerance=(1e-2, 1e-1))
    )
    return Plan(
        name="drape",
        title="A cloth falls on a sphere, first second",
        scene=SCENE,
        module=__name__,
        version=2,
        base={},
        knobs=knobs_of(DEFAULT),
        default=DEFAULT,
        points=unique([Point(DEFAULT, "the default"), *points]),
        quantities=(
            Quantity(
                "nodes", "m", "positions of all nodes, root mean square, the worst instant", measure="rms"
            ),
            Quantity("shape", "m", "positions of all nodes at the end", measure="rms", scale="largest"),
        ),
        references=(Reference("reference", quick_rungs if quick else rungs),),
        group="contact.response",
        quick=quick,
        order_knob="dt",
        order_quantity="nodes",
        limit=300.0,
        note="The error is of positions, contact distance included: a cloth held 5 mm off is wrong by that.",
    )


def task(settings: Settings) -> Measured:
    """Run the motion; cost: CPU time of a simulated second."""

    def watch(simulation: Simulation) -> Watch:
        return lambda: {"nodes": simulation.positions.ravel().tolist()}

    measured = motion(scene_of(SCENE, settings), DURATION, INTERVAL, watch)
    measured.observed["shape"] = [measured.observed["nodes"][-1]]
    return measured
