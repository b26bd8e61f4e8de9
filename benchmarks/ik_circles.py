"""How inverse kinematics goes round circles that leave what can be reached.

    python benchmarks/ik_circles.py                  # quick: three circles, copies of one, a minute or two
    python benchmarks/ik_circles.py --full --write   # all of the page, half an hour of CPU time
    python benchmarks/ik_circles.py --slides 12 --heights 0 --radii 8 10 --copies 0 --moving
    python benchmarks/ik_circles.py --slides 0 --radii --heights --copies 0 --moving --goals 12   # goals at random

From a start pose, the flat piece (slide 0), the working pose (slide 35 mm) or between, the quasi-static model follows
the goals of a horizontal circle about where the effector starts, 12 goals one after the other for as long as it takes,
2.4 s at most, and the start once more; the tracker asks a planner for the way, one for each slide. For each circle:

- speed: the largest of the resting effector [m/s]; snaps: moves from one command to the
  next that have no equilibria between them, followed in as little as a 300th of the move;
- reached: goals reached to 0.1 mm; longest: time to one of these [s], the planner's CPU time with it;
- others: how far from the others the effector stays [mm], at least and at most; limited by: what keeps it there;
  search: how much further at most that is than what an independent search finds [mm]: a flood over all angles, then
  SLSQP from the nearest pose of it (`tests/ik/search.py`), within the same angles, torques and stability margin. It is
  asked for one goal of those that are images of each other; apart: how far the answers to these differ in distance
  [mm].

Copies: circles at random, begun anywhere, each rotated by thirds of a turn and mirrored: six times the same goals. How
far the answers are apart, mirrored back.

Goals: so many at random about the start of each slide, 4 to 16 mm off sideways and up to 5 mm up or down, in reach and
out of it, each gone to from the start and asked of that search, too: how much farther than it, or closer, at most.

Moving: circles of these radii in the dynamic simulator, commanded as in the graph, for as long as it takes, at most 8 s
for each goal: speed of the effector, longest time until it stays within 0.5 mm of a goal that is met, how far off
others it is at the end [mm].

What is measured is kept, and not measured again when the same file is given with `--keep`: a run that was broken off
goes on. Change of the code means another file.
"""

import argparse
import json
import re
import sys
import textwrap
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
from doc_parts import DOCS, write_part

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.ik.search import Flood, Limits
from tripod_graph.names import WORKING_POSE
from tripod_ik.model import SAME, StaticModel, goes_on, linear_state
from tripod_ik.planner import JointPath, Planner
from tripod_ik.roadmap import Roadmap
from tripod_ik.snap_through import LEAST_MARGIN
from tripod_ik.state import LinearState
from tripod_ik.tasks import Task
from tripod_ik.tracker import SMOOTH, Activity, Tracker
from tripod_ik.tracker_settings import TrackerSettings
from tripod_sim import Simulation, load_scene
from tripod_sim.errors import StepError

MESH = "mesh.level=13"
DT, LONGEST = 0.02, 2.4
"""Time between commands of the quasi-static model, longest time for a goal [s]."""

MET, STILL, CALM = 1e-4, 1e-6, 0.5
"""Distance from a goal that is met [m]; turn in a step [rad] and time [s] after which a pose is taken as the end."""

NEAR, RESTED, SLOWEST = 5e-4, 2.0, 8.0
"""Distance from a goal that a body may swing about [m]; time until it rests at the start, longest for a goal [s]."""

SPEED = 4.0
"""Of the servos, as the simulator's node keeps to it [rad/s]."""

SETTINGS = TrackerSettings()
LIMITS = Limits(torque=SETTINGS.torque_max, stability_margin=LEAST_MARGIN)


def start_angles(slide: float) -> np.ndarray:
    """Return the angles [rad] at the start: in proportion to `slide` [m], so that the strips stay stretched."""
    return np.array(WORKING_POSE[:3]) * slide / WORKING_POSE[3]


