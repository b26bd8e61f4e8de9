"""Time of one step of inverse kinematics, beside a matrix product that tells how fast this machine is.

    python benchmarks/ik.py [--steps 2000] [--lying 300]

The loop is closed over the simulated Tripod in its working pose. The target runs through the workspace and now and
then far out of it, so that limits come and go as in use. "QP" is all of the solver: the limits active last time tried
again, where they do not do the update of OSQP's data, its solve and the polish, and the certificate; "QP by OSQP" is
the same program without the first of these, solved beside it. "step" is all that happens between compliance and
command, checks and the building of the QP included; "relinearised" is that and the compliance of the present state.
After that the same with something on the robot or under it, which the compliance has to count: a ball at rest in the
maze, posts and a rigid body. Times are CPU times of the one thread that computes.
"""

import argparse
import time

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from tripod_graph.names import SERVOS, WORKING_POSE
from tripod_ik.limits import AngleLimit, SpeedLimit, StepLimit
from tripod_ik.problem import build_ik
from tripod_ik.row_limits import EffectorBox, RowLimit, TorqueLimit
from tripod_ik.solver import IkSolver
from tripod_ik.state import LinearState
from tripod_ik.tasks import PositionTask
from tripod_sim import Simulation, load_scene

WARM_UP = 50
DT = 0.01  # [s]


POST = "obstacles=[{source='cube.obj', scale=%s, position=%s}]"
TOUCH = "contact={contact_distance=5e-4, alarm_distance=1.5e-3, friction=%s, response='%s'}"
CALM = ["dt=0.02", "solver.mode=newton", "damping={mass=20.0, stiffness=2e-3}"]
UNDER_DISC, UNDER_STRIP = POST % (0.1, [0, 0, -0.0155]), POST % (0.03, [0.028, 0.001, -0.0075])
BALL = "rigid=[{shape='ball', radius=0.008, mass=0.05, position=[0.0004,0.0002,0.0115]}]"

LYING = (
    ("a ball at rest in the maze", "maze", [], None),
    ("the disc on a post, sliding", "tripod", [*CALM, UNDER_DISC, TOUCH % (0.0, "lagrange")], 0.036),
    ("the disc on a post, sticking", "tripod", [*CALM, UNDER_DISC, TOUCH % (10.0, "lagrange")], 0.036),
    ("a strip on a post, sticking", "tripod", [*CALM, UNDER_STRIP, TOUCH % (4.0, "lagrange")], 0.036),
    ("a strip on a post, by penalty", "tripod", [*CALM, UNDER_STRIP, TOUCH % (0.0, "penalty")], 0.036),
    ("a rigid ball in the disc's hole", "tripod", [*CALM, BALL, TOUCH % (0.0, "lagrange")], 0.036),
)
"""What there is, its scene with what is set, and the angle of all servos [rad]; None for that of the scene."""


def in_working_pose() -> Simulation:
    simulation = Simulation(load_scene("tripod"))
    for part in np.linspace(0.0, 1.0, 300):
        simulation.step(part * np.array(WORKING_POSE))
    for _ in range(100):
        simulation.step()
    return simulation


def target(k: int, home: np.ndarray) -> np.ndarray:
    phase = 0.02 * k
    reach = 0.1 if k % 400 > 300 else 0.005  # [m]
    return home + reach * np.array([np.cos(phase), np.sin(phase), 0.6 * np.sin(1.7 * phase)])


def limits_of(name: str, home: np.ndarray) -> list[RowLimit]:
    torque = {"none": [], "soft": [TorqueLimit(0.15)], "hard": [TorqueLimit(0.15, hard=True)]}[name]
    box = EffectorBox(home - 0.006, home + 0.006, hard=True)
    return [*torque, box] if name == "hard" else [*torque]


