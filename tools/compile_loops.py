"""Compile the loops of the simulator for this machine, so that no first run has to: `python -m tools.compile_loops`.

Numba keeps them beside their sources until those change. Scenes are shared out to the processors; each worker builds
one and takes every way once that its steps take. What is asked for beyond the scenes as shipped (other schemes,
elements) compiles when it is first used.
"""

import argparse
import multiprocessing
import os
import sys
from collections.abc import Sequence

from tripod_host.program import set_environment

DEAREST = ("tripod", "drape", "cloth", "maze")
"""Scenes that have most to compile: they come first, so that no worker ends long after the others."""


def main(scenes: Sequence[str] | None = None) -> int:
    """Compile what `scenes` need, all that are shipped if None; return the exit code: 0, or 130 if interrupted."""
    from tripod_sim import scene_names  # noqa: PLC0415 - heavy

    set_environment()  # of the programs that will run them
    todo = sorted(scenes or scene_names(), key=lambda name: (name not in DEAREST, name != DEAREST[0], name))
    workers = min(len(os.sched_getaffinity(0)), len(todo))
    try:
        with multiprocessing.get_context("spawn").Pool(workers) as pool:
            for count, name in enumerate(pool.imap_unordered(compile_scene, todo, chunksize=1), start=1):
                print(f"compiled the loops of {count} of {len(todo)} scenes: {name}", flush=True)
    except KeyboardInterrupt:
        return 130
    return 0


def compile_scene(name: str) -> str:
    """Build the scene, rehearse its steps and its fields, telling loop by loop; return the name."""
    from tripod_bringup.compiling import compiling_told  # noqa: PLC0415 - heavy
    from tripod_sim import Simulation, load_scene  # noqa: PLC0415 - heavy

    with compiling_told("setup", say=lambda text: print(text, flush=True) if text else None):
        simulation = Simulation(load_scene(name))
        simulation.rehearse()
        fields = simulation.fields()
        fields.values(fields.names, simulation.positions)
    return name


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("scenes", nargs="*", help="which ones; all that are shipped if none is named")
    sys.exit(main(parser.parse_args().scenes))
