"""Break the core of the solver in one place at a time, and see which tests notice: `python -m tools.mutate`.

A mutant is the program with one operator, sign, constant or index changed. Places are drawn with a seed: a file, then a
place in it. The tests of that file (`TESTS`, the quickest first) run in a copy of the checkout until one fails: the
mutant is killed. A mutant that all of them pass survives, and is shown: either it does the same as the original, or a
test is missing. Results are kept as they come: what was tried before is not tried again.
"""

import argparse
import ast
import json
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
LEFT_OUT = shutil.ignore_patterns(".git", ".venv", "build", ".*_cache", ".hypothesis", "*.pyc", "recordings")

SYSTEM = (
    "reduction", "system", "elastic_terms", "clamp", "compliance", "platform", "sets", "invariance", "dynamics",
)  # fmt: skip
CONTACT = (
    "contact_distance", "contact_broad_phase", "condensed_contact", "contact_joint", "contact_balls", "contact_held",
    "contact_rigid", "contact_self", "contact_scene", "contact_schemes", "contact_solid", "contact_statics",
    "contact_rigid_scene", "contact_fuzz",
)  # fmt: skip
STEPS = (
    "integrators", "one_solve", "dynamics", "factor_store", "load_steps", "time_error", "doubling", "auto_dt",
    "unstable_equilibria", "stability", "verification",
)  # fmt: skip

TESTS = {
    "tripod_sim/constraints/reduction.py": SYSTEM,
    "tripod_sim/rotation_kernels.py": SYSTEM,
    "tripod_sim/constraints/rigid_kernels.py": ("contact_rigid", "explicit_tripod", "explicit_bodies", "platform"),
    "tripod_sim/forces/solid_kernels.py": (
        "system", "elements", "elastic_terms", "mean_dilatation", "invariance", *STEPS,
    ),
    "tripod_sim/forces/mode_kernels.py": ("system", "elements", "elastic_terms", "invariance", *STEPS),
    "tripod_sim/forces/rate_kernels.py": ("damping", "explicit_solid", "explicit_bodies", "explicit_tripod"),
    "tripod_sim/forces/damper_kernels.py": ("damping", "invariance", "integrators"),
    "tripod_sim/forces/anchor.py": (*SYSTEM, *STEPS),
    "tripod_sim/forces/gravity.py": (*SYSTEM, *STEPS),
    "tripod_sim/forces/elastic.py": ("elastic_terms", *SYSTEM, *STEPS),
    "tripod_sim/forces/foundation.py": ("clamp", "explicit_tripod", "convergence"),
    "tripod_sim/mesh_error/support.py": ("mesh_error", "spatial_error"),
    "tripod_sim/mesh_error/modal_error.py": ("modal_error",),
    "tripod_sim/mesh_error/modes.py": ("modal_error",),
    "tripod_sim/mesh_error/modal_integration.py": ("modal_error",),
    "tripod_sim/mesh_error/chord.py": ("chord", "mesh_error"),
    "tripod_sim/forces/spring_force.py": ("damping", "elastic_terms", "spring_forces", "spring_schemes"),
    "tripod_sim/integrators/newton.py": STEPS,
    "tripod_sim/integrators/one_solve.py": STEPS,
    "tripod_sim/integrators/chord_predictor.py": STEPS,
    "tripod_sim/integrators/implicit.py": STEPS,
    "tripod_sim/integrators/history.py": STEPS,
    "tripod_sim/integrators/stage.py": STEPS,
    "tripod_sim/integrators/quasi_static.py": ("system", "clamp", *STEPS),
    "tripod_sim/integrators/substeps.py": STEPS,
    "tripod_sim/integrators/load_steps.py": ("load_steps", *STEPS),
    "tripod_sim/integrators/factor_store.py": STEPS,
    "tripod_sim/integrators/time_error.py": ("time_error", "doubling", "auto_dt", "auto_scheme"),
    "tripod_sim/integrators/time_error_kernels.py": ("time_error", "doubling", "auto_dt", "auto_scheme"),
    "tripod_sim/integrators/explicit_kernels.py": ("explicit_bodies", "explicit_solid", "explicit_tripod"),
    "tripod_sim/integrators/force_kernels.py": ("explicit_bodies", "explicit_solid", "explicit_tripod"),
    "tripod_sim/distance_kernels.py": CONTACT,
    "tripod_sim/contact/ccd_kernels.py": CONTACT,
    "tripod_sim/contact/broad_kernels.py": CONTACT,
    "tripod_sim/contact/narrow_kernels.py": CONTACT,
    "tripod_sim/contact/region_kernels.py": CONTACT,
    "tripod_sim/contact/condensed_contact_kernels.py": CONTACT,
    "tripod_sim/contact/hessian_kernels.py": CONTACT,
    "tripod_sim/contact/response_kernels.py": CONTACT,
    "tripod_sim/contact/hit_kernels.py": CONTACT,
    "tripod_sim/contact/impact_kernels.py": CONTACT,
    "tripod_sim/contact/start_kernels.py": CONTACT,
    "tripod_ik/solver.py": ("ik_solver", "ik_certificate", "ik_row_limits", "ik_tasks", "ik_inverse", "ik_tracker"),
    "tripod_ik/problem.py": ("ik_solver", "ik_certificate", "ik_row_limits", "ik_tasks", "ik_inverse", "ik_tracker"),
    "tripod_ik/certificate_kernels.py": ("ik_certificate", "ik_solver", "ik_row_limits", "ik_inverse", "ik_tracker"),
}  # fmt: skip
"""Files that are broken, and the names of the tests of each, the quickest first."""