def model_at(slide: float) -> StaticModel:
    """Return the model at its start."""
    return StaticModel(load_scene("tripod", [MESH]), slide, start_angles(slide))


class Timed:
    """A planner, and the CPU time of its answers [s]."""

    def __init__(self, slide: float) -> None:
        """`slide`: [m]."""
        self.finder = Planner(Roadmap.of(load_scene("tripod", [MESH]), slide), *Tracker(SETTINGS).reach)
        begin = time.thread_time()
        self.finder.prepare()
        print(
            f"poses of slide {1e3 * slide:g}: {time.thread_time() - begin:.1f} s", file=sys.stderr, flush=True
        )
        self.times: list[float] = []

    def __call__(
        self, state: LinearState, tasks: Sequence[Task], trail: Sequence[LinearState] = ()
    ) -> JointPath | None:
        """Return the way, as a tracker asks for it."""
        begin = time.thread_time()
        way = self.finder.way(state, tasks, trail)
        self.times.append(time.thread_time() - begin)
        return way


class Follower:
    """A tracker on a quasi-static model."""

    def __init__(self, model: StaticModel, guide: Timed) -> None:
        """Start where the model starts."""
        model.go_home()
        self.model, self.guide, self.now = model, guide, 0.0
        self.tracker = Tracker(SETTINGS, guide=guide, smooth=SMOOTH)
        self.speed, self.snaps = 0.0, 0
        self.kept_by: tuple[str, ...] = ()

    def go(self, goal: np.ndarray) -> tuple[LinearState, float]:
        """Go to `goal` [m]; return the state at the end and the time until it was met for good [s], thinking too."""
        asked = len(self.guide.times)
        self.tracker.aim(goal, None, self.now)
        state, begin, met, quiet = self.model.state(), self.now, np.inf, 0
        while self.now - begin < LONGEST:
            step = self.tracker.update(state, self.now)
            self.kept_by = step.result.active_limits
            self.before = self.model.save()
            before, state = state, self.model.move(step.result.command)
            self.now += DT
            self.speed = max(self.speed, float(np.linalg.norm(state.equilibrium - before.equilibrium)) / DT)
            if not (goes_on(before, state) or self._goes_there(before, state)):
                self.snaps += 1
                move = 1e3 * np.linalg.norm(state.equilibrium - before.equilibrium)
                print(
                    f"snap by {move:.1f} mm from {before.angles.round(3)} rad to {state.angles.round(3)} rad, "
                    f"stability margin {before.stability_margin:.3f} to {state.stability_margin:.3f}",
                    file=sys.stderr, flush=True,
                )  # fmt: skip
            near = np.linalg.norm(state.equilibrium - goal) <= MET
            met = min(met, self.now - begin) if near else np.inf
            still = np.abs(state.angles - before.angles).max() < STILL
            quiet = quiet + 1 if still and (near or step.activity is Activity.CLOSEST) else 0
            if quiet * DT > CALM or (near and quiet):
                break
        return state, met + sum(self.guide.times[asked:])

    def _goes_there(self, before: LinearState, after: LinearState) -> bool:
        """Return whether the body comes from one state to the next along equilibria, looked at closely."""
        look = self.guide.finder.model  # it gives up after few iterations
        look.restore(self.before)
        with suppress(StepError):
            turn = float(np.abs(after.angles - before.angles).max())
            found = look.follow(after.angles, shortest=turn / 300)
            return bool(np.abs(found.equilibrium - after.equilibrium).max() < SAME)
        return False


def azimuth(angle: float, radius: float, height: float = 0.0) -> np.ndarray:
    """Return the point of a circle at `angle` [rad]."""
    return np.array([radius * np.cos(angle), radius * np.sin(angle), height])


