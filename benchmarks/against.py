"""Time the steps of all scenes in two checkouts in turn: `python benchmarks/against.py OLD [SCENE ...]`.

OLD is another checkout of this project, such as a worktree of an earlier commit. Each scene makes the same steps with
its own motion, in each checkout in a process of its own, `--turns` times in turn, so that other work on the machine
meets both. Prints the CPU time of a step [ms], the least of all turns, and the ratio new / old. Words with `=` change
the scenes, as `--set` does. Ends with 1 if a ratio is above `--limit`.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

NEW = Path(__file__).resolve().parents[1]

PROGRAM = """
import sys, time
from tripod_sim import Simulation, load_scene
from tripod_sim.errors import StepError
try:
    from tripod_sim.scene.script import script_of
except ImportError:
    from tripod_sim.scene.script import script_of
name, steps, *words = sys.argv[1:]
scene = load_scene(name, words)
script = script_of(scene, None, None)
simulation = Simulation(script.started(scene) if script else scene)
taken = []
for k in range(int(steps)):
    joints = script.joints(simulation.command, (k + 1) * scene.dt) if script else None
    begin = time.thread_time()
    simulation.step(joints)
    taken.append(time.thread_time() - begin)
print(sum(taken[1:]) / max(1, len(taken) - 1))
"""


def step_time(checkout: Path, name: str, steps: int, words: list[str]) -> float:
    """Return the mean CPU time of a step [s] in a checkout, the first left out. Raises CalledProcessError."""
    environment = {**os.environ, "PYTHONPATH": str(checkout)} | dict.fromkeys(
        ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1"
    )
    command = [sys.executable, "-c", PROGRAM, name, str(steps), *words]
    done = subprocess.run(
        command, cwd=checkout, env=environment, check=True, stdout=subprocess.PIPE, text=True, timeout=600
    )
    return float(done.stdout.split()[-1])


def main() -> int:
    """Run it; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("old", type=Path, help="the other checkout")
    parser.add_argument(
        "words", nargs="*", help="scenes, all by default, and changes of them such as mesh.level=7"
    )
    parser.add_argument("--steps", type=int, default=200, help="steps of each scene")
    parser.add_argument("--turns", type=int, default=3, help="runs in each checkout")
    parser.add_argument("--limit", type=float, default=1.1, help="largest ratio")
    options = parser.parse_intermixed_args()
    from tripod_sim.scene.file import scene_names  # noqa: PLC0415 - after the arguments

    changes = [word for word in options.words if "=" in word]
    slower = 0
    print(f"{'scene':<16}{'old':>9}{'new':>9}  new / old")
    for name in [word for word in options.words if "=" not in word] or scene_names():
        places = (options.old.resolve(), NEW)
        for place in places:
            step_time(place, name, 2, changes)  # compiles
        turns = [
            [step_time(place, name, options.steps, changes) for place in places] for _ in range(options.turns)
        ]
        old, new = (1e3 * min(times) for times in zip(*turns, strict=True))
        slower += new > options.limit * old
        print(f"{name:<16}{old:9.3f}{new:9.3f}  {new / old:.2f}", flush=True)
    return int(bool(slower))


if __name__ == "__main__":
    raise SystemExit(main())
