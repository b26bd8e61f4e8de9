"""A recorded session made again: `tripod up --demo` for so many minutes, then `tripod bag play --to sim`.

    python benchmarks/replay.py --minutes 10

Prints how many bodies are equal bit for bit, how long playing took at rate 4 and as fast as it goes, and the CPU time
of both. Exit code 1 if a body differs.
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

TRIPOD = [sys.executable, "-m", "tripod_bringup"]


def run(*words: str) -> tuple[str, float, float]:
    """Return what a command of tripod prints, wall and CPU time [s]; end with it if it fails."""
    begin, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([*TRIPOD, *words], capture_output=True, text=True, check=False)
    wall, after = time.monotonic() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        sys.exit(f"tripod {' '.join(words)}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout, wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--scene", default="tripod")
    options = parser.parse_args()
    os.environ.setdefault("ROS_DOMAIN_ID", "89")
    with tempfile.TemporaryDirectory() as folder:
        words = ["--scene", options.scene, "--demo", "--no-view", "--duration", f"{60 * options.minutes:g}"]
        run("up", *words, "--record", folder)
        (bag,) = (path for path in Path(folder).iterdir() if path.is_dir())
        size = sum(file.stat().st_size for file in bag.glob("*.mcap"))
        print(f"recorded {options.minutes:g} min of {options.scene}, {size / 1e6:.1f} MB\n")
        print("| rate | wall [s] | CPU [s] | |\n|---|---|---|---|")
        for rate in ("4", "inf"):
            out, wall, cpu = run("bag", "play", str(bag), "--to", "sim", "--rate", rate)
            (line,) = (line for line in out.splitlines() if "made again" in line or "differ" in line)
            print(f"| {rate} | {wall:.1f} | {cpu:.1f} | {line} |", flush=True)


if __name__ == "__main__":
    main()
