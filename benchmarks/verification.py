"""Differences from known solutions and from an independent code, in percent, as Markdown tables.

Analytic cases for every element (see `analytic`), and the Tripod's load cases against CalculiX on the same mesh and law
(see `calculix`). `python benchmarks/verification.py --help` lists the options.
"""

import argparse
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks import analytic, calculix
from benchmarks.doc_parts import write_part

ELEMENTS = ("h8_modes", "t10", "h20", "h20_full", "h27", "h8", "h8_mean", "t4")


def percent(ratio: float) -> str:
    """Return the difference of a ratio from one."""
    difference = 100 * (ratio - 1)
    return f"{difference:+.2f}" if abs(difference) >= 5e-3 else f"{difference:+.0e}"


def analytic_table() -> list[str]:
    """Return the differences from the known solutions."""
    lines = ["| case | " + " | ".join(ELEMENTS) + " |", "|---|" + "---|" * len(ELEMENTS)]
    for name, ratio in analytic.RATIOS.items():
        lines.append(f"| {name} | " + " | ".join(percent(ratio(e)) for e in ELEMENTS) + " |")
    flights = [analytic.flight(e) for e in ELEMENTS]
    for i, name in enumerate(("linear momentum", "angular momentum", "energy")):
        lines.append(f"| free flight, {name} | " + " | ".join(percent(f[i]) for f in flights) + " |")
    return lines


def calculix_table(level: int) -> list[str]:
    """Return the differences from CalculiX."""
    if not calculix.installed():
        return [calculix.PACKAGE]
    lines = [
        "| load case | element | CalculiX | largest displacement [mm] | reached | nodes [%] | disc [%] |"
    ]
    lines.append("|---" * 7 + "|")
    for case in calculix.CASES:
        for element, name in calculix.ELEMENTS.items():
            with tempfile.TemporaryDirectory() as folder:
                found = calculix.agreement(case, element, level, Path(folder))
            figures = f"{1e3 * found.size:.3f} | {found.reached:.0%} | {100 * found.nodes:.1e} | {100 * found.disc:.1e}"
            lines.append(f"| {case} | {element} | {name} | {figures} |")
    return lines


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--level", type=int, default=1, help="mesh level of the load cases (default 1)")
    parser.add_argument("--only", choices=("analytic", "calculix"), help="one of the two tables")
    parser.add_argument("--write", action="store_true", help="write docs/verification.md, too")
    options = parser.parse_args()
    made = {}
    if options.only != "calculix":
        made["analytic"] = analytic_table()
        print("Found over known, difference in percent:\n\n" + "\n".join(made["analytic"]) + "\n")
    if options.only != "analytic":
        made["calculix"] = calculix_table(options.level)
        print("Against CalculiX, in percent of the largest displacement:\n\n" + "\n".join(made["calculix"]))
    if options.write:
        for name, lines in made.items():
            write_part("verification.md", name, lines)


if __name__ == "__main__":
    main()