class Kept:
    """What is measured, by name, in a file."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self.known: dict[str, Any] = json.loads(path.read_text()) if path and path.exists() else {}

    def get(self, name: str, measure: Callable[[], Any]) -> Any:
        """Return what is known under `name`; measure it where it is not."""
        if name not in self.known:
            begin = time.process_time()
            self.known[name] = measure()
            print(f"{name}: {time.process_time() - begin:.0f} s", file=sys.stderr, flush=True)
            if self._path:
                self._path.write_text(json.dumps(self.known, indent=0))
        return self.known[name]


def circle(model: StaticModel, guide: Timed, radius: float, height: float) -> dict[str, Any]:
    """Return what one circle gave; `off` [m] and `by` for goals that are not met, by number."""
    home, follower = model.go_home().equilibrium.copy(), Follower(model, guide)
    times, off, by = [], {}, {}
    for k in range(13):
        goal = home + (azimuth(2 * np.pi * k / 12, radius, height) if k < 12 else 0.0)
        try:
            state, met = follower.go(goal)
        except StepError as error:
            return {"error": f"goal {k}: {error}"}
        if np.isfinite(met):
            times.append(met)
        else:
            off[str(k)] = float(np.linalg.norm(state.equilibrium - goal))
            by[str(k)] = follower.kept_by
    return {
        "speed": follower.speed, "snaps": follower.snaps, "met": len(times), "longest": max(times, default=0.0),
        "off": off, "by": by,
    }  # fmt: skip


def kind(number: int) -> int:
    """Return which of the goals 0, 1, 2 goal `number` is an image of, by a third of a turn or mirrored."""
    return min(number % 4, 4 - number % 4)


def circle_row(found: dict[str, Any], least: dict[int, float]) -> str:
    """Return the cells of a circle; `least`: what the search finds for goals 0 to 2 [m]."""
    if "error" in found:
        return found["error"] + " |" * 7
    off = {int(k): d for k, d in found["off"].items()}
    cells = [f"{found['speed']:.3f}", found["snaps"], f"{found['met']} of 13", f"{found['longest']:.2f}"]
    if not off:
        return " | ".join(str(cell) for cell in [*cells, "", "", "", ""])
    kinds = {kind(k) for k in off}
    apart = max(float(np.ptp([off.get(k, 0.0) for k in range(12) if kind(k) == i])) for i in kinds)
    worse = max((d - least[kind(k)] for k, d in off.items() if kind(k) in least), default=np.nan)
    names = sorted({name.split()[-1] if "servo" not in name else " ".join(name.split()[1:]) for names in
                    found["by"].values() for name in names} or {"fold"})  # fmt: skip
    cells += [f"{1e3 * min(off.values()):.3f} to {1e3 * max(off.values()):.3f}", ", ".join(names)]
    cells += [f"{1e3 * worse:.3f}" if np.isfinite(worse) else "", f"{1e3 * apart:.4f}"]
    return " | ".join(str(cell) for cell in cells)


def image(points: np.ndarray, turn: int, *, mirrored: bool) -> np.ndarray:
    """Return points, shape (k, 3), rotated by a third of a turn `turn` times, mirrored at the plane y = 0 before."""
    points = points * [1, -1 if mirrored else 1, 1]
    c, s = np.cos(2 * np.pi * turn / 3), np.sin(2 * np.pi * turn / 3)
    return points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def copies(slide: float, guide: Timed, number: int) -> dict[str, float]:
    """Return how far answers to rotated and mirrored goals are apart [m], and where the circle is."""
    rng = np.random.default_rng(16 + number)
    radius, height, phase = rng.uniform(0.006, 0.012), rng.uniform(-0.002, 0.002), rng.uniform(0, 2 * np.pi)
    model = model_at(slide)
    goals = np.array([azimuth(phase + 2 * np.pi * k / 6, radius, height) for k in range(6)])
    answers, met = [], 0
    for mirrored in (False, True):
        for turn in range(3):
            follower, home = Follower(model, guide), model.go_home().equilibrium
            there = image(goals, turn, mirrored=mirrored)
            ends = np.array([follower.go(home + goal)[0].equilibrium - home for goal in there])
            met += int((np.linalg.norm(ends - there, axis=1) < MET).sum())
            answers.append(image(image(ends, -turn, mirrored=False), 0, mirrored=mirrored))
    apart = np.linalg.norm(np.ptp(answers, axis=0), axis=1).max()
    return {"radius": radius, "height": height, "phase": phase, "apart": float(apart), "met": met}


def moving(slide: float, guide: Timed, radius: float, height: float) -> list[tuple[float, float, float]]:
    """Return what each goal of a circle gives in the dynamic simulator, which begins at rest.

    Largest speed [m/s], time until it stays within `NEAR` of the goal [s], distance at the end [m].
    """
    angles = ", ".join(f"{a:.9f}" for a in start_angles(slide))
    simulation = Simulation(
        load_scene("tripod", [MESH, f"servos.angles=[{angles}]", f"servos.slide={slide}"])
    )
    dt, now, rows = simulation.scene.dt, 0.0, []
    joints, every = simulation.state.joints.copy(), round(DT / dt)
    for _ in range(round(RESTED / dt)):
        simulation.step(joints)
    home, command = simulation.state.centres[0].copy(), joints[:3].copy()
    tracker = Tracker(SETTINGS, guide=guide, smooth=SMOOTH)
    for k in range(13):
        goal = home + (azimuth(2 * np.pi * k / 12, radius, height) if k < 12 else 0.0)
        tracker.aim(goal, None, now)
        speed, begin, near, quiet, step = 0.0, now, np.inf, 0.0, 0
        while now - begin < SLOWEST and quiet < CALM:
            before = simulation.state.centres[0].copy()
            if step % every == 0:
                last, told = command, tracker.update(linear_state(simulation.compliance()), now)
                command = told.result.command
                still = np.abs(command - last).max() < STILL and (
                    near < np.inf or told.activity is Activity.CLOSEST
                )
                quiet = quiet + DT if still else 0.0
            left = every - step % every  # steps until the command is to be met
            joints[:3] += np.clip((command - joints[:3]) / left, -SPEED * dt, SPEED * dt)
            simulation.step(joints)
            now, step = now + dt, step + 1
            speed = max(speed, float(np.linalg.norm(simulation.state.centres[0] - before)) / dt)
            off = float(np.linalg.norm(simulation.state.centres[0] - goal))
            near = min(near, now - begin) if off < NEAR else np.inf
        rows.append((speed, near, off))
    return rows


class Slide:
    """All of one slide: model, planner and search, each made when it is needed."""

    def __init__(self, slide: float, kept: Kept) -> None:
        """`slide`: [mm]."""
        self.name, self._slide, self._kept = f"slide {slide:g}", slide / 1e3, kept
        self._model: StaticModel | None = None
        self._guide: Timed | None = None
        self._flood: Flood | None = None

    @property
    def guide(self) -> Timed:
        """The planner."""
        if self._guide is None:
            self._guide = Timed(self._slide)
        return self._guide

    def circle(self, height: float, radius: float) -> dict[str, Any]:
        """Return what a circle gives; [mm]."""
        if self._model is None:
            self._model = model_at(self._slide)
        return circle(self._model, self.guide, radius / 1e3, height / 1e3)

    def moving(self, heights: list[float], radii: list[float]) -> list[str]:
        """Return the rows of circles in the dynamic simulator."""
        rows = []
        for height in heights:
            for radius in radii:
                name = f"{self.name}, height {height:g}, radius {radius:g}, moving"
                found = self._kept.get(
                    name, lambda h=height, r=radius: moving(self._slide, self.guide, r / 1e3, h / 1e3)
                )
                off = [d for _, _, d in found if d > MET]
                longest = max((t for _, t, d in found if d <= MET), default=np.nan)
                speed, far = max(v for v, _, _ in found), ", ".join(f"{1e3 * d:.3f}" for d in off)
                cells = (f"{speed:.3f}", f"{len(found) - len(off)} of 13", f"{longest:.2f}", far)
                rows.append(f"| {self.name[6:]}, {height:g}, {radius:g} | {' | '.join(cells)} |")
                print(rows[-1], flush=True)
        return rows

    def search(self, goal: np.ndarray) -> float:
        """Return how near to a goal, from the start, the search comes [m]."""
        if self._flood is None:
            model = Flood.model(load_scene("tripod", [MESH]), self._slide, start_angles(self._slide))
            self._flood = Flood(
                model, SETTINGS.angle_min, SETTINGS.angle_max, LIMITS, spacing=0.2, within=0.016
            )
            print(f"{len(self._flood.poses)} poses in the search's flood", file=sys.stderr, flush=True)
        return float(self._flood.closest(self._flood.poses[0][0].equilibrium + goal, LIMITS)[0])

    def goal(self, number: int) -> dict[str, float]:
        """Return how near to a goal at random, from the start, the robot and the search come [m]."""
        rng = np.random.default_rng([140, number])
        goal = azimuth(rng.uniform(0, 2 * np.pi), rng.uniform(0.004, 0.016), rng.uniform(-0.005, 0.005))
        if self._model is None:
            self._model = model_at(self._slide)
        follower = Follower(self._model, self.guide)
        there = self._model.go_home().equilibrium + goal
        off = float(np.linalg.norm(follower.go(there)[0].equilibrium - there))
        return {"off": off, "search": self.search(goal), "snaps": follower.snaps}

    def goals(self, count: int) -> str:
        """Return the row of goals at random."""
        found = [self._kept.get(f"{self.name}, goal {k}", lambda k=k: self.goal(k)) for k in range(count)]
        off = [one["off"] for one in found]
        more = [one["off"] - one["search"] for one in found]
        row = (
            f"| {self.name[6:]} | {count} | {sum(d <= MET for d in off)} | {1e3 * max(off):.2f} | "
            f"{1e3 * max(0.0, *more):.4f} | {1e3 * max(0.0, *(-m for m in more)):.4f} |"
        )
        print(row, flush=True)
        return row

    def rows(self, heights: list[float], radii: list[float], *, search: bool) -> list[str]:
        """Return the rows of the table, those with a number of copies last."""
        rows = []
        for height in heights:
            for radius in radii:
                name = f"{self.name}, height {height:g}, radius {radius:g}"
                found = self._kept.get(name, lambda h=height, r=radius: self.circle(h, r))
                least = {}
                for i in sorted({kind(int(k)) for k in found.get("off", {})}):
                    known = f"{name}, search {i}"
                    if search or known in self._kept.known:
                        goal = azimuth(np.pi * i / 6, radius / 1e3, height / 1e3)
                        least[i] = self._kept.get(known, lambda goal=goal: self.search(goal))
                rows.append(f"| {self.name[6:]}, {height:g}, {radius:g} | {circle_row(found, least)} |")
                print(rows[-1], flush=True)
        return rows

    def copies(self, number: int) -> str:
        """Return the row of the copies with that number."""
        found = self._kept.get(
            f"{self.name}, copies {number}", lambda: copies(self._slide, self.guide, number)
        )
        row = (
            f"| {self.name[6:]}, {1e3 * found['height']:.2f}, {1e3 * found['radius']:.1f} mm, "
            f"{np.degrees(found['phase']):.0f} degrees | 6 | {found['met']} of 36 | {1e3 * found['apart']:.4f} |"
        )
        print(row, flush=True)
        return row


HEADS = {
    "circles": ["| slide, height, radius [mm] | speed [m/s] | snaps | reached | longest [s] | others: distance [mm] | "
                "limited by | search [mm] | apart [mm] |", "|---|---|---|---|---|---|---|---|---|"],
    "copies": ["| slide, height, radius, start | copies | reached | answers differ by [mm] |", "|---|---|---|---|"],
    "goals": ["| slide [mm] | goals | reached | largest distance [mm] | further than the search [mm] | closer [mm] |",
              "|---|---|---|---|---|---|"],
    "moving": ["| slide, height, radius [mm] | speed [m/s] | reached | longest [s] | others: distance [mm] |",
               "|---|---|---|---|---|"],
}  # fmt: skip
PAGE = "inverse_kinematics_measured.md"


def summary(text: str) -> str:
    """Return what the tables of circles in a page show, in one sentence for each table."""
    said = []
    for name, where in (("moving", "In the dynamic simulator"), ("circles", "In the quasi-static model")):
        part = text.partition(f"<!-- ik circles: {name} -->")[2].partition("<!-- end")[0]
        columns, _, *rows = (line.strip("| ").split(" | ") for line in part.strip().splitlines())
        of = {head: [row[k] if k < len(row) else "" for row in rows] for k, head in enumerate(columns)}
        reached, all_of = np.sum([[int(n) for n in cell.split(" of ")] for cell in of["reached"]], axis=0)
        others = [float(d) for cell in of["others: distance [mm]"] for d in re.findall(r"[\d.]+", cell)]
        longest, fastest = (max(map(float, of[head])) for head in ("longest [s]", "speed [m/s]"))
        said.append(
            f"{where} the robot reaches {reached} of {all_of} goals, each within {longest:.1f} s. It ends within "
            f"{max(others, default=0.0):.1f} mm of the others. The fastest effector has {fastest:.2f} m/s."
        )
    return " ".join(said)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument(
        "--full", action="store_true", help="all slides, heights, radii, 30 copies, the search"
    )
    parser.add_argument("--radii", nargs="*", type=float, help="mm")
    parser.add_argument("--slides", nargs="*", type=float, help="mm")
    parser.add_argument("--heights", nargs="*", type=float, help="mm, from the start")
    parser.add_argument("--copies", type=int, help="circles, of which there are six copies each")
    parser.add_argument("--goals", type=int, help="at random, for each slide, beside the search")
    parser.add_argument("--moving", nargs="*", type=float, help="radii [mm]")
    parser.add_argument("--search", action="store_true", help="compare with the independent search")
    parser.add_argument("--keep", type=Path, help="file of what is measured")
    parser.add_argument("--write", action="store_true", help=f"put the tables into docs/{PAGE}")
    chosen, full = parser.parse_args(), {
        "radii": [6, 8, 10, 12], "slides": [0, 35, 12, 23], "heights": [0, 2, -2], "copies": 5, "goals": 12,
        "moving": [6, 8, 10, 12],
    }  # fmt: skip
    quick = {"radii": [8], "slides": [0, 12, 35], "heights": [0], "copies": 1, "goals": 0, "moving": []}
    for name, value in (full if chosen.full else quick).items():
        if getattr(chosen, name) is None:
            setattr(chosen, name, value)
    print(f"machine: 1000 x 1000 matrix product in {1e3 * calibration():.0f} ms", file=sys.stderr)
    kept = Kept(chosen.keep)
    tables: dict[str, list[str]] = {name: [] for name in HEADS}
    slides = [Slide(slide, kept) for slide in chosen.slides]
    print(*HEADS["circles"], sep="\n")
    for slide in slides:
        tables["circles"] += slide.rows(chosen.heights, chosen.radii, search=chosen.search or chosen.full)
    print("", *HEADS["copies"], sep="\n")
    for number in range(chosen.copies):
        tables["copies"].append(slides[number % len(slides)].copies(number))
    print("", *HEADS["goals"], sep="\n")
    if chosen.goals:
        tables["goals"] = [slide.goals(chosen.goals) for slide in slides]
    print("", *HEADS["moving"], sep="\n")
    for slide in slides:
        tables["moving"] += slide.moving(chosen.heights, chosen.moving)
    if chosen.write:
        for name, rows in ((name, rows) for name, rows in tables.items() if rows):
            write_part(PAGE, f"ik circles: {name}", [*HEADS[name], *rows])
        sentences = summary((DOCS / PAGE).read_text(encoding="utf-8"))
        write_part(PAGE, "ik circles: summary", textwrap.wrap(sentences, 118))


if __name__ == "__main__":
    main()