def run(steps: int, name: str) -> dict[str, np.ndarray]:
    """Return times [s], iterations, whether OSQP was asked and whether a limit was active, of `steps` steps."""
    limits = (AngleLimit(-2.1, 0.6), StepLimit(0.5), SpeedLimit(3.0))
    simulation = in_working_pose()
    home, command = simulation.compliance().position, simulation.state.joints[:3]
    rules = limits_of(name, home)
    solver, by_osqp = (IkSolver(3, rows=sum(rule.size(3) for rule in rules), reuse=r) for r in (True, False))
    found: dict[str, list[float]] = {
        what: []
        for what in (
            "compliance",
            "relinearised",
            "step",
            "QP",
            "QP by OSQP",
            "iterations",
            "asked",
            "limited",
        )
    }
    for k in range(steps + WARM_UP):
        before = time.thread_time()
        c = simulation.compliance()
        begin = time.thread_time()
        state = LinearState(SERVOS, c.angles, c.efforts, c.position, c.quaternion, c.equilibrium_offset, c.w)
        task = PositionTask(target(k, home))
        problem = build_ik(state, [task], limits, rules, previous=command, dt=DT)
        built = time.thread_time()
        result = solver.solve(problem)
        end = time.thread_time()
        other = by_osqp.solve(problem)
        last = time.thread_time()
        if not (result.ok and other.ok):
            raise RuntimeError(f"step {k} was not solved: {result.status}, {other.status}")
        if np.abs(result.command - other.command).max() > 1e-6:
            raise RuntimeError(f"step {k}: the two solvers differ")
        if k >= WARM_UP:
            found["compliance"].append(begin - before)
            found["relinearised"].append(end - before)
            found["step"].append(end - begin)
            found["QP"].append(end - built)
            found["QP by OSQP"].append(last - end)
            found["iterations"].append(other.iterations)
            found["asked"].append(result.iterations > 0)
            found["limited"].append(bool(result.active_limits))
        command = result.command
        joints = simulation.state.joints.copy()
        after = np.append(command, joints[3])
        for part in (0.5, 1.0):  # two steps of 5 ms
            simulation.step(joints + part * (after - joints))
    return {what: np.array(values) for what, values in found.items()}


def run_lying(
    steps: int, scene: str, words: list[str], angle: float | None
) -> tuple[np.ndarray, np.ndarray, int]:
    """Return times of the compliance and of a relinearised step [s], and how many contacts press at the end."""
    limits = (AngleLimit(-2.1, 0.6), StepLimit(0.5), SpeedLimit(3.0))
    simulation = Simulation(load_scene(scene, words))
    rest = simulation.state.joints.copy() if angle is None else np.array([angle] * 3 + [0.0])
    for k in range(150):
        simulation.step(rest if angle is None else rest * min(1.0, (k + 1) / 20))
    solver, home, command = IkSolver(3), simulation.compliance().position, rest[:3]
    taken = []
    for k in range(steps):
        begin = time.thread_time()
        c = simulation.compliance()
        known = time.thread_time()
        state = LinearState(SERVOS, c.angles, c.efforts, c.position, c.quaternion, c.equilibrium_offset, c.w)
        target = home + 1e-4 * np.array([np.cos(0.1 * k), np.sin(0.1 * k), 0.0])
        problem = build_ik(state, [PositionTask(target)], limits, previous=command, dt=DT)
        result = solver.solve(problem)
        taken.append((known - begin, time.thread_time() - begin))
        if not result.ok:
            raise RuntimeError(f"step {k} was not solved: {result.status}")
        simulation.step(rest + 1e-4 * np.sin(k) * np.array([1.0, 0.0, 0.0, 0.0]))
    if simulation.left_out:
        raise RuntimeError("the compliance leaves the rigid body out")
    contact = simulation.report.contact
    compliance, whole = np.array(taken).T
    return compliance, whole, contact.pressed if contact else 0


def main() -> None:
    parser = argparse.ArgumentParser(description="time of one step of inverse kinematics")
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument(
        "--lying", type=int, default=300, help="steps of each scene with something on the robot"
    )
    given = parser.parse_args()
    steps = given.steps
    print(f"calibration: 1000 x 1000 float64 product {1e3 * calibration():.1f} ms")
    for title, name in (
        ("angle, step, speed", "none"),
        ("and torque 0.15 N m, soft", "soft"),
        ("torque and box of 12 mm, hard", "hard"),
    ):
        found = run(steps, name)
        print(
            f"limits: {title}; active in {100 * found['limited'].mean():.0f} %; OSQP asked in "
            f"{100 * found['asked'].mean():.1f} %, its iterations: median {np.median(found['iterations']):.0f}, "
            f"most {found['iterations'].max():.0f}"
        )
        for what in ("QP", "QP by OSQP", "step", "compliance", "relinearised"):
            times = 1e3 * found[what]
            print(
                f"  {what:14s} median {np.median(times):7.3f} ms   p99 {np.percentile(times, 99):7.3f} ms   "
                f"max {times.max():7.3f} ms"
            )
    print("with something on the robot or under it:")
    for title, scene, words, angle in LYING if given.lying else ():
        *times, pressed = run_lying(given.lying, scene, words, angle)
        for what, column in zip(("compliance", "relinearised"), times, strict=True):
            median, late = 1e3 * np.median(column), 1e3 * np.percentile(column, 99)
            print(
                f"  {title:32s} {pressed:3d} press   {what:12s} median {median:6.3f} ms   p99 {late:6.3f} ms"
            )


if __name__ == "__main__":
    main()
