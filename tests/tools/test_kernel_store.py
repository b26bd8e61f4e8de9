"""Compiled kernels move to another checkout, but not to sources that they were not compiled from."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.messages import assert_names
from tools import kernel_store
from tripod_sim.kernel_cache import remove_stale_kernels

LAW = "from numba import njit\n\n\n@njit(cache=True)\ndef law(x):\n    return {}\n"
FORCE = (
    "from numba import njit\n\nfrom tripod_toy.law import law\n\n\n"
    "@njit(cache=True)\ndef force(x):\n    return law(x)\n"
)
CALL = "from tripod_toy.force import force; print(force(3.0), force.stats.cache_hits)"


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """Return a checkout of one package whose kernels are compiled: `force` calls `law`."""
    package = tmp_path / "one" / "tripod_toy"
    package.mkdir(parents=True)
    for name, text in {"__init__": "", "law": LAW.format("2.0 * x"), "force": FORCE}.items():
        (package / f"{name}.py").write_text(text)
        os.utime(package / f"{name}.py", (1e9, 1e9))
    assert run(package.parent) == ["6.0", "0"]
    return package.parent


@pytest.fixture
def other(checkout: Path) -> Path:
    """Return a younger checkout of the same sources, without kernels."""
    return shutil.copytree(
        checkout,
        checkout.with_name("two"),
        copy_function=shutil.copyfile,
        ignore=shutil.ignore_patterns("__pycache__"),
    )


def run(checkout: Path) -> list[str]:
    """Call `force` in a process of its own; return its value, and how often a kernel was found."""
    environment = {k: v for k, v in os.environ.items() if not k.startswith("NUMBA_CACHE")}
    command = [sys.executable, "-c", CALL]
    out = subprocess.run(
        command, cwd=checkout, env=environment, capture_output=True, text=True, check=True
    ).stdout
    value, hits = out.split(maxsplit=1)
    return [value, str(len([word for word in hits.split() if word.endswith("1})")]))]


def test_another_checkout_of_the_same_sources_compiles_nothing(
    checkout: Path, other: Path, tmp_path: Path
) -> None:
    count = kernel_store.save(checkout, tmp_path / "store")
    assert count == 4  # code and index of both
    assert kernel_store.restore(other, tmp_path / "store") == count
    assert remove_stale_kernels(other / "tripod_toy") == []
    assert run(other) == ["6.0", "1"]


def test_what_calls_a_changed_source_is_compiled_again(checkout: Path, other: Path, tmp_path: Path) -> None:
    kernel_store.save(checkout, tmp_path / "store")
    (other / "tripod_toy" / "law.py").write_text(LAW.format("5.0 * x"))
    assert kernel_store.restore(other, tmp_path / "store") == 2  # those of `force`
    assert {path.name.split(".")[0] for path in remove_stale_kernels(other / "tripod_toy")} == {"force"}
    assert run(other) == ["15.0", "0"]


def test_a_second_save_leaves_nothing_of_the_first(checkout: Path, other: Path, tmp_path: Path) -> None:
    store = tmp_path / "store"
    kernel_store.save(checkout, store)
    (other / "tripod_toy" / "law.py").unlink()
    kernel_store.save(other, store)
    assert [path.name for path in store.rglob("*") if path.is_file()] == [kernel_store.MANIFEST]


def test_an_empty_store_restores_nothing(
    checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(kernel_store, "ROOT", checkout)
    assert kernel_store.main(["restore", str(tmp_path / "none")]) == 0
    assert_names(capsys.readouterr().out, 0, str(tmp_path / "none"))
