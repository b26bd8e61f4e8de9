"""The pendulum: time integrators and steps against DOP853 on equations written here; the course report's variations."""

import time
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from tripod_host.arrays import FloatArray
from tripod_sim.errors import StepError
from tripod_sim.scene_file import load_scene
from tripod_sim.simulation import Simulation
from tripod_sim.tables.bodies import Springs
from tripod_study import report as table
from tripod_study.motion import motion, nodes, scene_of
from tripod_study.plan import NODES, Plan, Quantity, Settings, always, grid, points_of
from tripod_study.task import Measured

SCENE = "pendulum"

DURATION, INTERVAL = 1.0, 0.05
"""Of the motion and between the instants at which it is looked at [s]: a swing through and up again; later the chain
whips, and errors grow by themselves."""

EXACT = "reference.dop853"
"""Not a field of the scene: the relative and absolute tolerance of DOP853, which then takes the place of a scheme."""

DEFAULT: Settings = {
    "inertia.scheme": "semi_implicit_euler",
    "inertia.substeps": "auto",
    "dt": 0.005,
    "solver.tolerance": 1e-8,
}

SCHEMES = ("semi_implicit_euler", "explicit_euler", "rk4", "implicit_euler", "bdf2", "tr_bdf2")

STEPS = (0.01, 0.005, 0.002, 0.001, 0.0005, 0.0002, 0.0001)


RUNGS: list[Settings] = [{EXACT: 1e-10}, {EXACT: 1e-12}]
"""The reference: DOP853 with two tolerances."""


def plan(*, quick: bool) -> Plan:
    """Return the study; `quick`: few points."""
    off = {**DEFAULT, "inertia.substeps": "off"}
    points = (
        grid(DEFAULT, inertia__scheme=("semi_implicit_euler", "rk4", "tr_bdf2"), dt=(0.005, 0.002, 0.001))
        if quick
        else [
            *grid(DEFAULT, inertia__scheme=SCHEMES, dt=STEPS),
            *grid(DEFAULT, inertia__scheme=("implicit_euler", "bdf2", "tr_bdf2"), dt=(2e-5, 5e-5)),
            *grid(
                DEFAULT, inertia__scheme=("tr_bdf2",), dt=(0.005, 0.001), solver__tolerance=(1e-6, 1e-4, 1e-2)
            ),
            *grid(off, inertia__scheme=("semi_implicit_euler",), dt=(0.05, 0.01, 0.001)),
        ]
    )
    return Plan(
        name="pendulum",
        title="The pendulum, ten nodes, first second of its swing",
        module=__name__,
        version=1,
        default=DEFAULT,
        points=points_of(DEFAULT, points),
        quantities=(
            NODES,
            Quantity("end", "m", "position of the free end, the worst instant of the first second"),
            Quantity("amplitude", "m", "largest distance of the free end from its start", scale="largest"),
            Quantity("passage", "s", "when the free end is lowest", scale="largest"),
        ),
        references=(always(RUNGS),),
        quick=quick,
        order_knob="dt",
        order_quantity="nodes",
        limit=120.0,
        note="Reference: DOP853 on the same springs. Explicit schemes divide their steps where substeps is auto: "
        "their error follows the divided step.",
    )


def exact(springs: Springs, gravity: float, tolerance: float, times: FloatArray) -> FloatArray:
    """Return the nodes of the chain at `times` by DOP853 [HairerNorsettWanner1993], shape (t, n, 3).

    Node 0 is fixed; each spring pulls with k (|d| - L) d / |d|, both ways.

    Args:
        springs: The chain.
        gravity: z component [m/s²].
        tolerance: Relative and absolute (m, m/s).
        times: Rising, from zero on [s].
    """
    n, rest = springs.nodes, springs.size / (springs.nodes - 1)

    def rate(_: float, y: FloatArray) -> FloatArray:
        x, v = y.reshape(2, n, 3)
        d = x[1:] - x[:-1]
        length = np.linalg.norm(d, axis=1, keepdims=True)
        pull = springs.stiffness * (length - rest) * d / length
        a = np.zeros((n, 3))
        a[:-1] += pull / springs.node_mass
        a[1:] -= pull / springs.node_mass
        a[:, 2] += gravity
        a[0] = 0.0
        return np.concatenate([v.ravel(), a.ravel()])

    start = np.zeros((2, n, 3))
    start[0, :, 0] = np.linspace(0.0, springs.size, n)
    done = solve_ivp(
        rate, (0.0, times[-1]), start.ravel(), method="DOP853", rtol=tolerance, atol=tolerance, t_eval=times
    )
    return np.asarray(done.y.T[:, : 3 * n].reshape(len(times), n, 3))


def _rows(positions: FloatArray) -> dict[str, list[list[float]]]:
    """Return the observations of nodes at the instants, shape (t, n, 3)."""
    scene = scene_of(SCENE, {})
    assert scene.springs
    end, start = positions[:, -1], np.array([scene.springs.size, 0.0, 0.0])
    times: FloatArray = INTERVAL * np.arange(1.0, len(positions) + 1)
    return {
        "nodes": positions.reshape(len(positions), -1).tolist(),
        "end": end.tolist(),
        "amplitude": [[float(np.linalg.norm(end - start, axis=1).max())]],
        "passage": [[_lowest(times, end[:, 2])]],
    }


