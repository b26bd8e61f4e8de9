"""Write the pages of evidence again from what is stored; nothing is measured.

    python benchmarks/evidence.py                   # pages, pictures, and the price of settings in scene files
    python benchmarks/evidence.py --from studies    # takes the studies of a folder into the package first
    python benchmarks/evidence.py --check           # writes nothing; exit code 1 if a page or scene file is not current

Results are stored as files (tripod_study/studies/*.json, docs/*.csv, docs/peers.json) or as tables on the pages. Such a
table is written by the script that is named beside it, with `--write`. Short tables and pictures are made from these.
What stands outside the marks `<!-- name -->` and `<!-- end name -->` is left as it is.

    tripod study --all --out studies                # measures the studies: half an hour on two processors, quiet
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks import (
    accuracy_docs,
    accuracy_overview,
    budgets,
    convergence,
    convergence_report,
    evidence_figures,
    evidence_tables,
    peers,
    peers_report,
    stability,
)
from benchmarks.doc_parts import DOCS, renewed
from tripod_bringup.study_plot import draw

IMAGES = DOCS / "images"


def parts() -> dict[str, dict[str, list[str]]]:
    """Return what is written into the parts of each page, by page and name of the part."""
    found, rows = accuracy_docs.studies(), list(convergence.read().values())
    accuracy, verification, reality, speed = (
        read(page) for page in ("accuracy.md", "verification.md", "reality.md", "speed.md")
    )
    return {
        "accuracy.md": {
            **accuracy_docs.parts(found),
            **convergence_report.parts(rows),
            "default": [accuracy_docs.default_text(found)],
            "kept": evidence_tables.kept(accuracy),
            "estimate": evidence_tables.estimate(accuracy),
            "budgets": budgets.table(),
        },
        "verification.md": {
            "stability": stability.summary(),
            "result": evidence_tables.verification(verification),
        },
        "reality.md": {"result": evidence_tables.reality(reality)},
        "speed.md": {"result": [evidence_tables.speed(speed)]},
    }


def read(page: str) -> str:
    """Return the text of a page."""
    return (DOCS / page).read_text(encoding="utf-8")


def texts() -> dict[Path, str]:
    """Return the text that each page and each scene file should have."""
    made = {}
    for page, own in parts().items():
        text = read(page)
        for name, lines in own.items():
            text = renewed(text, name, lines)
        made[DOCS / page] = text
    made[DOCS / "peers.md"] = peers_report.text(peers.read(peers.STORE))
    return made | accuracy_docs.scene_files(accuracy_docs.studies())


def old() -> list[Path]:
    """Return the pages and scene files that are not what is stored says."""
    return [path for path, text in texts().items() if path.read_text(encoding="utf-8") != text]


def pictures() -> dict[str, Callable[[Path], None]]:
    """Return what draws each picture, by the name of its file without the ending."""
    found, rows = accuracy_docs.studies(), list(convergence.read().values())
    made: dict[str, Callable[[Path], None]] = {
        "accuracy": lambda path: accuracy_overview.draw(accuracy_overview.rows_of(found), path),
        "accuracy_kept": lambda path: evidence_figures.kept(read("accuracy.md"), path),
        "convergence": lambda path: convergence_report.draw(rows, path),
        "verification": lambda path: evidence_figures.solutions(read("verification.md"), path),
        "reality": lambda path: evidence_figures.measured(read("reality.md"), path),
        "speed": lambda path: evidence_figures.speed(read("speed.md"), path),
        "peers": lambda path: peers_report.draw(peers.read(peers.STORE), path),
    }
    for result in found:
        made[f"accuracy_{result['study']}"] = lambda path, result=result: draw(result, path)
    return made


def main() -> None:
    """Write pages and pictures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--from", dest="source", type=Path, metavar="DIR", help="take the studies of this folder"
    )
    parser.add_argument("--check", action="store_true", help="write nothing")
    options = parser.parse_args()
    if options.check:
        print(*accuracy_docs.old(accuracy_docs.studies()), sep="\n", file=sys.stderr)
        print(*(f"{path}: not of what is stored" for path in old()), sep="\n")
        sys.exit(bool(old()))
    if options.source:
        print("taken:", ", ".join(accuracy_docs.take(options.source)) or "nothing")
    for path, text in texts().items():
        path.write_text(text, encoding="utf-8")
    for name, make in pictures().items():
        make(IMAGES / f"{name}.png")


if __name__ == "__main__":
    main()
