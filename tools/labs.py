"""Execute the labs and keep what they show: `python -m tools.labs`, or some: `python -m tools.labs a_pendulum`.

A lab is a text, `labs/NAME.py`, whose cells begin with `# %%`. From it comes the notebook `labs/NAME.ipynb`, outputs
inside; nobody edits that one by hand.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

LABS = Path(__file__).resolve().parent.parent / "labs"
PATIENCE = 600
"""Longest time of a cell [s]."""


def names() -> list[str]:
    """Return the names of all labs, in their order."""
    return sorted(p.stem for p in LABS.glob("*.py") if p.read_text(encoding="utf-8").startswith("# %%"))


def cells(name: str) -> Any:
    """Return the text of a lab as a notebook without outputs."""
    import jupytext  # noqa: PLC0415 - of the extra `labs`

    return jupytext.read(LABS / f"{name}.py", fmt="py:percent")


def execute(name: str) -> Path:
    """Write the notebook of a lab, executed; return its path."""
    import nbformat  # noqa: PLC0415
    from nbclient import NotebookClient  # noqa: PLC0415
    from traitlets.config import Config  # noqa: PLC0415

    notebook = cells(name)
    notebook.metadata = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
    with TemporaryDirectory() as sockets:  # in place of ports
        sparing = Config(KernelManager={"transport": "ipc", "ip": f"{sockets}/kernel"})
        place = {"metadata": {"path": str(LABS)}}
        NotebookClient(notebook, config=sparing, timeout=PATIENCE, resources=place).execute()
    for k, cell in enumerate(notebook.cells):
        cell.id, cell.metadata = f"{name.replace('_', '-')}-{k}", {}
    notebook.metadata.pop("language_info", None)  # the version of Python does not matter
    path = LABS / f"{name}.ipynb"
    nbformat.write(notebook, path)
    return path


def main() -> int:
    """Execute those that the command line names, or all; return the exit code."""
    wanted = sys.argv[1:] or names()
    if unknown := sorted(set(wanted) - set(names())):
        print(f"labs: no lab {unknown[0]!r}; there are {', '.join(names())}", file=sys.stderr)
        return 2
    for name in wanted:
        print(f"labs: {name} ...", flush=True)
        print(f"labs: {execute(name).relative_to(LABS.parent)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
