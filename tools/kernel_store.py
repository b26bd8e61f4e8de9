"""Keep compiled kernels between checkouts on one machine: `python -m tools.kernel_store restore|save DIRECTORY`.

Numba compiles a kernel again in each new checkout, because it compares the time of its source with the one that it
noted. `save` copies the kernels into DIRECTORY, with the content and time of every source. `restore` copies them beside
those sources that still have that content, and gives these the noted time. All others are younger than their kernels,
so `tripod_sim.kernel_cache` removes what was compiled from them. Continuous integration restores before it builds, and
saves when all tests have passed. The exit code is 0, also where there is nothing to restore.
"""

import argparse
import hashlib
import json
import os
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

ROOT = Path(__file__).parents[1]
MANIFEST = "sources.json"


def main(arguments: Sequence[str] | None = None) -> int:
    """Restore or save the kernels of this checkout; return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m tools.kernel_store", description=(__doc__ or "").split("\n\n")[1]
    )
    parser.add_argument("action", choices=("restore", "save"))
    parser.add_argument("directory", type=Path)
    given = parser.parse_args(arguments)
    count = (restore if given.action == "restore" else save)(ROOT, given.directory)
    print(f"{given.action}d {count} files of compiled kernels: {given.directory}")
    return 0


def save(checkout: Path, store: Path) -> int:
    """Copy the kernels of `checkout` into `store`, in the place of what is there; return how many files that are."""
    fresh = store.with_name(f"{store.name}.new")
    shutil.rmtree(fresh, ignore_errors=True)
    fresh.mkdir(parents=True)
    sources = {str(path.relative_to(checkout)): path for path in _sources(checkout)}
    count = sum(_copy_kernels(path, fresh / name) for name, path in sources.items())
    noted = {name: [_digest(path), path.stat().st_mtime_ns] for name, path in sources.items()}
    (fresh / MANIFEST).write_text(json.dumps(noted), encoding="utf-8")
    shutil.rmtree(store, ignore_errors=True)
    fresh.rename(store)
    return count


def restore(checkout: Path, store: Path) -> int:
    """Copy the kernels in `store` beside the sources of `checkout` that they were compiled from; return how many."""
    manifest = store / MANIFEST
    if not manifest.exists():
        return 0
    count = 0
    for name, (digest, time) in json.loads(manifest.read_text(encoding="utf-8")).items():
        path = checkout / name
        if path.exists() and _digest(path) == digest:
            os.utime(path, ns=(time, time))
            count += _copy_kernels(store / name, path)
    return count


def _sources(checkout: Path) -> list[Path]:
    return sorted(path for package in checkout.glob("tripod_*") for path in package.rglob("*.py"))


def _copy_kernels(source: Path, target: Path) -> int:
    """Copy the kernels beside the module `source` to where those of the module `target` are, with their times."""
    kernels = list((source.parent / "__pycache__").glob(f"{source.stem}.*.nb[ic]"))
    if kernels:
        (target.parent / "__pycache__").mkdir(parents=True, exist_ok=True)
    for kernel in kernels:
        shutil.copy2(kernel, target.parent / "__pycache__")
    return len(kernels)


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


if __name__ == "__main__":
    sys.exit(main())