OPERATORS = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
COMPARISONS = {
    ast.Lt: ("<", ">="), ast.LtE: ("<=", ">"), ast.Gt: (">", "<="), ast.GtE: (">=", "<"),
    ast.Eq: ("==", "!="), ast.NotEq: ("!=", "=="),
}  # fmt: skip
NAMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "sin": "cos", "cos": "sin"}
SIZES = {"empty", "zeros", "ones", "full", "eye", "arange", "reshape", "empty_like"}
"""What is called with sizes of arrays: a larger one changes nothing, and a smaller one the memory beside it."""

BUSY = 1500
"""Processor time [s] after which the tests of a mutant count as hanging: several times what they take."""

MEMORY = 8 << 30
"""Address space [bytes] that the tests of a mutant may use."""


@dataclass(frozen=True)
class Mutant:
    """A place in a file and what it is changed to; lines count from 1, columns from 0 in bytes."""

    file: str
    line: int
    column: int
    before: str
    after: str

    def apply(self, text: str) -> str:
        """Return the source `text` with the change."""
        lines = text.encode().splitlines(keepends=True)
        line, before = lines[self.line - 1], self.before.encode()
        if not line.startswith(before, self.column):
            raise ValueError(f"{self.file}:{self.line}: {self.before!r} is not at column {self.column}")
        lines[self.line - 1] = line[: self.column] + self.after.encode() + line[self.column + len(before) :]
        return b"".join(lines).decode()

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column + 1}: {self.before} -> {self.after}"


