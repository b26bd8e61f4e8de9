"""The silicone piece, held at one end and let go: mesh, law, integrator, step against the ends of the free strips."""

import numpy as np

from tripod_sim.simulation import Simulation
from tripod_study.motion import Watch, motion, scene_of
from tripod_study.plan import Plan, Quantity, Settings, always, grid, points_of
from tripod_study.task import Measured

SCENE = "silicone"

DURATION, INTERVAL = 0.3, 0.02
"""Of the motion and between the instants at which it is looked at [s]."""

DEFAULT: Settings = {
    "mesh.element": "h8_modes",
    "mesh.level": 2,
    "material.law": "neo_hooke",
    "inertia.scheme": "implicit_euler",
    "dt": 0.005,
}


FINE: Settings = {**DEFAULT, "inertia.scheme": "tr_bdf2"}
RUNGS: list[Settings] = [{**FINE, "dt": 0.001, "mesh.element": e, "mesh.level": 9} for e in ("h20", "h27")]
QUICK_RUNGS: list[Settings] = [{**FINE, "dt": 0.004, "mesh.level": level} for level in (2, 3)]
"""The reference, two elements that converge to the same, and small steps; and one that takes seconds."""


def plan(*, quick: bool) -> Plan:
    """Return the study; `quick`: few points, against a coarser reference."""
    two = ("implicit_euler", "tr_bdf2")
    points = (
        grid(DEFAULT, mesh__level=(1, 2), inertia__scheme=two, dt=(0.01, 0.005))
        if quick
        else [
            *grid(
                DEFAULT, mesh__level=(1, 2, 4), inertia__scheme=(*two, "bdf2"), dt=(0.02, 0.01, 0.005, 0.002)
            ),
            *grid(DEFAULT, inertia__scheme=("tr_bdf2",), material__law=("stable_neo_hooke", "corotational")),
            *grid(DEFAULT, mesh__element=("h20",), mesh__level=(1, 2), inertia__scheme=two, dt=(0.01, 0.005)),
            *grid(
                DEFAULT,
                mesh__element=("h8_mean",),
                mesh__level=(1, 9),
                inertia__scheme=("tr_bdf2",),
                dt=(0.01,),
            ),
            *grid(
                DEFAULT, mesh__element=("h27",), mesh__level=(1, 8), inertia__scheme=("tr_bdf2",), dt=(0.005,)
            ),
            *grid(DEFAULT, mesh__element=("t4",), mesh__level=(5, 6), inertia__scheme=two, dt=(0.01,)),
        ]
    )
    return Plan(
        name="silicone",
        title="The silicone piece, one strip held, let go from flat",
        module=__name__,
        version=1,
        default=DEFAULT,
        points=points_of(DEFAULT, points),
        quantities=(
            Quantity("tips", "m", "ends of the two free strips, the worst instant of the first 0.3 s"),
            Quantity("sag", "m", "the lower of them at the end of the motion", scale="largest"),
        ),
        references=(always(QUICK_RUNGS if quick else RUNGS),),
        group="mesh.element",
        quick=quick,
        limit=600.0,
    )


def tip_nodes(nodes: np.ndarray) -> list[np.ndarray]:
    """Return the corner nodes of the end faces of strips 1 and 2, which every mesh has."""
    found = []
    for i in (1, 2):
        azimuth = 2 * np.pi * i / 3
        along = nodes[:, :2] @ np.array([np.cos(azimuth), np.sin(azimuth)])
        across = nodes[:, :2] @ np.array([-np.sin(azimuth), np.cos(azimuth)])
        end = along > along.max() - 1e-6
        wide = np.abs(across) > np.abs(across[end]).max() - 1e-6
        high = np.abs(nodes[:, 2]) > np.abs(nodes[:, 2]).max() - 1e-6
        found.append(np.flatnonzero(end & wide & high))
    return found


def task(settings: Settings) -> Measured:
    """Run the motion; cost: CPU time of a simulated second."""

    def watch(simulation: Simulation) -> Watch:
        tips = tip_nodes(simulation.mesh.nodes)

        def look() -> dict[str, list[float]]:
            x = simulation.positions
            return {"tips": np.concatenate([x[t].mean(axis=0) for t in tips]).tolist()}

        return look

    measured = motion(scene_of(SCENE, settings), DURATION, INTERVAL, watch)
    last = measured.observed["tips"][-1]
    measured.observed["sag"] = [[min(last[2], last[5])]]
    return measured
