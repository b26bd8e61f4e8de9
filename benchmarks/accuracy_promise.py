"""Whether `--accuracy` holds its promise: errors of the settings that it picks, in random cases that no study has seen.

A case is a pose and a load, or a motion from a random start; each is run with the setting for 10, 5 and 1 % and with a
reference: the cheapest point of the study that is surely three times as exact as these and as what was picked, or the
most exact there is; its bound is printed. The error is measured as the study does it: the largest deviation over the
case, over the travel (a motion) or over the study's scale (poses). `factor` is what the error in the study would have
to be multiplied by, before what the study's reference may err is added, to hold 95 % of the cases: `margin` of
tripod_sim/accuracy/choice.py has to be at least that.

    python benchmarks/accuracy_promise.py [--studies DIR] [--only tripod_dynamic] [--cases 200] [--keep cases.jsonl]

Cases that are in the file of `--keep` are not run again.
"""

import argparse
import contextlib
import hashlib
import json
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from tripod_sim import SceneError, Simulation, StepError, load_scene  # noqa: E402
from tripod_sim.accuracy.choice import asked, margin, pick  # noqa: E402
from tripod_sim.accuracy.stored import StoredPoint, StoredStudy, read_study  # noqa: E402

ACCURACIES = ("10%", "5%", "1%")

MARK, END = "## Measured", "<!-- end -->"

MORE_EXACT = 3.0
"""By how much a reference is more exact than the least accuracy and the settings that are picked."""

SPREAD = 0.3
"""Of angles about the line from the flat piece to the working pose [rad]."""

Settings = Mapping[str, Any]
Rows = np.ndarray


@dataclass(frozen=True)
class Case:
    """One random case.

    Attributes:
        overrides: Of the scene.
        seed: Of what the overrides do not say: kicks and commands.
    """

    overrides: tuple[str, ...]
    seed: int


def static_case(seed: int) -> Case:
    """Angles about the line from the flat piece to the working pose, gravity within 60 degrees of down.

    Far from that line a strip is pressed together and buckles, to the side that the mesh happens to prefer.
    """
    rng = np.random.default_rng(seed)
    share = rng.random()
    angles = -1.4965 * share + rng.uniform(-SPREAD, SPREAD, 3)
    tilt, turn = np.radians(rng.uniform(0, 60)), rng.uniform(0, 2 * np.pi)
    down = np.array([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), -np.cos(tilt)])
    g = rng.uniform(0.5, 1.5) * 9.81 * down
    return Case((*_start(angles, 0.035 * share), f"gravity.acceleration={g.tolist()}"), seed)


def static_rows(simulation: Simulation, case: Case) -> Rows:
    """The effector in the start pose and after servo 0 has moved by up to half of `SPREAD`."""
    rng = np.random.default_rng([case.seed, 1])
    rows = [simulation.state.centres[0].copy()]
    joints = simulation.command
    joints[0] += rng.uniform(-SPREAD, SPREAD) / 2
    simulation.step(joints)
    rows.append(simulation.state.centres[0].copy())
    return np.array(rows)


def dynamic_case(seed: int) -> Case:
    """A start about the working pose."""
    rng = np.random.default_rng(seed)
    angles = -1.4965 + rng.uniform(-0.25, 0.25, 3)
    return Case(_start(angles, rng.uniform(0.030, 0.035)), seed)


def dynamic_rows(simulation: Simulation, case: Case) -> Rows:
    """How far the effector has moved, each 10 ms, while one or all servos turn by up to 0.4 rad in 30 to 100 ms."""
    rng = np.random.default_rng([case.seed, 1])
    turn, ramp = rng.uniform(0.1, 0.4) * rng.choice([-1, 1]), rng.uniform(0.03, 0.1)
    moved = np.ones(3) if rng.random() < 0.3 else np.eye(3)[rng.integers(3)]
    start, origin = simulation.command, simulation.state.centres[0].copy()
    every, dt = round(0.01 / simulation.scene.dt), simulation.scene.dt
    rows = []
    for k in range(12 * every):
        joints = start.copy()
        joints[:3] = np.clip(start[:3] + turn * moved * min((k + 1) * dt / ramp, 1.0), -2.1, 0.6)
        simulation.step(joints)
        if (k + 1) % every == 0:
            rows.append(simulation.state.centres[0] - origin)
    return np.array(rows)