class _Places(ast.NodeVisitor):
    """Collects the mutants of a source; what is not computed (texts, types, decorators, sizes) is left alone."""

    def __init__(self, file: str, text: str) -> None:
        self.file, self.lines, self.found = file, text.encode().splitlines(), list[Mutant]()
        self.visit(ast.parse(text))

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        for part in [*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body]:
            self.visit(part)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value:
            self.visit(node.value)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Texts tell; they compute nothing."""

    def visit_Raise(self, node: ast.Raise) -> None:
        """Nor do messages."""

    def visit_BinOp(self, node: ast.BinOp) -> None:
        old = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}.get(type(node.op))
        if old:
            self._between(node.left, node.right, old, OPERATORS[type(node.op)])
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        old = {ast.Add: "+=", ast.Sub: "-="}.get(type(node.op))
        if old:
            self._between(node.target, node.value, old, "-=" if old == "+=" else "+=")
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        for left, operator, right in zip(
            [node.left, *node.comparators], node.ops, node.comparators, strict=False
        ):
            if type(operator) in COMPARISONS:
                self._between(left, right, *COMPARISONS[type(operator)])
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        old, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        self._between(node.values[0], node.values[1], old, new)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.USub | ast.Not):
            self._add(node, "-" if isinstance(node.op, ast.USub) else "not ", "")
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name in NAMES:
            end = node.func.end_col_offset or 0
            line = node.func.end_lineno or 0
            self.found.append(Mutant(self.file, line, end - len(name), name, NAMES[name]))
        if name in SIZES:
            return
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self._add(node, str(value), str(not value))
        elif isinstance(value, int):  # indices stay within the three axes: outside is the memory of others
            self._add(node, str(value), str({0: 1, 1: 0, 2: 1}.get(value, value - 1)))
        elif isinstance(value, float):
            text = self.lines[node.lineno - 1][node.col_offset : node.end_col_offset].decode()
            self._add(node, text, repr(1.1 * value) if value else "1.0")

    def _add(self, node: ast.expr, before: str, after: str) -> None:
        mutant = Mutant(self.file, node.lineno, node.col_offset, before, after)
        if self.lines[node.lineno - 1].startswith(before.encode(), node.col_offset):
            self.found.append(mutant)

    def _between(self, left: ast.expr, right: ast.expr, before: str, after: str) -> None:
        """Add a change of the operator between two expressions, if it stands in the line where the first ends."""
        line, start = left.end_lineno or 0, left.end_col_offset or 0
        end = right.col_offset if right.lineno == line else len(self.lines[line - 1])
        at = re.search(rb"(?<!\*)" + re.escape(before.encode()) + rb"(?!\*)", self.lines[line - 1][start:end])
        if at:
            self.found.append(Mutant(self.file, line, start + at.start(), before, after))


def mutants(file: str, text: str) -> list[Mutant]:
    """Return all mutants of the source `text`."""
    return _Places(file, text).found


def draw(sources: dict[str, str], seed: int) -> Iterator[Mutant]:
    """Yield mutants without end or repetition, until there are no more: a file at random, then a place in it."""
    dice = random.Random(seed)
    left = {file: mutants(file, text) for file, text in sources.items()}
    while any(left.values()):
        file = dice.choice(sorted(file for file, places in left.items() if places))
        yield left[file].pop(dice.randrange(len(left[file])))


def test_files(file: str) -> list[str]:
    """Return the paths of the tests of a file, each once."""
    names = dict.fromkeys(TESTS[file])
    return [str(path.relative_to(ROOT)) for name in names for path in ROOT.glob(f"tests/*/test_{name}.py")]


def run_tests(tree: Path, files: Sequence[str], log: Path) -> str | None:
    """Run tests in `tree` until one fails; return its name, or None if all pass."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (BUSY, BUSY))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    command = [sys.executable, "-m", "pytest", "-x", "-p", "no:cacheprovider", *files]
    environment = {**os.environ, "PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"}
    with log.open("w", encoding="utf-8") as out:
        code = subprocess.call(
            command, cwd=tree, env=environment, stdout=out, stderr=subprocess.STDOUT, preexec_fn=limit
        )
    if code == 0:
        return None
    failed = re.search(
        r"^(?:FAILED|ERROR) (.+?)(?: - .*)?$", log.read_text(encoding="utf-8", errors="replace"), re.MULTILINE
    )
    return failed[1] if failed else f"ended with {code}"


def copy_tree(source: Path, target: Path) -> None:
    """Copy a checkout with its compiled loops, which are good for as long as the times of their sources are kept."""
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(source, target, symlinks=True, ignore=LEFT_OUT)


