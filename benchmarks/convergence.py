"""Errors of the Tripod's load cases for every element and mesh level, with the sharp and the compliant clamp.

Cases: L1 sag by weight, flat; L2 all servos at -45 degrees; L3 servo 0 alone at -45 degrees; L4 the working pose, all
at -1.4965 rad with the servo bodies slid 35 mm inward; L5 is L4 with servo 0 moved back by 0.3 rad, of which the move
of the effector counts. What is found goes to docs/convergence.csv, one row a mesh; rows that are there are not
computed again, so the command can be stopped and repeated; then `python benchmarks/evidence.py` renews the page.

    python benchmarks/convergence.py             # all that is missing: an hour, mostly the reference
    python benchmarks/convergence.py --quick     # without the finest meshes
    python benchmarks/convergence.py --times     # step times, on a quiet machine
"""

import argparse
import csv
import sys
import time
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks.calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from tests.scenes import SHARP
from tripod_sim import SceneError, Simulation, StepError, load_scene

TABLE = Path(__file__).resolve().parents[1] / "docs" / "convergence.csv"

STIFFNESS = 1.4e10
"""Of the compliant clamp [N/m⁴]: 4 G / h², G = E / (2 (1 + nu)), h the thickness. A strip that is glued by its two
faces and not through its thickness yields that much by the shear of its own halves, G / (h/2) per face."""

QUARTER, WORK = -np.pi / 4, -1.4965
POSES = {
    "L1": (0.0, 0.0, 0.0, 0.0),
    "L2": (QUARTER, QUARTER, QUARTER, 0.0),
    "L3": (QUARTER, 0.0, 0.0, 0.0),
    "L4": (WORK, WORK, WORK, 0.035),
    "L5": (WORK + 0.3, WORK, WORK, 0.035),
}
"""Joints [rad, rad, rad, m]."""

ELEMENTS = ("t4", "t10", "h8", "h8_mean", "h8_modes", "h20", "h20_full", "h27")

MESHES = (
    [("sharp", element, level) for level in (1, 2, 3, 4) for element in ELEMENTS]
    + [("sharp", "t4", level) for level in (5, 6, 7)]
    + [("compliant", element, level) for level in (1, 2, 3, 4, 8, 9) for element in ELEMENTS]
    + [("sharp", element, level) for level in (8, 9, 10) for element in ("h8_modes", "h20", "h27")]
    + [("compliant", element, level) for level in (10, 11) for element in ("h20", "h27")]
)
"""Clamp, element, generator level; the last make the references and their check."""

FINEST = 10
"""First level that `--quick` leaves out."""

TIMED = 1500
"""Unknowns up to which a mesh is worth timing as a real-time setting."""


@dataclass
class Row:
    """What one mesh gives; quantities that found no equilibrium are NaN."""

    clamp: str
    element: str
    level: int
    unknowns: int = 0
    L1: float = np.nan
    L2: float = np.nan
    L3: float = np.nan
    L4: float = np.nan
    L5: float = np.nan
    step: float = np.nan
    note: str = ""

    @property
    def key(self) -> tuple[str, str, int]:
        """What tells rows apart."""
        return self.clamp, self.element, self.level


UNITS = {
    "unknowns": "unknowns",
    "L1": "L1 height [m]",
    "L2": "L2 strain energy [J]",
    "L3": "L3 shift [m]",
    "L4": "L4 height [m]",
    "L5": "L5 - L4 move [m]",
    "step": "step [ms]",
    "note": "note",
}
"""Columns of the table after clamp, element and level."""


def overrides(clamp: str, element: str, level: int) -> list[str]:
    """Return what makes the scene `tripod` that of a row."""
    bedding = [f"clamp.stiffness={STIFFNESS}"] if clamp == "compliant" else []
    return [f"mesh.element={element}", f"mesh.level={level}", *bedding]


