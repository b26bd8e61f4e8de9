"""Time of one step of inverse kinematics, beside a matrix product that tells how fast this machine is.

    python benchmarks/ik.py [--steps 2000]

The loop is closed over the simulated Tripod in its working pose. The target runs through the workspace and now and
then far out of it, so that limits come and go as in use. "QP" is the update of OSQP's data, its solve, the polish and
the certificate; "step" is all that happens between compliance and command, checks and the building of the QP included;
"relinearised" is that and the compliance of the present state. Times are CPU times of the one thread that computes.
"""

import argparse
import time

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from tripod_graph.names import SERVOS, WORKING_POSE
from tripod_ik.limits import AngleLimit, SpeedLimit, StepLimit
from tripod_ik.problem import build_ik
from tripod_ik.row_limits import TorqueLimit
from tripod_ik.solver import IkSolver
from tripod_ik.state import LinearState
from tripod_ik.tasks import PositionTask
from tripod_sim import Simulation, load_scene

WARM_UP = 50
DT = 0.01  # [s]


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


def run(steps: int, torque: TorqueLimit | None) -> dict[str, np.ndarray]:
    """Return times [s], iterations and whether a limit was active of `steps` steps in closed loop."""
    limits = (AngleLimit(-2.1, 0.6), StepLimit(0.5), SpeedLimit(3.0))
    simulation, solver = in_working_pose(), IkSolver(3, rows=3 if torque else 0)
    home, command = simulation.compliance().position, simulation.state.joints[:3]
    found: dict[str, list[float]] = {
        name: [] for name in ("compliance", "relinearised", "step", "QP", "iterations", "limited")
    }
    for k in range(steps + WARM_UP):
        before = time.thread_time()
        c = simulation.compliance()
        begin = time.thread_time()
        state = LinearState(SERVOS, c.angles, c.torques, c.position, c.quaternion, c.equilibrium_offset, c.w)
        task = PositionTask(target(k, home))
        problem = build_ik(state, [task], limits, [torque] if torque else [], previous=command, dt=DT)
        built = time.thread_time()
        result = solver.solve(problem)
        end = time.thread_time()
        if not result.ok:
            raise RuntimeError(f"step {k} was not solved: {result.status}")
        if k >= WARM_UP:
            found["compliance"].append(begin - before)
            found["relinearised"].append(end - before)
            found["step"].append(end - begin)
            found["QP"].append(end - built)
            found["iterations"].append(result.iterations)
            found["limited"].append(bool(result.active_limits))
        command = result.command
        joints = simulation.state.joints.copy()
        after = np.append(command, joints[3])
        for part in (0.5, 1.0):  # two steps of 5 ms
            simulation.step(joints + part * (after - joints))
    return {name: np.array(values) for name, values in found.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description="time of one step of inverse kinematics")
    parser.add_argument("--steps", type=int, default=2000)
    steps = parser.parse_args().steps
    print(f"calibration: 1000 x 1000 float64 product {1e3 * calibration():.1f} ms")
    print(
        f"{'limits':24s}              median [ms]  p99 [ms]  max [ms]   iterations median, max   limit active"
    )
    for name, torque in (("angle, step, speed", None), ("and torque 0.15 N m", TorqueLimit(0.15))):
        found = run(steps, torque)
        for what in ("QP", "step", "compliance", "relinearised"):
            times = 1e3 * found[what]
            line = f"{name:24s} {what:12s} {np.median(times):11.3f} {np.percentile(times, 99):9.3f} {times.max():9.3f}"
            if what == "QP":
                line += f"{np.median(found['iterations']):20.0f}, {found['iterations'].max():3.0f}"
                line += f"{100 * found['limited'].mean():13.0f} %"
            print(line)


if __name__ == "__main__":
    main()
