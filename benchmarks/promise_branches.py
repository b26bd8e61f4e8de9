"""Why the Tripod at rest errs by far more in some cases than in others: whether there is a second equilibrium.

    python benchmarks/promise_branches.py            # prints the table
    python benchmarks/promise_branches.py --write    # into docs/accuracy.md

A case of `accuracy_promise.py --only tripod_static` is a pose, and another after servo 0 has moved. Both are reached
here from several sides as well, `WAYS`, in ten parts each, on the mesh that is picked for 5 % and on the one that cases
are held against; poses of the effector further apart than `APART` are equilibria of their own. `counted` is the error
as the promise counts it, of the pose where the motion of the case leads; `same` is how far that is from the nearest
equilibrium of the finer mesh. Both in percent of the study's scale.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks.calibration import calibration  # noqa: F401 - it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from benchmarks.accuracy_promise import ROOT, reference_of
from benchmarks.doc_parts import write_part
from benchmarks.promise_cases import KINDS, Case
from tripod_sim import Simulation, StepError, load_scene
from tripod_sim.stability_margin import LOW_MARGIN
from tripod_study.accuracy.choice import pick
from tripod_study.accuracy.stored import StoredPoint, read_study

STUDY = ROOT / "tripod_study" / "studies" / "tripod_static.json"
SCALE = json.loads(STUDY.read_text(encoding="utf-8"))["quantities"][0]["scale"]
"""What errors are relative to [m]."""

CASES = range(10000, 10200)
"""Seeds of all cases."""

SEEDS = (10066, 10105, 10124, 10127)
"""Of the cases those above 5 %."""

WAYS = (
    (0.25, 0.25, 0.25, 0.0), (-0.25, -0.25, -0.25, 0.0), (0.25, 0.0, 0.0, 0.0), (-0.25, 0.0, 0.0, 0.0),
    (0.0, 0.3, 0.0, 0.0), (0.0, -0.3, 0.0, 0.0), (0.0, 0.0, 0.0, 0.006),
)  # fmt: skip
"""Where a pose is reached from: its servos [rad] and slide [m] are off by this at first."""

PARTS, APART = 10, 1e-3

Found = list[tuple[np.ndarray, float]]
"""Positions [m] and energies [J] of equilibria."""


def made(point: StoredPoint, case: Case, joints: np.ndarray | None = None) -> Simulation:
    """Return the Tripod at rest in the pose of a case, or in another."""
    words = [f"{field}={value}" for field, value in {**read_study(STUDY).base, **point.settings}.items()]
    words += case.overrides
    if joints is not None:
        words += [f"servos.angles={joints[:3].tolist()}", f"servos.slide={float(joints[3])!r}"]
    return Simulation(load_scene("tripod", words))


def equilibria(point: StoredPoint, case: Case, joints: np.ndarray) -> Found:
    """Return the equilibria in a pose that `WAYS` lead to."""
    found: Found = []
    for way in WAYS:
        begin = joints + np.array(way)
        try:
            simulation = made(point, case, begin)
            for k in range(1, PARTS + 1):
                simulation.step(begin + (joints - begin) * k / PARTS)
        except StepError:
            continue
        place, energies = simulation.state.centres[0].copy(), simulation.energies()
        if all(np.linalg.norm(place - p) > APART for p, _ in found):
            found.append((place, float(energies.strain + energies.gravity)))
    return sorted(found, key=lambda one: one[1])


def rows(seed: int, picked: StoredPoint, fine: StoredPoint) -> list[str]:
    """Return the rows of a case, its pose and the one after its move."""
    kind = KINDS["tripod_static"]
    case, lines = kind.make(seed), []
    own, reference = (made(point, case) for point in (picked, fine))
    start = own.command
    there, exact = kind.rows(own, case), kind.rows(reference, case)
    for k, (joints, name) in enumerate(((start, "start"), (own.state.joints.copy(), "after the move"))):
        coarse, finer = (equilibria(point, case, joints) for point in (picked, fine))
        counted = np.linalg.norm(there[k] - exact[k]) / SCALE
        same = min(np.linalg.norm(there[k] - place) for place, _ in finer) / SCALE
        lines.append(
            f"| {seed}, {name} | {100 * counted:.2g} | {100 * same:.2g} | {_told(coarse)} | {_told(finer)} |"
        )
    return lines


def stability_margin(seed: int, picked: StoredPoint) -> float:
    """Return the least stability margin (see `tripod_sim.stability_margin`) of a case, at its start and after its
    move."""
    kind, found = KINDS["tripod_static"], list[float]()
    case = kind.make(seed)
    simulation = made(picked, case)

    def look() -> None:
        stability_margin = simulation.compliance().stability_margin
        assert stability_margin
        found.append(stability_margin.value)

    look()
    kind.rows(simulation, case)
    look()
    return min(found)


def soft_cases(picked: StoredPoint) -> str:
    """Return in a sentence how many of all cases are soft, and how many of those that err most."""
    least = {seed: stability_margin(seed, picked) for seed in CASES}
    soft = [seed for seed, value in least.items() if value < LOW_MARGIN]
    return (
        f"The stability margin falls below {LOW_MARGIN:g} in {len(soft)} of the {len(CASES)} cases, "
        f"{len({*SEEDS} & {*soft})} of these {len(SEEDS)} among them."
    )


def _told(found: Found) -> str:
    """Return equilibria in words: the height of the effector and the energy of each."""
    return "; ".join(f"{1e3 * place[2]:.2f} mm, {1e3 * energy:.2f} mJ" for place, energy in found)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    parser.add_argument("--write", action="store_true", help="into docs/accuracy.md")
    options = parser.parse_args(arguments)
    study = read_study(STUDY)
    picked, fine = pick(study, 0.05, None), reference_of(study, ())
    table = [
        "| case | counted [%] | same [%] | equilibria, coarse: height, energy | equilibria, fine |",
        "|---|---|---|---|---|",
    ]
    print(*table, sep="\n", flush=True)
    for seed in options.seeds:
        table += rows(seed, picked, fine)
        print(*table[-2:], sep="\n", flush=True)
    table += ["", soft_cases(picked)]
    print(table[-1])
    if options.write:
        write_part(
            "accuracy.md",
            "branches",
            [*table, "", "`python benchmarks/promise_branches.py --write`."],
        )


if __name__ == "__main__":
    main()
