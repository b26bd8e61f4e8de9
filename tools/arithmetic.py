"""Run the tests with other kinds of arithmetic: `python -m tools.arithmetic [KIND ...] [-- pytest arguments]`.

Processors differ in the last bits of a result: some fuse multiplications with additions, and they sum in vectors of
different lengths. A test that passes with one kind and fails with another asks for one of several equally right
answers, or the program decides by rounding. A kind names the processor that Numba compiles for and the kernels that
OpenBLAS takes; kinds that this processor cannot run are left out. Each kind has a log in build/arithmetic. A kind that
has passed since the last change of the checkout is not run again, so an interrupted run continues where it was. The
exit code is 0 if all passed, 1 if a test failed, 2 for wrong arguments, 130 if interrupted.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "build" / "arithmetic"
INTERRUPTED = 130

HASWELL = "+avx,+avx2,+bmi,+bmi2,+f16c,+fma,+lzcnt,+movbe,+popcnt,+sse4.2,-avx512f"
"""Features of the processor `haswell`: Numba would add those of this machine."""

VARIABLES = ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE")


@dataclass(frozen=True)
class Kind:
    """A kind of arithmetic: which of `VARIABLES` are set, and the flags of /proc/cpuinfo that it needs."""

    environment: Mapping[str, str]
    needs: tuple[str, ...] = ()


KINDS = {
    "native": Kind({}),
    "generic-haswell": Kind({"NUMBA_CPU_NAME": "generic", "OPENBLAS_CORETYPE": "Haswell"}, ("avx2",)),
    "haswell-zen": Kind(
        {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": HASWELL, "OPENBLAS_CORETYPE": "Zen"},
        ("avx2", "fma"),
    ),
    "native-haswell": Kind({"OPENBLAS_CORETYPE": "Haswell"}, ("avx512f",)),
    "native-skylakex": Kind(
        {"OPENBLAS_CORETYPE": "SkylakeX"}, ("avx512f", "avx512dq", "avx512bw", "avx512vl")
    ),
}
"""The processor that Numba compiles for, then the kernels of OpenBLAS; `native` and nothing: this machine's own."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the tests with each kind that is asked for; return the exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    end = words.index("--") if "--" in words else len(words)
    own, given = words[:end], words[end + 1 :]
    parser = argparse.ArgumentParser(
        prog="python -m tools.arithmetic",
        description=(__doc__ or "").split("\n\n")[1],
        epilog="example: python -m tools.arithmetic generic-haswell -- tests/sim -k contact",
    )
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"of: {', '.join(KINDS)}; without any: all")
    chosen = parser.parse_args(own).kinds or list(KINDS)
    if unknown := [name for name in chosen if name not in KINDS]:
        parser.error(f"unknown kind {unknown[0]!r}; there are: {', '.join(KINDS)}")
    failed = []
    for name in chosen:
        if missing := [flag for flag in KINDS[name].needs if flag not in processor_flags()]:
            print(f"{name}: left out, this processor has no {', '.join(missing)}", flush=True)
            continue
        try:
            if not passes(name, given):
                failed.append(name)
        except KeyboardInterrupt:
            print(f"{name}: interrupted; the same command continues with it", flush=True)
            return INTERRUPTED
    if failed:
        print(f"failed with: {', '.join(failed)}", flush=True)
    return 1 if failed else 0


def passes(name: str, arguments: Sequence[str]) -> bool:
    """Return whether the tests pass with the kind `name`; run them unless they have since the last change."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    log, result = RESULTS / f"{name}.log", RESULTS / f"{name}.json"
    inputs = {"sources": state_of_sources(), "arguments": list(arguments)}
    if result.exists() and json.loads(result.read_text(encoding="utf-8")) == inputs:
        print(f"{name}: passed before", flush=True)
        return True
    print(f"{name}: running the tests; log: {log}", flush=True)
    command = [sys.executable, "-m", "pytest", "-n", "auto", "--dist=worksteal", *arguments]
    start = time.monotonic()
    with log.open("w", encoding="utf-8") as out:
        code = subprocess.call(command, cwd=ROOT, env=environment(name), stdout=out, stderr=subprocess.STDOUT)
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    for line in [*(word for word in lines if word.startswith(("FAILED", "ERROR"))), *lines[-1:]]:
        print(f"{name}: {line}", flush=True)
    print(
        f"{name}: {'passed' if code == 0 else 'failed'} after {(time.monotonic() - start) / 60:.1f} min",
        flush=True,
    )
    if code == 0:
        result.write_text(json.dumps(inputs), encoding="utf-8")
    return code == 0


def environment(name: str) -> dict[str, str]:
    """Return the environment in which programs have the arithmetic of the kind `name`."""
    return {k: v for k, v in os.environ.items() if k not in VARIABLES} | dict(KINDS[name].environment)


def processor_flags() -> set[str]:
    """Return what this processor can do, in the words of /proc/cpuinfo."""
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        key, _, value = line.partition(":")
        if key.strip() in {"flags", "Features"}:
            return set(value.split())
    return set()


def state_of_sources() -> str:
    """Return a digest of the commit and of what differs from it."""
    digest = hashlib.sha256()
    for words in (["rev-parse", "HEAD"], ["diff", "HEAD"], ["ls-files", "--others", "--exclude-standard"]):
        digest.update(subprocess.check_output(["git", *words], cwd=ROOT))
    return digest.hexdigest()


if __name__ == "__main__":
    sys.exit(main())
