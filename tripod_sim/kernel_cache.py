"""Removes compiled kernels that are older than the sources they were compiled from.

Numba keeps machine code beside each module and renews it when that module's own file changes, not when a function that
it calls from another module does: after an update a kernel would go on with the old physics. Nor does it notice that
the class of an argument has moved: reading the index of such a kernel ends with an error.
"""

import re
from collections.abc import Sequence
from pathlib import Path

IMPORT = re.compile(r"^(?:from|import) ([\w.]+)(?: import (\([^)]*\)|.+))?", re.MULTILINE)
STAMP = "kernels.stamp"


def remove_stale_kernels(package: Path, *below: Path) -> list[Path]:
    """Remove the stale kernels of `package` and return their files; do nothing where no source has changed since.

    Where the folder cannot be written nothing is done: Numba then keeps its cache elsewhere.

    Args:
        package: The folder of a package.
        below: Folders of the packages whose kernels it calls, beside that of `package`.
    """
    sources = {path: path.stat().st_mtime_ns for folder in (package, *below) for path in folder.rglob("*.py")}
    stamp = package / "__pycache__" / STAMP
    newest = str(max(sources.values(), default=0))
    try:
        if stamp.exists() and stamp.read_text() == newest:
            return []
        removed = _remove((package, *below), sources)
        stamp.parent.mkdir(exist_ok=True)
        stamp.write_text(newest)
    except OSError:
        return []
    return removed


def _remove(packages: Sequence[Path], sources: dict[Path, int]) -> list[Path]:
    """Remove the stale kernels of the first of `packages` and return them."""
    imports = {path: _imports(path, packages) & sources.keys() for path in sources}
    removed = []
    for path in (path for path in sources if packages[0] in path.parents):
        reached, todo = {path}, [path]
        while todo:
            new = imports[todo.pop()] - reached
            reached |= new
            todo += new
        newest = max(sources[p] for p in reached)
        for kernel in (path.parent / "__pycache__").glob(f"{path.stem}.*.nb[ic]"):
            made = kernel.stat().st_mtime_ns
            if made < newest or any(made < sources.get(p, made + 1) for p in _named(kernel, packages)):
                kernel.unlink(missing_ok=True)
                removed.append(kernel)
    return removed


def _named(kernel: Path, packages: Sequence[Path]) -> set[Path]:
    """Return the files whose classes an index of kernels names: its arguments may be of these types."""
    if kernel.suffix != ".nbi":
        return set()
    text = kernel.read_bytes()
    return {
        package.joinpath(*name.decode().split(".")[1:]).with_suffix(".py")
        for package in packages
        for name in re.findall(rb"\b%s(?:\.\w+)+" % package.name.encode(), text)
    }


def _imports(path: Path, packages: Sequence[Path]) -> set[Path]:
    """Return the files of the packages that a module imports, by the text of its import lines."""
    folders, found = {package.name: package for package in packages}, set()
    for module, names in IMPORT.findall(path.read_text(encoding="utf-8")):
        first, *parts = module.split(".")
        if first in folders:
            base = folders[first].joinpath(*parts)
            found.add(base.with_suffix(".py"))
            found |= {base / f"{name}.py" for name in re.findall(r"\w+", names)}
    return found