def _lowest(times: FloatArray, heights: FloatArray) -> float:
    """Return when heights are least, by the parabola through the lowest of them and its neighbours."""
    i = int(np.clip(np.argmin(heights), 1, len(heights) - 2))
    a, b, c = heights[i - 1 : i + 2]
    return float(times[i] + (times[1] - times[0]) * 0.5 * (a - c) / (a - 2 * b + c))


def task(settings: Settings) -> Measured:
    """Run the motion; cost: CPU time of a simulated second."""
    if EXACT in settings:
        scene = scene_of(SCENE, {})
        assert scene.springs
        assert scene.gravity
        times: FloatArray = INTERVAL * np.arange(1.0, round(DURATION / INTERVAL) + 1)
        begin = time.thread_time()
        found = exact(scene.springs, scene.gravity.acceleration[2], float(settings[EXACT]), times)
        return Measured(_rows(found), [time.thread_time() - begin], DURATION)
    measured = motion(scene_of(SCENE, settings), DURATION, INTERVAL, nodes)
    rows = np.array(measured.observed["nodes"])
    measured.observed = _rows(rows.reshape(len(rows), -1, 3))
    return measured


BASE = {"dt": 0.005, "k": 1500.0, "m": 1.0, "g": 9.81}
"""Step [s], stiffness [N/m], mass of a node [kg], gravity [m/s²]: where one of them is varied."""

VARIED = {
    "dt": (0.4, 0.005, 1e-5),
    "k": (0.0, 0.1, 1500.0, 5000.0),
    "m": (0.001, 1.0, 5000.0),
    "g": (9.81, 1000.0),
}

REPORTED = (
    ("semi_implicit_euler", "off"),
    ("semi_implicit_euler", "auto"),
    ("rk4", "auto"),
    ("implicit_euler", ""),
    ("bdf2", ""),
    ("tr_bdf2", ""),
)
"""Time integrators, and how explicit ones divide their steps."""

LONGEST, FEWEST, LOOKS = 2.0, 20, 200
"""Simulated time [s] unless that are fewer steps than `FEWEST`; the motion is looked at `LOOKS` times."""

SHARE = 0.5
"""Energy that comes from nothing, as a share of the largest energy of motion and tension: more is not stable."""

COLUMNS = (
    table.Column("scheme", "scheme"),
    table.Column("substeps", "substeps"),
    table.STEP,
    table.STIFFNESS,
    table.Column("m", "m [kg]", lambda v: f"{v:g}"),
    table.GRAVITY,
    table.STABLE,
    table.PARTS,
    table.AMPLITUDE,
    table.DRIFT,
    table.WALL,
)
"""amplitude: of the free end; drift: change of the whole energy over the weight of the free nodes times the chain's
length. Of a run that overflowed, amplitude and drift are those before it did."""


def report(*, full: bool) -> table.Report:
    """Return the table of the course report's variations, under each time integrator; `full`: all combinations."""
    how = "all combinations" if full else "one value varied at a time"
    cases = tuple(
        {"scheme": scheme, "substeps": substeps or "-", **case}
        for case in (table.combined if full else table.one_by_one)(BASE, VARIED)
        for scheme, substeps in REPORTED
    )
    title = f"10 nodes, the first fixed, swing down from the horizontal; {how}"
    return table.Report(title, COLUMNS, cases, lambda case: measure(**case), version=1)


def measure(scheme: str, substeps: str, dt: float, k: float, m: float, g: float) -> dict[str, Any]:
    """Return what one run shows: the values of `COLUMNS` from `stable` on."""
    words = [f"dt={dt}", f"springs.stiffness={k}", f"springs.node_mass={m}", f"gravity.acceleration=[0, 0, -{g}]",
             f"inertia.scheme={scheme}"]  # fmt: skip
    if substeps not in ("", "-"):
        words.append(f"inertia.substeps={substeps}")
    scene = load_scene(SCENE, words)
    simulation = Simulation(scene)
    start = simulation.positions[-1].copy()
    assert scene.springs
    scale = (len(simulation.positions) - 1) * m * g * scene.springs.size
    steps = max(FEWEST, round(LONGEST / dt))
    chunk = max(1, steps // LOOKS)
    stable, reach, largest, growth, parts, done = True, 0.0, 0.0, 0.0, 0, 0
    begin = time.perf_counter()
    try:
        while done < steps:
            report = simulation.advance(min(chunk, steps - done))
            done, parts = simulation.state.step, parts + report.parts
            e = simulation.energies()
            growth = e.kinetic + e.strain + e.gravity
            largest = max(largest, e.kinetic + e.strain)
            reach = max(reach, float(np.linalg.norm(simulation.positions[-1] - start)))
            stable = stable and not report.grew_at and growth <= SHARE * largest + 0.01 * scale
    except StepError:
        stable = False
    wall = time.perf_counter() - begin
    return {
        "stable": stable,
        "parts": parts / done if done else 0.0,
        "amplitude": reach,
        "drift": growth / scale,
        "wall": wall / (done * dt) if done else 0.0,
    }
