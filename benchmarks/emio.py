"""The scene `examples/emio.toml` against poses of the robot Emio, measured by its makers with a magnetic tracker.

    python benchmarks/emio.py FILE [--write]    # the first table into docs/reality.md

FILE has the columns q0_rad .. q3_rad, the motors' angles, measured_x_mm, .y, .z, the tracker, and sofa_beam_x_mm, .y,
.z, where the makers' own model has the platform; SOFA and Compliance Robotics, MIT licence. The data are not ours and
not here.

1. One modulus is found from every sixteenth pose, a translation of the tracker's frame fitted along, for several
   elements, each edge along the legs halved and halved again, or short beside the clamps alone; told is the error of
   other poses with the mean difference removed, and where the moduli of each element go to.
2. The same from all poses of the makers' model, as if it were measured.
3. The scene meets data with two motors exchanged, with their range or that of the places shrunk by 10 %: scored as it
   is, with the modulus looked for again, and with what is known of it.
"""

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import meshio
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks.doc_parts import write_part
from tripod_identify.errors import FitError
from tripod_identify.fit import Fit, Prior, fit
from tripod_identify.identify import Wanted, identify
from tripod_identify.lack_of_fit import what_is_left
from tripod_identify.measured import Measured, read_csv
from tripod_identify.model import plainly, predict
from tripod_identify.observe import Point, sources_of
from tripod_identify.parameters import parameters
from tripod_identify.problem import Problem
from tripod_identify.score import score
from tripod_sim import load_scene
from tripod_sim.mesh.block import block
from tripod_sim.scene import Scene

SCENE = Path(__file__).parents[1] / "examples" / "emio.toml"
POINTS = (Point("tracker", "effector", (0.0, -0.027, 0.0)),)
"""Where the tracker is on the platform [m]: what the makers' calibration constants suggest."""

RENAMED = {"measured": "tracker"} | {f"q{i}": f"servo_{i}" for i in range(4)}
MESHES = {
    "h8_modes": ("[2,1,20]", "[2,2,40]", "[2,2,80]", "[2,2,160]"),
    "h20": ("[1,1,20]", "[2,1,40]", "[2,1,80]", "[2,1,160]"),
    "t10": ("[2,1,80]",),
}
"""Cells of a leg by element: the last three, if there are so many, have edges along it that are halved each time."""

GRADED = {"h8_modes": (2, 2), "h20": (2, 1)}
"""Cells across the leg of meshes whose cells are short beside the clamps."""

BEAMS = ["body.0.mesh.cells=[2,2,80]", *(f"set.{i}.high=[1,-0.2023,1]" for i in range(4, 8))]
"""What is else about the makers' beams: the platform holds their tips alone, not the last 10 mm. And a finer mesh."""

YOUNG = "body.0.material.young"


def read(path: Path, scene: Scene) -> Measured:
    """Return the poses of a file."""
    return read_csv(path, scene, sources_of(scene, POINTS), RENAMED)


def read_beams(path: Path, scene: Scene) -> Measured:
    """Return the poses of the makers' model, whose places are those of the platform's centre."""
    own = {name: to for name, to in RENAMED.items() if name != "measured"} | {"sofa_beam": "effector"}
    return read_csv(path, scene, sources_of(scene, ()), own)


def wrong(data: Measured) -> dict[str, Measured]:
    """Return the data with motors exchanged, with their range shrunk, and with that of the places shrunk."""
    angles = data.commands
    assert angles is not None
    middle = np.nanmean(data.values, axis=0)
    return {
        "motors 0 and 1 exchanged": replace(data, commands=angles[:, [1, 0, 2, 3]]),
        "motors' range shrunk by 10 %": replace(data, commands=0.9 * angles),
        "places' range shrunk by 10 %": replace(data, values=middle + 0.9 * (data.values - middle)),
    }


def fitted(scene: Scene, data: Measured, points: tuple[Point, ...] = POINTS) -> tuple[Scene, Fit]:
    """Return the scene with the modulus that fits best, and the fit."""
    problem = Problem(plainly(scene), parameters(scene, [YOUNG], align="translation"), data, points)
    result = fit(problem, np.ones(len(data.values), dtype=bool))
    return problem.at(result.u).told.scene, result


def error(scene: Scene, data: Measured, points: tuple[Point, ...] = POINTS) -> float:
    """Return the mean distance [m], the mean difference removed."""
    told = score(predict(plainly(scene), data, points), data, "translation").distance
    assert told
    return told.mean


def graded(folder: Path, across: tuple[int, int]) -> Path:
    """Write a leg of 38 cells along what is free of it, 1.1 mm long beside both clamps, each 1.22 times as long as the
    one before until 7.1 mm, and two in the platform; return the file.
    """
    leg = load_scene(SCENE).body[0].mesh
    assert leg
    mesh = block(leg.corners, (*across, 40))
    number = np.arange(19)
    half = np.minimum(1.2 * 1.22**number, 7.5)
    free = np.cumsum([*half, *half[::-1]])
    ends = mesh.nodes[:, 1].min() * np.array([0, *(0.95 * free / free[-1]), 0.975, 1])
    nodes, even = mesh.nodes.copy(), np.linspace(0, mesh.nodes[:, 1].min(), 41)
    nodes[:, 1] = np.interp(nodes[:, 1], even[::-1], ends[::-1])
    path = folder / "leg.vtk"
    meshio.write(path, meshio.Mesh(nodes, [("hexahedron", mesh.elements)]))
    return path