def try_mutant(mutant: Mutant, warm: Path, tree: Path) -> str | None:
    """Make the mutant in a new copy of `warm` at `tree`; return the test that it fails, or None if it survives."""
    copy_tree(warm, tree)
    path = tree / mutant.file
    path.write_text(mutant.apply(path.read_text(encoding="utf-8")), encoding="utf-8")
    return run_tests(tree, test_files(mutant.file), tree / "mutant.log")


def main(arguments: Sequence[str] | None = None) -> int:
    """Try mutants; return 0 if enough of them are killed, 1 if not, 2 if a test fails without any."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=60, help="mutants in all (60)")
    parser.add_argument("--seed", type=int, default=1, help="of the draw (1)")
    parser.add_argument("--files", default="", help="only files whose path holds this text")
    parser.add_argument(
        "--results", type=Path, default=ROOT / "build" / "mutants.jsonl", help="kept and gone on with"
    )
    parser.add_argument("--again", action="store_true", help="try those that survived once more")
    parser.add_argument("--list", action="store_true", help="show the mutants, try none")
    asked = parser.parse_args(arguments)
    sources = {file: (ROOT / file).read_text(encoding="utf-8") for file in TESTS if asked.files in file}
    chosen = [mutant for mutant, _ in zip(draw(sources, asked.seed), range(asked.count), strict=False)]
    if asked.list:
        print(*chosen, sep="\n")
        return 0
    asked.results.parent.mkdir(parents=True, exist_ok=True)
    known = read_results(asked.results)
    if asked.again:
        known = {mutant: killer for mutant, killer in known.items() if killer}
    todo = sorted(
        (m for m in chosen if m not in known), key=lambda m: "njit" in sources[m.file]
    )  # quick ones first
    with tempfile.TemporaryDirectory(prefix="tripod_mutants_") as folder:
        warm, tree = Path(folder) / "warm", Path(folder) / "mutant"
        copy_tree(ROOT, warm)
        print(f"{len(todo)} mutants to try", flush=True)
        sound: set[str] = set()
        for mutant in todo:
            killer = try_mutant(mutant, warm, tree)
            if killer and "::" in killer and killer not in sound:  # it kills if it passes otherwise
                there = killer.replace(str(tree), str(warm))  # some tests are named by the path of a scene
                if run_tests(warm, [there], Path(folder) / "warm.log"):
                    print(f"mutate: {killer} fails without any mutant, too", file=sys.stderr)
                    return 2
                sound.add(killer)
            known[mutant] = killer
            with asked.results.open("a", encoding="utf-8") as file:
                file.write(row(mutant, killer))
            print(f"{mutant}: {f'killed by {killer}' if killer else 'SURVIVED'}", flush=True)
    return tell(chosen, known)


def row(mutant: Mutant, killer: str | None) -> str:
    """Return a line of a file of results."""
    return json.dumps({**asdict(mutant), "killed_by": killer}) + "\n"


def read_results(path: Path) -> dict[Mutant, str | None]:
    """Return what killed each mutant of a file of results, the newest word of each; None for those that survived."""
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    rows = [json.loads(line) for line in lines]
    return {Mutant(**{k: v for k, v in row.items() if k != "killed_by"}): row["killed_by"] for row in rows}


def tell(chosen: Sequence[Mutant], known: dict[Mutant, str | None]) -> int:
    """Print how many of `chosen` were killed, and those that survived; return 0 if nine of ten were, else 1."""
    survivors = [str(mutant) for mutant in chosen if known[mutant] is None]
    print(
        f"killed {len(chosen) - len(survivors)} of {len(chosen)}; survivors:",
        *survivors or ["none"],
        sep="\n  ",
    )
    return 0 if 10 * len(survivors) <= len(chosen) else 1


if __name__ == "__main__":
    sys.exit(main())
