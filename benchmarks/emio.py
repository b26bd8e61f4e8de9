"""The scene `examples/emio.toml` against poses of the robot Emio, measured by its makers with a magnetic tracker.

    python benchmarks/emio.py FILE

FILE has the columns q0_rad .. q3_rad, the motors' angles, and measured_x_mm, .y, .z, the tracker; SOFA and Compliance
Robotics, MIT licence. The data are not ours and not here.

One modulus is found from every fourth pose, a translation of the tracker's frame fitted along; told is the error of the
poses that were not used, with the mean difference removed, for several elements and meshes. Then the same scene meets
the same data with two motors exchanged and with their range shrunk by 10 %.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from tripod_identify.fit import fit
from tripod_identify.left_over import left_over
from tripod_identify.measured import Measured, read_csv
from tripod_identify.model import plainly, predict
from tripod_identify.observe import Point, sources_of
from tripod_identify.parameters import parameters
from tripod_identify.problem import Problem
from tripod_identify.score import score
from tripod_sim import load_scene
from tripod_sim.scene import Scene

SCENE = Path(__file__).parents[1] / "examples" / "emio.toml"
POINTS = (Point("tracker", "effector", (0.0, -0.027, 0.0)),)
"""Where the tracker is on the platform [m]: what the makers' calibration constants suggest."""

RENAMED = {"measured": "tracker"} | {f"q{i}": f"servo_{i}" for i in range(4)}
MESHES = (("h8_modes", "[2,1,20]"), ("h8_modes", "[2,1,40]"), ("h20", "[1,1,20]"))
YOUNG = "body.0.material.young"


def read(path: Path, scene: Scene) -> Measured:
    """Return the poses of a file."""
    return read_csv(path, scene, sources_of(scene, POINTS), RENAMED)


def wrong(data: Measured) -> dict[str, Measured]:
    """Return the data with motors exchanged, and with their range shrunk."""
    angles = data.angles
    assert angles is not None
    return {
        "motors 0 and 1 exchanged": replace(data, angles=angles[:, [1, 0, 2, 3]]),
        "range shrunk by 10 %": replace(data, angles=0.9 * angles),
    }


def found(scene: Scene, data: Measured) -> tuple[Scene, float]:
    """Return the scene with the modulus that fits best, and that [Pa]."""
    problem = Problem(plainly(scene), parameters(scene, [YOUNG], align="translation"), data, POINTS)
    result = fit(problem, np.ones(len(data.values), dtype=bool))
    return problem.at(result.u).told.scene, float(np.exp(result.u[0]))


def error(scene: Scene, data: Measured) -> float:
    """Return the mean distance [m], the mean difference removed."""
    told = score(predict(plainly(scene), data, POINTS), data, "translation").distance
    assert told
    return told.mean


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path)
    parser.add_argument(
        "--every", type=int, default=4, help="one pose in so many is fitted, another one held out"
    )
    given = parser.parse_args()
    scene = load_scene(SCENE)
    data = read(given.file, scene)
    number = np.arange(len(data.values)) % given.every
    fitted, held = data.rows(number == 0), data.rows(number == given.every // 2)
    print(f"{len(fitted.values)} poses fitted, {len(held.values)} held out\n")
    print(
        "| element | cells | E [MPa] | fitted [mm] | held out [mm] | CPU time [s] |\n|---|---|---|---|---|---|"
    )
    for element, cells in MESHES:
        own = load_scene(SCENE, [f"body.0.mesh.element={element}", f"body.0.mesh.cells={cells}"])
        begin = time.process_time()
        best, young = found(own, fitted)
        errors = f"{1e3 * error(best, fitted):.2f} | {1e3 * error(best, held):.2f}"
        print(
            f"| {element} | {cells} | {young / 1e6:.2f} | {errors} | {time.process_time() - begin:.0f} |",
            flush=True,
        )
    best, _ = found(scene, fitted)
    for name, bad in wrong(fitted).items():
        told = score(predict(plainly(best), bad, POINTS), bad, "translation")
        assert told.distance and bad.angles is not None
        left = left_over(told.residuals, bad.angles)
        share = 100 * (left.systematic / left.rms) ** 2
        print(
            f"{name}: {1e3 * told.distance.mean:.2f} mm, {share:.0f} % of the squared rest follows the commands"
        )


if __name__ == "__main__":
    main()
