"""Largest memory of meshing over the tetrahedra that are made, for five sizes of three parts each.

    python benchmarks/mesher_memory.py

Prints a JSON object for each mesh: mesher, part, size [m], tetrahedra, those that `check_size` expects, and the largest
resident memory [MB] of the mesher's process (at least what its parent had when it began) and of the process that waits
for it and checks the mesh. Then the sum of both over the tetrahedra expected, by least squares of relative errors.
The constants of tripod_sim/mesh/part/part.py are from it. Needs the extras `cad` and `step`.
"""

import json
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from examples.own_part import outline, prism, step_text
from tests.sim.broken_surfaces import ball, box, write_stl
from tripod_sim.mesh.part.part import SHARE, PartSettings, mesh_part

SIZES = (0.3, 0.2, 0.14, 0.1, 0.07)
"""Edges over the smallest extent of a part."""


def parts(folder: Path) -> dict[tuple[str, str], tuple[Path, float]]:
    """Return files by mesher and name, each with its smallest extent [m]."""
    corners = {"bar": np.array([[0, 0], [40, 0], [40, 12], [0, 12]]), "notched": outline()}
    corners["beam"] = np.array([[0, 0], [120, 0], [120, 12], [0, 12]])
    found = {}
    for name, sides in corners.items():
        path = folder / f"{name}.step"
        path.write_text(step_text(*prism(sides)))
        found["gmsh", name] = (path, 0.012)
    for name, triangles, extent in (
        ("ball", ball(level=4), 0.02),
        ("fine ball", ball(level=6), 0.02),
        ("box", box((30, 20, 10)), 0.01),
    ):
        found["fTetWild", name] = (write_stl(folder / f"{name}.stl", triangles), extent)
    return found


def measured(path: Path, size: float) -> dict[str, Any]:
    """Return tetrahedra, those expected, and the largest memory of the child processes [MB] of this process."""
    mesh = mesh_part(
        path, PartSettings(size, None if path.suffix == ".step" else 1e-3, time_limit=900.0), "PART"
    )
    mesher, own = (
        resource.getrusage(who).ru_maxrss / 1024 for who in (resource.RUSAGE_CHILDREN, resource.RUSAGE_SELF)
    )
    expected = round(SHARE * mesh.volume_before / size**3)
    return {"tetrahedra": mesh.mesh.count, "expected": expected, "mesher": round(mesher), "own": round(own)}


def main() -> None:
    """Measure each mesh from a process of its own, and print."""
    if len(sys.argv) > 1:
        print(json.dumps(measured(Path(sys.argv[1]), float(sys.argv[2]))))
        return
    rows: dict[str, list[tuple[float, float]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for (mesher, name), (path, extent) in parts(Path(folder)).items():
            for share in SIZES:
                words = [sys.executable, __file__, str(path), str(share * extent)]
                done = subprocess.run(words, capture_output=True, text=True, check=False)
                if done.returncode:
                    print(
                        json.dumps(
                            {"mesher": mesher, "part": name, "error": done.stderr.strip().splitlines()[-1]}
                        )
                    )
                    continue
                found = json.loads(done.stdout)
                print(json.dumps({"by": mesher, "part": name, "size": share * extent, **found}), flush=True)
                rows.setdefault(mesher, []).append((found["expected"], found["mesher"] + found["own"]))
    for mesher, pairs in rows.items():
        count, memory = np.array(pairs).T
        slope, base = np.linalg.lstsq(
            np.stack([count / memory, 1 / memory], axis=1), np.ones(len(count)), rcond=None
        )[0]
        worst = (memory / (slope * count + base)).max()
        print(
            f"{mesher}: {1e3 * slope:.3g} kB a tetrahedron expected + {base:.3g} MB; at most {worst:.2f} times that"
        )


if __name__ == "__main__":
    main()
