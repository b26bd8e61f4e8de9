"""Our simulator beside other simulators of deformables, in one run: the same bodies, loads and references for all.

Cases and what is measured: see `peers_cases.py`. Peers are an optional extra, `pip install 'tripod[peers]'`; one that
is missing gives rows that say so. Each simulator and case runs in a process of its own on one thread; CPU time is that
of the whole process while it steps, without building the model and compiling kernels. What is done is kept in
docs/peers.json and not computed again, so the command can be stopped and repeated; then `python benchmarks/evidence.py`
renews docs/peers.md.

    python benchmarks/peers.py                                    # all that is missing: some minutes, a quiet machine
    python benchmarks/peers.py --quick                            # one setting of each simulator and case
    python benchmarks/peers.py --cases cloth "y L1" --peers tripod MuJoCo
    python benchmarks/peers.py --fresh                            # measure everything again
"""

import argparse
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks.calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from benchmarks.peers_notes import NOTES

STORE = Path(__file__).resolve().parents[1] / "docs" / "peers.json"

PEERS = {
    "tripod": ("benchmarks.peers_own", "tripod_sim"),
    "MuJoCo": ("benchmarks.peers_mujoco", "mujoco"),
    "Newton": ("benchmarks.peers_newton", "newton"),
    "PyBullet": ("benchmarks.peers_pybullet", "pybullet"),
}
"""Simulators: the module that runs each, and the package that must be there."""

CASES = ("cantilever rest", "cantilever swing", "y L1", "y L2", "cloth")

MISSING = "not installed: pip install 'tripod[peers]'"

LIMIT = 120.0
"""Longest wait for one row [s]: compiling Newton's kernels for the first time takes a minute."""

SHORT = 0.5
"""Runs of less CPU time are repeated [s]."""

MARK = "ROW "
"""Begins the lines in which a worker reports; simulators print lines of their own."""


@dataclass
class Row:
    """What one setting gives; numbers are None where there is nothing to say.

    Attributes:
        case, peer, version, setting: Names.
        unknowns: Coordinates that move.
        error: In percent, as the case's reference measures it.
        cpu: CPU time of the run, the fastest of up to three [s].
        simulated: Time that it simulates [s]; 0 for a static solution.
        note: Why there is no result, or what the simulator warned of.
        calibration: CPU time of the product of `calibration.py` beside it [s].
        load: Mean number of processes that wanted to run in the minute before; on a quiet machine about 1.
    """

    case: str
    peer: str
    version: str = ""
    setting: str = ""
    unknowns: int | None = None
    error: float | None = None
    cpu: float | None = None
    simulated: float | None = None
    note: str = ""
    calibration: float | None = None
    load: float | None = None

    @property
    def key(self) -> tuple[str, str, str]:
        """What is computed once."""
        return self.case, self.peer, self.setting


def read(store: Path) -> dict:
    """Return what is stored: "references" by case, "rows"."""
    if not store.exists():
        return {"references": {}, "rows": []}
    try:
        found = json.loads(store.read_text())
        found["rows"] = [Row(**row) for row in found["rows"]]
    except (ValueError, KeyError, TypeError) as error:
        raise SystemExit(
            f"{store}: not a result of this script ({error}); remove it, or use --fresh"
        ) from error
    return found


def write(store: Path, found: dict) -> None:
    """Store what is found, whole or not at all."""
    references = ",\n".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in found["references"].items())
    rows = ",\n".join(json.dumps(asdict(row)) for row in found["rows"])
    text = f'{{"references": {{\n{references}\n}},\n"rows": [\n{rows}\n]}}'
    beside = store.with_suffix(".part")
    beside.write_text(text + "\n")
    beside.replace(store)


def work(peer: str, case: str, settings: list[str], reference: dict) -> Iterator[Row]:
    """Measure settings of a simulator in this process. Yields a row for each."""
    from benchmarks.peers_cases import Reference  # noqa: PLC0415 - workers only

    module = import_module(PEERS[peer][0])
    right = Reference(np.array(reference["values"]), reference["scale"], reference["uncertainty"], "")
    for setting in module.SETTINGS[case]:
        if setting.name not in settings:
            continue
        row = Row(case, peer, module.version(), setting.name)
        try:
            prepared = module.prepare(case, setting.options)
            values, row.cpu = _timed(prepared.run)
            for _ in range(2):
                if row.cpu < SHORT:
                    row.cpu = min(row.cpu, _timed(prepared.run)[1])
        except Exception as error:  # noqa: BLE001 - a simulator that fails gives a row that says so
            row.note = f"failed: {type(error).__name__}: {' '.join(str(error).split())[:120]}"
            yield row
            continue
        row.unknowns, row.simulated, row.calibration = prepared.unknowns, prepared.simulated, calibration(3)
        row.load = os.getloadavg()[0]
        error = right.error(values)
        if error < 1000:
            row.error = error
        else:
            row.note = "diverged"
        if warned := getattr(module, "warnings", list)():
            row.note = "; ".join(filter(None, [row.note, *warned]))
        yield row


