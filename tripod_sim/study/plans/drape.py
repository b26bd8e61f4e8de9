"""The cloth that falls on a sphere: response to contact, contact distance and step against its resting shape."""

from tripod_sim.study.motion import motion, nodes, scene_of
from tripod_sim.study.plan import NODES, Plan, Quantity, Reference, Settings, grid, points_of
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
        module=__name__,
        version=2,
        default=DEFAULT,
        points=points_of(DEFAULT, points),
        quantities=(
            NODES,
            Quantity("shape", "m", "positions of all nodes at the end", measure="rms", scale="largest"),
        ),
        references=(Reference("reference", quick_rungs if quick else rungs),),
        group="contact.response",
        quick=quick,
        order_knob="dt",
        order_quantity="nodes",
        note="The error is of positions, contact distance included: a cloth held 5 mm off is wrong by that.",
    )


def task(settings: Settings) -> Measured:
    """Run the motion; cost: CPU time of a simulated second."""
    measured = motion(scene_of(SCENE, settings), DURATION, INTERVAL, nodes)
    measured.observed["shape"] = [measured.observed["nodes"][-1]]
    return measured
