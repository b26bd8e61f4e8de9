"""Step time of scenes without an effect: the package as it is against one from which the effect's files are deleted.

For each effect the package is copied twice, once without the modules of `tripod_sim/effects.py`; each copy runs the
same scene in a process of its own, a block of steps at a time, in turn: A B B A A B B A ... The ratio of each pair of
blocks is free of what the machine does in the long run. Two processes of the same code differ by some percent all
their lives, since their memory lies elsewhere, so each ratio is the median of the pairs of one couple of processes, and
many couples are made; the interval holds the median of all couples with 95 % confidence (order statistics of the
binomial distribution).

    python benchmarks/absent_effects.py [--couples 15] [--pairs 6] [--steps 60] [--write]
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
from doc_parts import write_part

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))

from tripod_sim.effects import EFFECTS  # noqa: E402

SOLID = (
    "tripod",
    "clamp=off",
    "servos=off",
    "effector=off",
    "fixed=[{low=[0.045, -0.02, -0.01], high=[0.06, 0.02, 0.01]}]",
)
CLOTH = (
    "drape",
    "springs.source=grid",
    "springs.nodes=8",
    "springs.size=0.2",
    "springs.position=[0.01, 0.005, 0.205]",
    "sleep=off",
)

WITHOUT: dict[str, tuple[str, ...]] = {
    "gravity": ("tripod", "gravity=off"),
    "inertia": ("tripod", "inertia=off", "damping=off"),
    "damping": ("tripod", "damping=off"),
    "clamp": ("tripod", "clamp=off"),
    "servos": (*SOLID, "solver.mode=newton"),
    "effector": ("tripod", "effector=off"),
    "strain_limit": ("cloth", "springs.nodes=12"),
    "contact": ("cloth", "springs.nodes=12"),
    "obstacles": (*CLOTH, "obstacles=off", "contact.self_contact=true"),
    "rigid": CLOTH,
}
"""The scene on which the absence of an effect is timed; of effects not named here `tripod`. Effects without files of
their own compare the package with itself: what the machine's noise makes of the ratio."""

PAGE, PART = "effects.md", "step times"

WORKER = """
import sys, time
import numpy as np
from tripod_sim import Simulation, load_scene
name, *overrides = sys.argv[2:]
simulation = Simulation(load_scene(name, overrides))
steps = int(sys.argv[1])
def block():
    simulation.reset()
    taken = 0.0
    for k in range(steps + 1):
        joints = simulation.command
        if len(joints) > 1:
            joints[0] -= 0.002
        start = time.thread_time()
        simulation.step(joints)
        if k:  # the first has to factor
            taken += time.thread_time() - start
    return taken / steps
block()
import tripod_sim
print(tripod_sim.__path__[0], *sorted(m for m in sys.modules if m.startswith("tripod_sim")), flush=True)
for _ in sys.stdin:
    print(repr(block()), flush=True)
"""


@dataclass(frozen=True)
class Result:
    """One line of the table: times in s, the ratio of the whole package to the one without, with its interval."""

    effect: str
    scene: str
    deleted: int
    whole: float
    without: float
    ratio: float
    low: float
    high: float


class Worker:
    """A process that runs blocks of steps with one copy of the package."""

    def __init__(self, package: Path, steps: int, scene: tuple[str, ...]) -> None:
        environment = {**os.environ, "PYTHONPATH": str(package)}
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", WORKER, str(steps), *scene],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment, cwd=package,
        )  # fmt: skip
        home, *self.modules = self._answer().split()
        assert Path(home) == package / "tripod_sim", f"the worker runs {home}"

    def _answer(self) -> str:
        assert self._process.stdout
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"a worker ended with {self._process.wait()}")
        return line

    def block(self) -> float:
        """Return the CPU time of a step [s]."""
        assert self._process.stdin
        self._process.stdin.write("go\n")
        self._process.stdin.flush()
        return float(self._answer())

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin
        self._process.stdin.close()
        self._process.wait(timeout=30)


