"""Compiled kernels go when a source that they were made of changes, and stay otherwise; they are made once."""

import ast
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from numba import typeof

from tripod_sim.forces.spring_force import SpringForce
from tripod_sim.forces.strain_bound import StrainBound
from tripod_sim.kernel_cache import remove_stale_kernels
from tripod_sim.springs.body import SpringBody

SOURCES = {
    "laws.py": "",
    "forces/solid.py": "from laboratory import laws\n",
    "forces/outer.py": "from laboratory.forces import (\n    solid,\n)\n",
    "other.py": "import os\n",
}


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """Return a package of four modules, each with a kernel younger than all sources."""
    base, now = tmp_path / "laboratory", time.time()
    for name, text in SOURCES.items():
        source = base / name
        source.parent.mkdir(parents=True, exist_ok=True)
        source.write_text(text)
        os.utime(source, (now - 100, now - 100))
        kernel = kernel_of(source)
        kernel.parent.mkdir(exist_ok=True)
        kernel.write_text("machine code")
        os.utime(kernel, (now - 50, now - 50))
    return base


def kernel_of(source: Path) -> Path:
    return source.parent / "__pycache__" / f"{source.stem}._add-3.py311.nbi"


def test_fresh_kernels_stay(package: Path) -> None:
    assert remove_stale_kernels(package) == []
    assert all(kernel_of(package / name).exists() for name in SOURCES)


def test_kernels_go_with_every_source_that_they_import(package: Path) -> None:
    remove_stale_kernels(package)
    os.utime(package / "laws.py")
    removed = remove_stale_kernels(package)
    assert {k.name.split(".")[0] for k in removed} == {"laws", "solid", "outer"}
    assert kernel_of(package / "other.py").exists()
    assert remove_stale_kernels(package) == []


def test_kernels_go_with_the_classes_of_their_arguments(package: Path) -> None:
    """The index of a kernel names them; one that has moved could not be read any more."""
    kernel = kernel_of(package / "other.py")
    made = kernel.stat().st_mtime
    for name, stays in ((b"laboratory.laws", True), (b"laboratory.gone", False)):
        kernel.write_bytes(b"\x80\x05\x8c\x0f" + name + b"\x94\x8c\x06_Slots")
        os.utime(kernel, (made, made))
        (package / "__pycache__" / "kernels.stamp").unlink(missing_ok=True)
        remove_stale_kernels(package)
        assert kernel.exists() == stays
    kernel.write_bytes(b"\x80\x05\x8c\x0flaboratory.laws\x94\x8c\x06_Slots")
    os.utime(kernel, (made, made))
    os.utime(package / "laws.py")
    assert kernel in remove_stale_kernels(package)


def test_kernels_go_with_the_sources_of_a_package_below(package: Path) -> None:
    above = package.with_name("office")
    source = above / "repeat.py"
    kernel = kernel_of(source)
    kernel.parent.mkdir(parents=True)
    source.write_text("from laboratory.forces import solid\n")
    kernel.write_text("machine code")
    for path in (source, kernel):
        os.utime(path, (kernel_of(package / "laws.py").stat().st_mtime,) * 2)
    assert remove_stale_kernels(above, package) == []
    os.utime(package / "laws.py")
    assert remove_stale_kernels(above, package) == [kernel]
    assert kernel_of(package / "laws.py").exists(), "that package removes its own"


def test_where_nothing_can_be_written_nothing_happens(package: Path) -> None:
    (package / "__pycache__").rename(package / "kept")
    (package / "__pycache__").write_text("a file where the folder should be")
    assert remove_stale_kernels(package) == []


def test_importing_the_simulator_removes_them(tmp_path: Path) -> None:
    package = Path(__file__).parents[2] / "tripod_sim"
    stale = package / "forces" / "__pycache__" / "solid_kernels._never-1.py300.nbi"
    stale.parent.mkdir(exist_ok=True)
    stale.write_text("")
    os.utime(stale, (1, 1))
    (package / "__pycache__" / "kernels.stamp").unlink(missing_ok=True)
    subprocess.run([sys.executable, "-c", "import tripod_sim"], check=True, cwd=package.parent)
    assert not stale.exists()


def test_kernels_are_compiled_once_for_all_springs() -> None:
    """Arrays that may not be written, or lie otherwise in memory, are types of their own."""
    body = SpringBody(
        np.eye(3), np.array([[0, 1], [1, 2]]), np.ones(2), np.ones(2), np.ones(2), np.ones(3), np.array([0])
    )
    assert not body.stiffness.flags.writeable
    links = [
        SpringForce(
            body.ends, body.rest_length, body.stiffness, body.damping, slack=False, owner="net"
        ).links,
        SpringForce(
            body.ends.T.copy().T, body.rest_length, body.stiffness, body.damping, slack=True, owner="net"
        ).links,
        StrainBound(body.ends, body.rest_length, 0.1, np.ones(3)).links,
    ]
    assert len({typeof(of_one) for of_one in links}) == 1


DEAR = ("ldl_kernels._close",)
"""Kernels that copy in their innermost loops: loops make the factorisation 3 % longer, slices its compilation."""


def test_no_kernel_assigns_an_array_to_a_slice() -> None:
    """`put` does that: the text of what Numba would say of shapes that differ takes seconds to compile."""
    root, found, kernels = Path(__file__).parents[2], [], 0
    for path in sorted(root.glob("tripod_s*/**/*.py")):
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(function, ast.FunctionDef) or "njit" not in map(_name, function.decorator_list):
                continue
            kernels += 1
            if f"{path.stem}.{function.name}" in DEAR:
                continue
            found += [
                f"{path.relative_to(root)}:{target.lineno}: {ast.unparse(target)}"
                for target, value in _assigned(function)
                if _sliced(target) and not _number(value)
            ]
    assert kernels > 100
    assert not found


def _name(decorator: ast.expr) -> str:
    return ast.unparse(decorator.func if isinstance(decorator, ast.Call) else decorator)


def _assigned(function: ast.FunctionDef) -> list[tuple[ast.expr, ast.expr]]:
    """What is assigned to, and what to it."""
    found: list[tuple[ast.expr, ast.expr]] = []
    for node in ast.walk(function):
        if isinstance(node, ast.AugAssign):
            found.append((node.target, node.target))
        for target in node.targets if isinstance(node, ast.Assign) else ():
            if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                found += zip(target.elts, node.value.elts, strict=True)
            else:
                found.append((target, node.value))
    return found


def _sliced(target: ast.expr) -> bool:
    return isinstance(target, ast.Subscript) and any(isinstance(n, ast.Slice) for n in ast.walk(target.slice))


def _number(value: ast.expr) -> bool:
    return isinstance(value, ast.Constant) or ast.unparse(value).lstrip("-") in ("np.inf", "np.nan")