def kicked_case(seed: int) -> Case:
    """Springs under a random gravity."""
    g = np.random.default_rng(seed).uniform(0.5, 1.5) * 9.81
    return Case((f"gravity.acceleration=[0, 0, {-g!r}]",), seed)


def kicked_rows(simulation: Simulation, case: Case) -> Rows:
    """The positions of all nodes each 0.1 s for 1 s, after a kick that turns and throws the body."""
    rng = np.random.default_rng([case.seed, 1])
    x, free = simulation.positions, simulation._mass > 0
    spin, throw = rng.normal(0, 0.5, 3), rng.normal(0, 0.3, 3)
    simulation.state.velocities[free] = (np.cross(spin, x) + throw)[free]
    every = round(0.1 / simulation.scene.dt)
    rows = [x.ravel().copy()]
    for _ in range(10):
        simulation.advance(every)
        rows.append(simulation.positions.ravel().copy())
    return np.array(rows)


def _start(angles: np.ndarray, slide: float) -> tuple[str, ...]:
    return (f"servos.angles={angles.tolist()}", f"servos.slide={slide!r}")


KINDS: dict[str, tuple[Callable[[int], Case], Callable[[Simulation, Case], Rows]]] = {
    "tripod_static": (static_case, static_rows),
    "tripod_dynamic": (dynamic_case, dynamic_rows),
    "pendulum": (kicked_case, kicked_rows),
    "cloth": (kicked_case, kicked_rows),
}
"""How cases are made and run, by study."""


class Runner:
    """Runs cases and keeps their rows in a file."""

    def __init__(self, study: StoredStudy, keep: Path | None) -> None:
        self.study, self._keep = study, keep
        self.case, self.rows = KINDS[study.name]
        self._known: dict[str, list[list[float]] | None] = {}
        if keep and keep.exists():
            for line in keep.read_text(encoding="utf-8").splitlines():
                try:
                    record = json.loads(line)
                except ValueError:  # the last line of a run that was killed
                    continue
                self._known[record["key"]] = record["rows"]

    def run(self, settings: Settings, seed: int) -> Rows | None:
        """Return the rows of a case; None if it could not be simulated."""
        base = {k: v for k, v in self.study.base.items() if not k.startswith("servos.")}
        key = hashlib.sha256(
            json.dumps([self.study.name, base, dict(settings), seed], sort_keys=True).encode()
        ).hexdigest()
        if key not in self._known:
            case = self.case(seed)
            words = [f"{field}={value}" for field, value in {**base, **settings}.items()]
            try:
                simulation = Simulation(load_scene(self.study.scene, [*words, *case.overrides]))
                rows = self.rows(simulation, case).tolist()
            except StepError:
                rows = None
            self._known[key] = rows
            if self._keep:
                with self._keep.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"key": key, "rows": rows}) + "\n")
        rows = self._known[key]
        return None if rows is None else np.array(rows)


def error_of(rows: Rows, reference: Rows, scale: float | None) -> float:
    """Return the relative error of a case; `scale`: of poses [m], None for the case's own travel."""
    root = np.sqrt(rows.shape[1] / 3)
    norms = np.linalg.norm(rows - reference, axis=1).max() / root
    if scale is None:
        scale = max(np.linalg.norm(reference - row, axis=1).max() for row in reference) / root
    return float(norms / scale)


