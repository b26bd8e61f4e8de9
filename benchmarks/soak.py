"""Whether `tripod up --demo` keeps its size: the memory of each of its processes while it runs and records.

Plays the demo with the page and a recording for `--minutes`, reads the resident size (RSS) of every process of the
group ten times a minute, and prints the median of each minute. From minute `--from` on no process may be further than
2 % from where it was in that minute; the exit code says whether (0 yes, 1 no).
"""

import argparse
import os
import re
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
ALLOWED = 0.02
"""Largest distance of a minute's size from that of the first minute that counts, as a share of the latter."""
PERIOD = 6.0
"""Between two looks [s]."""
PATIENCE = 300.0
"""For the start of the chain, and for its end [s]."""


def resident(pid: int) -> int:
    """Return the resident size of a process [B]; raises OSError if it is gone."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def group(pid: int) -> dict[str, int]:
    """Return the processes of `tripod up` by name: itself and its nodes."""
    found = {"up": pid}
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    for child in map(int, children):
        words = Path(f"/proc/{child}/cmdline").read_bytes().decode().split("\0")
        for match in (re.fullmatch(r"tripod_(\w+)\.node", word) for word in words):
            if match:
                found[match[1]] = child
    return found


def sizes(pid: int) -> dict[str, int]:
    """Return the resident size of each process of the group by name [B]."""
    return {name: resident(number) for name, number in group(pid).items()}


def free_port() -> int:
    """Return a port of this machine that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def start(directory: Path, seconds: float, log: Path) -> subprocess.Popen[bytes]:
    """Start the demo; what it prints goes to `log`."""
    words = ["up", "--demo", "--duration", f"{seconds:g}", "--record", str(directory)]
    words += ["--view-port", str(free_port())]
    command = [sys.executable, "-c", "from tripod_bringup.cli import main; main()", *words]
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH", ""))))
    with log.open("wb") as out:
        return subprocess.Popen(
            command, stdout=out, stderr=subprocess.STDOUT, env=dict(os.environ, PYTHONPATH=path)
        )


def wait_for_all(process: subprocess.Popen[bytes], log: Path) -> None:
    """Wait until the simulation runs and the driver moves; raises RuntimeError if that does not come."""
    end = time.monotonic() + PATIENCE
    while b"moved by the inverse kinematics" not in log.read_bytes():
        if process.poll() is not None or time.monotonic() > end:
            raise RuntimeError(f"the demo did not start:\n{log.read_text()}")
        time.sleep(1.0)


def watched(process: subprocess.Popen[bytes], minutes: int) -> list[dict[str, float]]:
    """Return the median size of each process in each minute [B]; ends early with the process."""
    table: list[dict[str, float]] = []
    begun = time.monotonic()
    for minute in range(minutes):
        seen: dict[str, list[int]] = {}
        while time.monotonic() < begun + 60 * (minute + 1):
            if process.poll() is not None:
                return table
            for name, size in sizes(process.pid).items():
                seen.setdefault(name, []).append(size)
            time.sleep(PERIOD)
        table.append({name: statistics.median(values) for name, values in seen.items()})
        print_row(minute + 1, table[-1], head=minute == 0)
    return table


def print_row(minute: int, row: dict[str, float], *, head: bool) -> None:
    """Print the sizes of one minute [MB]."""
    if head:
        print("| minute | " + " | ".join(f"{name} [MB]" for name in row) + " |")
        print("|---" * (len(row) + 1) + "|")
    print(f"| {minute} | " + " | ".join(f"{size / 1e6:.1f}" for size in row.values()) + " |", flush=True)


def drift(table: list[dict[str, float]]) -> dict[str, float]:
    """Return the largest distance of each process from its first size, as a share of that, with its sign.

    >>> drift([{"sim": 100.0}, {"sim": 103.0}, {"sim": 99.0}])
    {'sim': 0.03}
    """
    first = table[0]
    return {
        name: max((row.get(name, 0.0) / size - 1.0 for row in table), key=abs) for name, size in first.items()
    }


def main() -> int:
    """Run it; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--minutes", type=int, default=60, help="how long to watch")
    parser.add_argument("--from", type=int, default=10, dest="first", help="first minute that counts")
    options = parser.parse_args()
    if not 1 <= options.first < options.minutes:
        parser.error(f"--from is {options.first}; it must be at least 1 and less than --minutes")
    with tempfile.TemporaryDirectory() as place:
        log = Path(place) / "log"
        process = start(Path(place) / "recordings", 60.0 * options.minutes + PATIENCE, log)
        try:
            wait_for_all(process, log)
            table = watched(process, options.minutes)
            ended = process.poll()
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            process.wait(PATIENCE)
        if ended is not None or len(table) < options.minutes:
            print(f"the demo ended after {len(table)} minutes:\n{log.read_text()}")
            return 1
        print(log.read_text()[log.read_text().rfind("stopped") :])
    counted = drift(table[options.first - 1 :])
    for name, share in counted.items():
        verdict = "kept its size" if abs(share) <= ALLOWED else "DID NOT keep its size"
        print(f"{name}: {100 * share:+.2f} % from minute {options.first} on: {verdict}")
    return 0 if all(abs(share) <= ALLOWED for share in counted.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