def copied(target: Path, deleted: tuple[str, ...]) -> int:
    """Copy the simulator without some modules, compiled kernels included; return how many files were left out."""
    for package in ("tripod_sim", "tripod_graph"):
        shutil.copytree(ROOT / package, target / package)
    count = 0
    for module in deleted:
        path = target / "tripod_sim" / Path(*module.split("."))
        if path.is_dir():
            count += len(list(path.rglob("*.py")))
            shutil.rmtree(path)
        else:
            path.with_suffix(".py").unlink()
            count += 1
    return count


def interval(ratios: np.ndarray) -> tuple[float, float]:
    """Return the narrowest symmetric order statistics that hold the median with at least 95 % confidence."""
    n, ordered = len(ratios), np.sort(ratios)
    tail, k, chance = 0.0, 0, 0.5**n
    while tail + chance <= 0.025:
        tail += chance
        k += 1
        chance *= (n - k + 1) / k
    k = max(k - 1, 0)
    return float(ordered[k]), float(ordered[n - 1 - k])


def couple(packages: tuple[Path, Path], scene: tuple[str, ...], pairs: int, steps: int) -> np.ndarray:
    """Return the times of a step [s], shape (pairs, 2), of one process of each of two packages."""
    workers = [Worker(package, steps, scene) for package in packages]
    assert workers[0].modules == workers[1].modules, "both copies load the same modules"
    times = np.empty((pairs, 2))
    for k in range(pairs):
        for which in (0, 1) if k % 2 else (1, 0):
            times[k, which] = workers[which].block()
    for worker in workers:
        worker.close()
    return times


def measure(effect: str, couples: int, pairs: int, steps: int) -> Result:
    """Time the absence of `effect`, so many pairs of blocks of so many steps in each couple of processes."""
    scene = WITHOUT.get(effect, ("tripod",))
    with tempfile.TemporaryDirectory() as folder:
        whole, less = Path(folder) / "whole", Path(folder) / "less"
        copied(whole, ())
        deleted = copied(less, EFFECTS[effect].modules)
        times = np.stack([couple((whole, less), scene, pairs, steps) for _ in range(couples)])
    ratios = np.median(times[..., 0] / times[..., 1], axis=1)
    low, high = interval(ratios)
    return Result(
        effect, " ".join(scene), deleted, float(np.median(times[..., 0])), float(np.median(times[..., 1])),
        float(np.median(ratios)), low, high,
    )  # fmt: skip


def table(results: list[Result]) -> list[str]:
    lines = [
        "| absent effect | files deleted | scene | step, whole [µs] | step, deleted [µs] | ratio | 95 % interval |",
        "|---|---|---|---|---|---|---|",
    ]
    for r in results:
        lines.append(
            f"| {r.effect} | {r.deleted or 'none of its own'} | `{r.scene}` | {1e6 * r.whole:.1f} | "
            f"{1e6 * r.without:.1f} | {r.ratio:.4f} | {r.low:.4f} to {r.high:.4f} |"
        )
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--couples", type=int, default=15, help="of processes, for each effect (default 15)")
    parser.add_argument("--pairs", type=int, default=6, help="of blocks, for each couple (default 6)")
    parser.add_argument("--steps", type=int, default=60, help="of a block (default 60)")
    parser.add_argument("--only", nargs="*", choices=EFFECTS, help="effects; all by default")
    parser.add_argument("--write", action="store_true", help=f"put the table into docs/{PAGE}")
    arguments = parser.parse_args()
    results = []
    for effect in arguments.only or EFFECTS:
        results.append(measure(effect, arguments.couples, arguments.pairs, arguments.steps))
        r = results[-1]
        print(f"{effect}: {r.ratio:.4f} ({r.low:.4f} to {r.high:.4f})", file=sys.stderr, flush=True)
    product = f"1000 x 1000 float64 product here: {1e3 * calibration():.1f} ms"
    effort = (
        f"{arguments.couples} couples of processes, {arguments.pairs} pairs of {arguments.steps} steps each"
    )
    lines = [*table(results), "", f"{effort}; {product}."]
    print("\n".join(lines))
    if arguments.write:
        write_part(PAGE, PART, lines)


if __name__ == "__main__":
    main()