def limit(values: list[float]) -> float:
    """Return where three values go whose differences shrink in proportion (Aitken)."""
    first, second, third = values
    return third + (third - second) ** 2 / ((second - first) - (third - second))


def row(element: str, cells: str, own: Scene, data: Measured, held: Measured) -> tuple[float, str]:
    """Print the modulus that a mesh needs, and the errors with it; return it [MPa], and the row of the page."""
    begin = time.process_time()
    best, result = fitted(own, data)
    young, half = float(np.exp(result.u[0])) / 1e6, 100 * float(result.half[0])
    errors = f"{1e3 * error(best, data):.2f} | {1e3 * error(best, held):.2f}"
    slope = result.jacobian[:, :, 0]
    by_one = 10 * float(np.linalg.norm(slope - slope.mean(axis=0), axis=1).mean())
    spent = time.process_time() - begin
    print(
        f"| {element} | {cells} | {young:.2f} ± {half:.0f} % | {errors} | {by_one:.3f} | {spent:.0f} |",
        flush=True,
    )
    return young, f"| `{element}` | {cells.strip('[]').replace(',', ' x ')} | {young:.2f} | {errors} |"


def meshes(data: Measured, held: Measured) -> list[str]:
    """Print the moduli that elements and meshes need; return the table of the page."""
    print("| element | cells | E [MPa] | fitted [mm] | held out [mm] | 1 % of E moves [mm] | CPU time [s] |")
    print("|---|---|---|---|---|---|---|")
    told = []
    lines = ["| element | cells of a leg | E [MPa] | fitted [mm] | held out [mm] |", "|---|---|---|---|---|"]
    for element, every in MESHES.items():
        found = []
        for cells in every:
            own = load_scene(SCENE, [f"body.0.mesh.element={element}", f"body.0.mesh.cells={cells}"])
            young, line = row(element, cells, own, data, held)
            found.append(young)
            lines.append(line)
        if len(found) > 2:
            told.append(f"{element}: edges along the legs halved for ever: {limit(found[-3:]):.2f} MPa")
    with TemporaryDirectory() as folder:
        for element, across in GRADED.items():
            path = graded(Path(folder), across)
            own = load_scene(SCENE, [f"body.0.mesh.element={element}", f"body.0.mesh.source={path}"])
            cells = f"{across[0]} x {across[1]} x 40, short beside the clamps"
            lines.append(row(element, cells, own, data, held)[1])
    print("\n".join(["", *told, ""]))
    return lines


def beams(path: Path) -> None:
    """Print the modulus of the makers' beams."""
    scene = load_scene(SCENE, [*BEAMS, f"{YOUNG}=35e6"])
    data = read_beams(path, scene)
    number = np.arange(len(data.values)) % 16
    best, result = fitted(scene, data.rows(number == 0), ())
    young, half = float(np.exp(result.u[0])) / 1e6, 100 * float(result.half[0])
    print(f"the makers' beams: {young:.1f} MPa ± {half:.0f} %, ", end="")
    every = [
        f"{1e3 * error(s, data, ()):.2f} mm with {name}" for name, s in (("it", best), ("35 MPa", scene))
    ]
    print(f"{' and '.join(every)} on all {len(data.values)} poses", flush=True)
    own = load_scene(SCENE, [BEAMS[0], f"{YOUNG}=35e6"])
    print(f"with the last 10 mm of the legs held, too: {1e3 * error(own, data, ()):.2f} mm with 35 MPa\n")


def refused(scene: Scene, data: Measured) -> None:
    """Print what is said of data that are wrong."""
    best, result = fitted(scene, data)
    young = float(np.exp(result.u[0]))
    print(f"scored and identified, {len(data.values)} poses, E = {young / 1e6:.2f} MPa:")
    for name, bad in {"as they are": data, **wrong(data)}.items():
        told = score(predict(plainly(best), bad, POINTS), bad, "translation")
        assert told.distance
        note = what_is_left(told.residuals, bad, best).note
        print(f"- {name}: score {1e3 * told.distance.mean:.2f} mm{note and ', '}{note}")
        for how, priors in (("alone", {}), ("known to 5 %", {YOUNG: Prior(young, 0.05 * young)})):
            asked = Wanted((YOUNG,), "translation", priors, mesh=False, propose=False)
            try:
                found = identify(best, bad, POINTS, asked)
            except FitError as said:
                print(f"  - identified, {how}: {said}")
                continue
            assert found.after.distance
            notes = "".join(f"; {note}" for note in found.notes if note not in bad.notes)
            value = found.found[0].value
            print(
                f"  - identified, {how}: {value / 1e6:.2f} MPa, {1e3 * found.after.distance.mean:.2f} mm{notes}",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("file", type=Path)
    parser.add_argument(
        "--every", type=int, default=16, help="one pose in so many is fitted, another one held out"
    )
    parser.add_argument("--write", action="store_true", help="write docs/reality.md, too")
    given = parser.parse_args()
    scene = load_scene(SCENE)
    data = read(given.file, scene)
    number = np.arange(len(data.values)) % given.every
    used, held = data.rows(number == 0), data.rows(number == given.every // 2)
    print(f"{len(used.values)} poses fitted, {len(held.values)} held out\n")
    lines = meshes(used, held)
    if given.write:
        write_part("reality.md", "emio meshes", lines)
    beams(given.file)
    refused(scene, data.rows(np.arange(len(data.values)) % 4 == 0))


if __name__ == "__main__":
    main()