def solve(row: Row) -> None:
    """Fill the quantities of a row, each reached from the flat piece in increments of at most 0.3 rad."""
    linear = "cholmod" if find_spec("cvxopt") else "ldl"
    statics = [
        "inertia=off",
        "damping=off",
        "solver.tolerance=1e-5",
        "solver.max_turn=0.3",
        f"solver.linear={linear}",
    ]
    try:
        simulation = Simulation(load_scene(SHARP, [*statics, *overrides(*row.key)]))
    except (SceneError, StepError) as error:
        row.note = f"L1: {error}"
        return
    row.unknowns = simulation.unknowns
    row.L1 = float(simulation.state.centres[0, 2])
    for case in ("L2", "L3", "L4"):
        simulation.reset()
        try:
            simulation.step(np.array(POSES[case]))
            centre = simulation.state.centres[0].copy()
            if case == "L2":
                row.L2 = simulation.energies().strain
            elif case == "L3":
                row.L3 = float(np.hypot(*centre[:2]))
            else:
                row.L4 = float(centre[2])
                simulation.step(np.array(POSES["L5"]))
                row.L5 = float(np.linalg.norm(simulation.state.centres[0] - centre))
        except StepError as error:
            row.note += f"{case}: {error}; "


def read() -> dict[tuple[str, str, int], Row]:
    """Return the rows of the table on disk."""
    if not TABLE.exists():
        return {}
    rows = {}
    with TABLE.open(newline="") as file:
        for line in csv.DictReader(file):
            row = Row(
                line["clamp"], line["element"], int(line["level"]), int(line["unknowns"]), note=line["note"]
            )
            for name in ("L1", "L2", "L3", "L4", "L5", "step"):
                setattr(row, name, float(line[UNITS[name]] or "nan"))
            rows[row.key] = row
    return rows


def write(rows: dict[tuple[str, str, int], Row]) -> None:
    """Write the table, whole or not at all."""
    partial = TABLE.with_suffix(".partial")
    with partial.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["clamp", "element", "level", *UNITS.values()])
        for key in [key for key in MESHES if key in rows]:
            row = rows[key]
            figures = [getattr(row, name) for name in ("L1", "L2", "L3", "L4", "L5")]
            cells = ["" if np.isnan(value) else f"{value:.7g}" for value in figures]
            taken = "" if np.isnan(row.step) else f"{row.step:.3f}"
            writer.writerow([*row.key, row.unknowns, *cells, taken, row.note])
    partial.replace(TABLE)


def compute(rows: dict[tuple[str, str, int], Row], only: str | None, *, quick: bool) -> None:
    """Compute the rows that are missing; each is on disk as soon as it is done."""
    missing = [
        key
        for key in MESHES
        if key not in rows and not (quick and key[2] >= FINEST) and only in (None, key[1])
    ]
    for i, key in enumerate(missing):
        begin = time.perf_counter()
        print(
            f"{i + 1}/{len(missing)}  {key[0]}, {key[1]}, level {key[2]} ...",
            end="",
            file=sys.stderr,
            flush=True,
        )
        row = Row(*key)
        solve(row)
        rows[key] = row
        write(rows)
        print(f" {row.unknowns} unknowns, {time.perf_counter() - begin:.1f} s {row.note}", file=sys.stderr)


def measure_times(rows: dict[tuple[str, str, int], Row], steps: int) -> None:
    """Measure the median time of a step in time (see `benchmarks/step.py`) of all small meshes."""
    from benchmarks import step  # noqa: PLC0415 - it takes `calibration` from beside it

    print(f"1000 x 1000 float64 product, one thread: {1e3 * calibration():.1f} ms", file=sys.stderr)
    for row in rows.values():
        if row.unknowns <= TIMED:
            try:
                row.step = step.measure(SHARP, overrides(*row.key), steps)["median"]
            except StepError as error:
                print(f"{row.clamp}, {row.element}, level {row.level}: {error}", file=sys.stderr)
            else:
                print(f"{row.clamp}, {row.element}, level {row.level}: {row.step:.3f} ms", file=sys.stderr)
    write(rows)


def main() -> None:
    """Compute what is missing."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", metavar="ELEMENT", choices=ELEMENTS, help="compute one element's meshes")
    parser.add_argument("--quick", action="store_true", help="leave the finest meshes out")
    parser.add_argument("--times", action="store_true", help="measure step times instead")
    parser.add_argument("--steps", type=int, default=300, help="steps of each time (default 300)")
    options = parser.parse_args()
    rows = read()
    try:
        if options.times:
            measure_times(rows, options.steps)
        else:
            compute(rows, options.only, quick=options.quick)
    except KeyboardInterrupt:
        print("\nstopped; what is done is kept, the same command goes on", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
