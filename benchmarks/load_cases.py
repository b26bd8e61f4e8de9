"""Error of the Tripod's load cases for each mesh level and material law, as a Markdown table.

References (neo-Hooke, ideal sharp clamp): converged quadratic hexahedra, cross-checked against CalculiX. L1 sag by
weight, flat; L2 all servos at -45 degrees; L3 servo 0 alone at -45 degrees; L4 all at -1.4965 rad with the servo bodies
slid 35 mm inward. `python benchmarks/load_cases.py [--write]`.
"""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

import numpy as np

from benchmarks.doc_parts import write_part
from tests.scenes import SHARP
from tripod_sim import Simulation, StepError, load_scene

STATIC = ("inertia=off", "damping=off")
QUARTER = -np.pi / 4
REFERENCES = {
    "L1 height": -2.097e-3,
    "L2 strain energy": 0.6959,
    "L3 shift": 11.858e-3,
    "L4 height": -8.25e-3,
    "L4 torque": -0.140,
}
"""[m], [J], [m], [m], [N m]; the last two are known to about 1 %."""


def pose(joints: tuple[float, ...], overrides: tuple[str, ...]) -> Simulation:
    """Return the simulation at rest at `joints`, reached in twenty increments."""
    simulation = Simulation(load_scene(SHARP, [*STATIC, *overrides]))
    for k in range(1, 21):
        simulation.step(np.array(joints) * k / 20)
    return simulation


def measure(overrides: tuple[str, ...]) -> dict[str, float]:
    """Return the quantities of REFERENCES."""
    found = {"L1 height": pose((0, 0, 0, 0), overrides).state.centres[0, 2]}
    found["L2 strain energy"] = pose((QUARTER,) * 3 + (0.0,), overrides).energies().strain
    found["L3 shift"] = float(np.hypot(*pose((QUARTER, 0, 0, 0), overrides).state.centres[0, :2]))
    working = pose((-1.4965, -1.4965, -1.4965, 0.035), overrides)
    found["L4 height"], found["L4 torque"] = working.state.centres[0, 2], working.efforts[0]
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="write docs/accuracy.md, too")
    options = parser.parse_args()
    lines = ["| law | mesh level | unknowns | " + " | ".join(f"{name} [%]" for name in REFERENCES) + " |"]
    lines.append("|" + "---|" * (3 + len(REFERENCES)))
    for law in ("neo_hooke", "corotational"):
        for level in (1, 2, 3, 4):
            overrides = (f"material.law={law}", f"mesh.level={level}")
            unknowns = Simulation(load_scene(SHARP, overrides)).unknowns
            try:
                found = measure(overrides)
                cells = [f"{100 * (found[name] / value - 1):+.1f}" for name, value in REFERENCES.items()]
            except StepError as error:
                cells = [f"no equilibrium: {error}"]
            name = f"{level} (draft)" if (law, level) == ("neo_hooke", 2) else str(level)
            lines.append(f"| {law} | {name} | {unknowns} | " + " | ".join(cells) + " |")
    print("\n".join(lines))
    if options.write:
        write_part("accuracy.md", "load cases", lines)


if __name__ == "__main__":
    main()
