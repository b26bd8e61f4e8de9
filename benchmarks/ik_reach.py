"""How well inverse kinematics finds its targets: the whole set, beside a search that knows no Jacobian's branch.

    python benchmarks/ik_reach.py [--targets 500] [--limited 100] [--held 40] [--seeds 9 21 33] [--ways 60] [--moving]

1. Targets over the reachable set: angles drawn evenly from the range in which the strips are stretched, the equilibrium
   there is the target, every solution begins in the working pose. Error at rest, KKT residual, iterations.
2. The same and targets far outside, with angle limits that many of them need to pass: the distance that remains, beside
   the least one found by SciPy's bounded least squares from the nearest poses of a grid over all angles allowed.
3. Hard limits of torque and effector box, with several seeds, beside an independent search everywhere
   (`tests/ik/search.py`); and how many of these solutions a search from one pose alone does not find.
4. Tilts of up to 0.3 rad in all directions, at a height that has room for them.
5. Targets in all corners, slack ones too, each solved after several random ways: how far the solutions are apart.
6. Moving targets on the dynamic simulator: rms and lag, with ideal and with S90 servos. `--moving`: these alone.
"""

import argparse
import json
import sys
import time
from pathlib import Path

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
from rich.progress import track
from scipy.optimize import least_squares

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.ik.search import Limits, Search
from tests.ik.tripod_loop import circle, follow, tilting, vertical_sine
from tests.scenes import SHARP
from tripod_ik.inverse import InverseSolver, Outcome
from tripod_ik.limits import AngleLimit
from tripod_ik.model import Saved, StaticModel
from tripod_ik.rotation import normal_of, tilt_between
from tripod_ik.row_limits import EffectorBox, RowLimit, TorqueLimit
from tripod_ik.tasks import PositionTask, orientation_tasks
from tripod_ik.tracker_settings import Goal, TrackerSettings
from tripod_sim import load_scene

LOW, HIGH = -2.1, -0.6  # [rad]
NARROW = (-1.9, -1.1)  # [rad]
BOX = (np.array([-0.006, -0.005, -0.012]), np.array([0.005, 0.006, -0.004]))  # [m]
SAME = 5e-5  # [m]: as close as the search
HEIGHT = 0.008  # [m]


def sample(model: StaticModel, home: Saved, count: int, seed: int) -> list[np.ndarray]:
    found = []
    for angles in np.random.default_rng(seed).uniform(LOW, HIGH, (count, 3)):
        model.restore(home)
        found.append(model.move(angles).equilibrium.copy())
    return found


def reachable(model: StaticModel, home: Saved, count: int) -> dict[str, float]:
    solver = InverseSolver(model, AngleLimit(-2.1, 0.6))
    errors, kkt, iterations, times, limited = [], [], [], [], 0
    for target in track(sample(model, home, count, seed=6), "reachable", transient=True):
        model.restore(home)
        begin = time.thread_time()
        solution = solver.solve([PositionTask(target)])
        times.append(time.thread_time() - begin)
        kkt.append(solution.kkt)
        iterations.append(solution.iterations)
        limited += bool(solution.active_limits)
        if not solution.active_limits:
            errors.append(float(np.linalg.norm(solution.state.equilibrium - target)))
    return {
        "targets": count, "limit active": limited, "median error [mm]": 1e3 * np.median(errors),
        "worst error [mm]": 1e3 * max(errors), "worst KKT residual [rad]": max(kkt),
        "median iterations": np.median(iterations), "most iterations": max(iterations),
        "median time [ms]": 1e3 * np.median(times),
    }  # fmt: skip


def grid(model: StaticModel, count: int = 7) -> list[tuple[np.ndarray, np.ndarray, Saved]]:
    """Poses over the narrow range, each from its neighbour: angles, position, state."""
    axis, poses = np.linspace(*NARROW, count), []
    for i, a in enumerate(axis):
        for j, b in enumerate(axis[:: 1 if i % 2 == 0 else -1]):
            for c in axis[:: 1 if (i * count + j) % 2 == 0 else -1]:
                state = model.move(np.array([a, b, c]))
                poses.append((state.angles, state.equilibrium, model.save()))
    return poses


def search(model: StaticModel, poses: list, target: np.ndarray) -> float:
    """Return the least distance [m] within the narrow range."""
    order = np.argsort([np.linalg.norm(p - target) for _, p, _ in poses])
    best = np.inf
    for i in order[[0, 1, 4, 12]]:
        angles, _, saved = poses[i]
        model.restore(saved)
        found = least_squares(
            lambda a: 1e3 * (model.move(a).equilibrium - target),
            np.clip(angles, NARROW[0] + 1e-9, NARROW[1] - 1e-9),
            lambda a: 1e3 * model.move(a).jacobian[:3],
            bounds=NARROW,
            xtol=1e-12,
        )
        best = min(best, 1e-3 * float(np.linalg.norm(found.fun)))
    return best