def _timed(run) -> tuple[np.ndarray, float]:
    start = time.process_time()
    values = run()
    return values, time.process_time() - start


def measure(
    peer: str, case: str, settings: list[str], reference: dict, limit: float = LIMIT
) -> Iterator[Row]:
    """Measure settings in a process of their own, so that one that crashes or hangs costs its own row alone."""
    waiting = list(settings)
    while waiting:
        command = [sys.executable, __file__, "--worker", peer, case, json.dumps(waiting)]
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        assert process.stdin
        assert process.stdout
        try:
            process.stdin.write(json.dumps(reference))
            process.stdin.close()
            watch = _watch(process, limit)
            for line in process.stdout:
                if line.startswith(MARK):
                    watch.cancel()
                    row = Row(**json.loads(line[len(MARK) :]))
                    waiting.remove(row.setting)
                    yield row
                    watch = _watch(process, limit)
            watch.cancel()
            code = process.wait()
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        if waiting:
            failed = waiting.pop(0)
            why = f"took over {limit:g} s" if code == -9 else f"crashed (exit code {code})"
            yield Row(case, peer, "", failed, note=why)


def _watch(process: subprocess.Popen, limit: float) -> threading.Timer:
    timer = threading.Timer(limit, process.kill)
    timer.daemon = True
    timer.start()
    return timer


def reference_of(case: str, found: dict) -> dict:
    """Return the reference of a case, computed where it is not yet stored."""
    if case not in found["references"]:
        from benchmarks import peers_own  # noqa: PLC0415

        r = peers_own.reference(case)
        found["references"][case] = {
            "values": np.round(r.values, 9).tolist(),
            "scale": r.scale,
            "uncertainty": r.uncertainty,
            "source": r.source,
        }
    return found["references"][case]


def compute(
    found: dict, cases: list[str], peers: list[str], *, quick: bool, store: Path, limit: float = LIMIT
) -> None:
    """Measure what is missing, and store each row as it comes."""
    for case in cases:
        print(f"{case}: reference", file=sys.stderr)
        reference = reference_of(case, found)
        write(store, found)
        for peer in peers:
            done = {
                row.key for row in found["rows"] if row.error is not None or row.note.startswith("diverged")
            }
            module, package = PEERS[peer]
            kept = [r for r in found["rows"] if (r.case, r.peer) == (case, peer) and r.key in done]
            found["rows"] = [r for r in found["rows"] if (r.case, r.peer) != (case, peer)]
            if find_spec(package) is None:
                found["rows"] += kept or [Row(case, peer, note=MISSING)]
                write(store, found)
                continue
            runner = import_module(module)
            settings = runner.SETTINGS.get(case, [])
            found["rows"] += [r for r in kept if r.setting in {s.name for s in settings}]
            if not settings:
                found["rows"].append(Row(case, peer, runner.version(), note=NOTES[peer][case]))
            names = [s.name for s in settings if (s.quick or not quick) and (case, peer, s.name) not in done]
            for row in measure(peer, case, names, reference, limit) if names else ():
                found["rows"].append(row)
                write(store, found)
                said = f"{row.error:.3g} %, {row.cpu:.3g} s" if row.error is not None else row.note
                print(f"{case}: {peer}: {row.setting}: {said}", file=sys.stderr, flush=True)
    write(store, found)


def main() -> None:
    """Compute what is missing."""
    if "--worker" in sys.argv:
        peer, case, names = sys.argv[2:5]
        reference = json.load(sys.stdin)
        for row in work(peer, case, json.loads(names), reference):
            print(MARK + json.dumps(asdict(row)), flush=True)
        return
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--cases", nargs="+", choices=CASES, default=list(CASES), metavar="CASE", help=", ".join(CASES)
    )
    parser.add_argument(
        "--peers", nargs="+", choices=PEERS, default=list(PEERS), metavar="PEER", help=", ".join(PEERS)
    )
    parser.add_argument("--quick", action="store_true", help="one setting of each simulator and case")
    parser.add_argument("--fresh", action="store_true", help="forget what is stored of these cases and peers")
    options = parser.parse_args()
    found = read(STORE)
    if options.fresh:
        found["rows"] = [
            r for r in found["rows"] if r.case not in options.cases or r.peer not in options.peers
        ]
        if set(options.peers) == set(PEERS):
            found["references"] = {k: v for k, v in found["references"].items() if k not in options.cases}
    print(f"1000 x 1000 float64 product, one thread: {1e3 * calibration():.1f} ms")
    try:
        compute(found, options.cases, options.peers, quick=options.quick, store=STORE)
    except KeyboardInterrupt:
        print("\nstopped; what is done is kept, the same command goes on", file=sys.stderr)
        sys.exit(130)


if __name__ == "__main__":
    main()