def reference_of(study: StoredStudy) -> StoredPoint:
    """Return the point that cases are held against."""
    least = min(float(asked(a)) for a in ACCURACIES)
    for accuracy in ACCURACIES:
        with contextlib.suppress(SceneError):
            least = min(least, pick(study, asked(accuracy), None).bound)
    exact = [p for p in study.points if MORE_EXACT * p.bound <= least]
    return min(exact, key=lambda p: p.cpu) if exact else min(study.points, key=lambda p: p.bound)


def measure(path: Path, cases: int, keep: Path | None) -> list[list[str]]:
    study, table = read_study(path), json.loads(path.read_text(encoding="utf-8"))
    runner, finest = Runner(study, keep), reference_of(study)
    fine = finest.settings
    scale = table["quantities"][0]["scale"] if study.solves else None
    print(
        f"{study.name}: reference {dict(fine)}, exact to {100 * finest.bound:.2g} %",
        file=sys.stderr,
        flush=True,
    )
    lines = []
    for accuracy in ACCURACIES:
        try:
            point = pick(study, asked(accuracy), None)
        except SceneError as error:
            lines.append([study.name, accuracy, str(error), *[""] * 9])
            continue
        errors, failed = [], 0
        for seed in range(cases):
            reference = runner.run(fine, seed)
            if reference is None:  # no case
                continue
            rows = runner.run(point.settings, seed)
            failed += rows is None
            errors.append(np.inf if rows is None else error_of(rows, reference, scale))
            if sys.stderr.isatty():
                print(f"\r{study.name} {accuracy}: {seed + 1}/{cases}", end="", file=sys.stderr, flush=True)
        found = np.array(errors)
        under = float((found <= asked(accuracy)).mean())
        high = float(np.quantile(found, 0.95, method="higher"))
        own = point.bound - point.error  # of the study's reference
        lines.append(
            [
                study.name,
                accuracy,
                ", ".join(f"{k}={v}" for k, v in point.settings.items()),
                f"{100 * point.error:.2g}",
                f"{100 * own:.2g}",
                str(len(found)),
                f"{100 * under:.1f}",
                f"{100 * np.median(found):.2g}",
                f"{100 * high:.2g}",
                f"{100 * found.max():.2g}",
                f"{max(0.0, high - own) / point.error:.2f}",
                f"{margin(study):g}",
            ]
        )
    return lines


HEADS = (
    "study",
    "asked",
    "setting",
    "its error in the study [%]",
    "of the study's reference [%]",
    "cases",
    "under the asked [%]",
    "median error [%]",
    "95 % of cases under [%]",
    "worst [%]",
    "factor",
    "margin",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--studies", type=Path, default=ROOT / "tripod_sim" / "studies", help="folder of JSON files"
    )
    parser.add_argument("--only", nargs="*", choices=list(KINDS), help="studies; all by default")
    parser.add_argument("--cases", type=int, default=200, help="of each study, seeds 0, 1, ...")
    parser.add_argument(
        "--rung", type=int, default=-1, help="which of the reference's rungs is the reference here"
    )
    parser.add_argument(
        "--keep", type=Path, help="file in which cases are kept, to go on after an interruption"
    )
    parser.add_argument(
        "--write", type=Path, help="put the table into this file, at the heading of what is measured"
    )
    arguments = parser.parse_args()
    lines = [list(HEADS), ["---"] * len(HEADS)]
    for name in arguments.only or KINDS:
        path = arguments.studies / f"{name}.json"
        if path.exists():
            lines += measure(path, arguments.cases, arguments.keep)
        else:
            print(f"{name}: no study in {arguments.studies}", file=sys.stderr)
    made = ["| " + " | ".join(line) + " |" for line in lines]
    made += ["", f"1000 x 1000 float64 product here: {1e3 * calibration():.1f} ms."]
    print("\n".join(made))
    if arguments.write:
        head, _, rest = arguments.write.read_text(encoding="utf-8").partition(MARK)
        command = f"`python benchmarks/accuracy_promise.py --write {arguments.write}` wrote this:"
        text = "\n".join([f"{head}{MARK}", "", command, "", *made, "", f"{END}{rest.partition(END)[2]}"])
        arguments.write.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