def limited(model: StaticModel, home: Saved, count: int) -> dict[str, float]:
    poses, solver = grid(model), InverseSolver(model, AngleLimit(*NARROW))
    rng, targets = np.random.default_rng(7), sample(model, home, count // 2, seed=8)
    centre = np.array([0.0, 0.0, -0.008])
    for direction in rng.standard_normal((count - len(targets), 3)):
        targets.append(centre + rng.uniform(0.015, 0.1) * direction / np.linalg.norm(direction))
    worse, kkt, active = [], [], 0
    for target in track(targets, "limits active", transient=True):
        model.restore(home)
        solution = solver.solve([PositionTask(target)], everywhere=True)
        distance = float(np.linalg.norm(solution.state.equilibrium - target))
        if solution.outcome is Outcome.CLOSEST:
            active += 1
            worse.append(distance - search(model, poses, target))
            kkt.append(solution.kkt)
    return {
        "targets": count, "limit active": active, "median excess [mm]": 1e3 * np.median(worse),
        "worst excess [mm]": 1e3 * max(worse), "most gained on the search [mm]": -1e3 * min(worse),
        "worst KKT residual [rad]": max(kkt),
    }  # fmt: skip


def held(model: StaticModel, count: int, seeds: list[int]) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    search = Search(model, *NARROW, count=5)
    for name, limits in (
        ("box", Limits(low=BOX[0], high=BOX[1])),
        ("torques of 0.135 N m", Limits(torque=0.135)),
        ("torques of 0.14 N m and box", Limits(0.14, *BOX)),
    ):
        rules: list[RowLimit] = [TorqueLimit(limits.torque, hard=True)] if np.isfinite(limits.torque) else []
        rules += [EffectorBox(*BOX, hard=True)] if np.isfinite(limits.low).all() else []
        solver = InverseSolver(model, AngleLimit(*NARROW), row_limits=rules)
        start = max(search.poses, key=lambda pose: limits.room(pose[0])[0].min())[1]
        active, excess, beyond, alone = 0, [], [], 0
        targets = np.concatenate(
            [
                np.random.default_rng(seed).uniform(
                    [-0.012, -0.012, -0.02], [0.012, 0.012, 0.006], (count, 3)
                )
                for seed in seeds
            ]
        )
        for target in track(targets, name, transient=True):
            model.restore(start)
            near = solver.solve([PositionTask(target)])
            model.restore(start)
            solution = solver.solve([PositionTask(target)], everywhere=True)
            distance = float(np.linalg.norm(solution.state.equilibrium - target))
            active += any("torque" in n or "effector" in n for n in solution.active_limits)
            beyond.append(max(0.0, -float(limits.room(solution.state)[0].min())))
            alone += near.residual > solution.residual + SAME
            excess.append(distance - search.closest(target, limits)[0])
        rows.append({
            "limits": name, "targets": len(targets), "limit active": active,
            "as close as the search": int(np.sum(np.array(excess) < SAME)),
            "missed by a search from one pose": alone,
            "worst excess [mm]": 1e3 * max(excess), "most gained on the search [mm]": -1e3 * min(excess),
            "passed by at most [of 10 mm, 0.1 N m]": max(beyond),
        })  # fmt: skip
    return rows


def ways(model: StaticModel, home: Saved, count: int) -> dict[str, float]:
    solver, rng = InverseSolver(model, AngleLimit(-2.1, 0.6)), np.random.default_rng(5)
    apart, reached = [], 0
    for k in track(range(count), "ways", transient=True):
        angles = rng.uniform(-2.05, -0.65, 3)
        if k % 2:  # one servo or two far up: a strip hangs slack
            second = rng.uniform(-1.2, -0.6) if k % 4 == 1 else rng.uniform(-1.9, -1.4)
            angles = rng.permutation([rng.uniform(-0.9, -0.6), second, rng.uniform(-1.9, -1.4)])
        model.restore(home)
        target, ends = model.move(angles).equilibrium.copy(), []
        for _ in range(3):
            model.restore(home)
            for detour in rng.uniform(-2.1, -0.6, (2, 3)):
                model.move(detour)
            solution = solver.solve([PositionTask(target)])
            ends.append(solution.state.angles)
            reached += solution.outcome is Outcome.REACHED
        apart.append(float(np.ptp(ends, axis=0).max()))
    return {
        "targets": count, "ways to each": 3, "reached": reached,
        "solutions farther apart than 1e-5 rad": int(np.sum(np.array(apart) > 1e-5)), "most [rad]": max(apart),
    }  # fmt: skip


def tilts(model: StaticModel, home: Saved) -> dict[str, float]:
    solver, errors = InverseSolver(model, AngleLimit(-2.1, 0.6)), []
    model.restore(home)
    solver.solve(orientation_tasks(np.array([0.0, 0.0, 1.0]), HEIGHT))
    start = model.save()
    for roll in np.linspace(-0.3, 0.3, 7):
        for pitch in np.linspace(-0.3, 0.3, 7):
            model.restore(start)
            normal = normal_of(roll, pitch)
            solution = solver.solve(orientation_tasks(normal, HEIGHT))
            found = solution.state.equilibrium_rotation[:, 2]
            errors.append(np.degrees(np.linalg.norm(tilt_between(found, normal))))
    return {
        "tilts": len(errors), "rms error [degrees]": float(np.sqrt(np.mean(np.square(errors)))),
        "worst error [degrees]": max(errors),
    }  # fmt: skip


def moving() -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    s90 = ("servo_dynamics={}",)
    for name, path, overrides, lead in (
        ("circle of 10 mm, 2 s; ideal servos", circle, (), 0.0),
        ("vertical sine of 6 mm, 2 s; ideal servos", vertical_sine, (), 0.0),
        ("circle; S90 servos", circle, s90, 0.0),
        ("circle; S90 servos, lead 20 ms", circle, s90, 0.02),
        ("vertical sine; S90 servos", vertical_sine, s90, 0.0),
        ("vertical sine; S90 servos, lead 20 ms", vertical_sine, s90, 0.02),
    ):
        found = follow(path, TrackerSettings(angle_speed=10.0, lead=lead), overrides, seconds=6.0)
        rows.append({"path": name, "rms [mm]": 1e3 * found.rms, "lag [ms]": 1e3 * found.lag(path)})
    for name, overrides in (("ideal servos", ()), ("ideal servos, Newton's steps", ("solver.mode=newton",))):
        settings = TrackerSettings(goal=Goal.ORIENTATION, angle_speed=10.0)
        found = follow(tilting, settings, overrides, seconds=6.0)
        rows.append({"path": f"tilt of 0.3 rad, 4 s; {name}", "rms [degrees]": np.degrees(found.tilt_rms)})
    return rows


def show_moving() -> list[dict[str, object]]:
    rows = moving()
    print("\nmoving targets, dynamic simulator at 5 ms")
    for row in rows:
        figures = ", ".join(f"{k} {v:.3g}" for k, v in row.items() if k != "path")
        print(f"  {row['path']:44s} {figures}")
    return rows


def show(title: str, values: dict[str, float]) -> None:
    print(f"\n{title}")
    for name, value in values.items():
        print(f"  {name:34s} {value:.4g}")


def main() -> None:
    parser = argparse.ArgumentParser(description="accuracy of inverse kinematics over the reachable set")
    parser.add_argument("--targets", type=int, default=500)
    parser.add_argument("--limited", type=int, default=100)
    parser.add_argument("--held", type=int, default=40)
    parser.add_argument("--seeds", type=int, nargs="+", default=[9, 21, 33])
    parser.add_argument("--ways", type=int, default=60)
    parser.add_argument("--moving", action="store_true", help="moving targets only")
    parser.add_argument("--json", type=Path, help="write all figures here")
    wanted = parser.parse_args()
    print(f"calibration: 1000 x 1000 float64 product {1e3 * calibration():.1f} ms")
    if wanted.moving:
        rows = show_moving()
        if wanted.json:
            wanted.json.write_text(json.dumps({"moving": rows}, indent=1, default=float))
        return
    model = StaticModel(load_scene(SHARP))
    home = model.save()
    found = {"reachable": reachable(model, home, wanted.targets)}
    show("targets over the reachable set", found["reachable"])
    found["limited"] = limited(model, home, wanted.limited)
    show(f"angles within {NARROW[0]} to {NARROW[1]} rad", found["limited"])
    bounds = held(StaticModel(load_scene(SHARP)), wanted.held, wanted.seeds)
    for row in bounds:
        show(str(row["limits"]), {k: v for k, v in row.items() if k != "limits"})  # type: ignore[misc]
    found["tilts"] = tilts(model, home)
    show(f"tilts within 0.3 rad of roll and pitch, at {1e3 * HEIGHT:g} mm", found["tilts"])
    found["ways"] = ways(model, home, wanted.ways)
    show("random ways to targets in all corners", found["ways"])
    rows = show_moving()
    if wanted.json:
        wanted.json.write_text(json.dumps({**found, "held": bounds, "moving": rows}, indent=1, default=float))


if __name__ == "__main__":
    main()
