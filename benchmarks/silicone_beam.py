"""The scene `examples/silicone_beam.toml` against the motion capture of Dubied et al. (arXiv 2201.12560).

    python benchmarks/silicone_beam.py FOLDER [--write]    # into docs/reality.md

FOLDER holds `free_0g.csv` and `free_52g.csv`: time [s], three markers on the tip (x up, z along the beam) [mm]; a
beam of Dragon Skin 10, held and let go, without load and with 52 g at the upper edge of its free end. The data are not
ours and not here.

Told are: the modulus that the rest with 52 g asks for, with three elements on two meshes; modulus and damping from the
motion with 52 g; and, with those values, what nobody has fitted: rest, frequency and motion without load, and what
102 g would do. Only vertical displacements from where the beam was held are used for rests: the frame of the markers is
known to 2 mm only.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks.doc_parts import write_part
from tripod_identify.csv_columns import Channel
from tripod_identify.fit import fit
from tripod_identify.identify import Wanted, beginning, identify
from tripod_identify.measured import Measured, read_csv
from tripod_identify.model import plainly, predict
from tripod_identify.observe import Point, sources_of
from tripod_identify.parameters import parameters
from tripod_identify.problem import Problem
from tripod_sim import load_scene
from tripod_sim.scene import Scene, at_rest

SCENE = Path(__file__).parents[1] / "examples" / "silicone_beam.toml"
POINTS = (
    Point("tip1", "tip", (0.036, 0.015, 0.1)),
    Point("tip2", "tip", (0.024, 0.036, 0.1)),
    Point("tip3", "tip", (0.006, -0.006, 0.1)),
)
"""Where the markers are glued to the undeformed beam [m]."""

UP = tuple(Channel(p.name, 0) for p in POINTS)
MESHES = {"h8_modes": ("[2,2,8]", "[4,4,14]"), "t10": ("[2,2,8]", "[4,4,14]"), "h20": ("[2,2,8]", "[3,3,10]")}
MOTION = 2.5
"""Of the motion that is used [s], from its beginning: then it has come to rest to a twentieth."""


def read(folder: Path, name: str, scene: Scene) -> Measured:
    """Return the markers of a file."""
    return read_csv(folder / f"{name}.csv", scene, sources_of(scene, POINTS), {})


def rest_of(data: Measured) -> Measured:
    """Return the rest at the end as one pose: heights, the beam as it was held taken for undeformed."""
    own = [data.channels.index(c) for c in UP]
    sunk = data.values[-100:, own].mean(axis=0) - data.values[:3, own].mean(axis=0)
    return Measured(None, None, None, UP, (np.array([p.at[0] for p in POINTS]) + sunk)[None])


def sinking(data: Measured) -> float:
    """Return how far the markers of a pose have sunk on average [m]."""
    return float(np.mean([p.at[0] for p in POINTS]) - data.values.mean())


def told_rest(scene: Scene) -> float:
    """Return how far the markers sink at rest in a scene [m]."""
    empty = Measured(None, None, None, UP, np.zeros((1, 3)))
    return sinking(replace(empty, values=predict(plainly(at_rest(scene)), empty, POINTS)))


def frequency(times: np.ndarray, heights: np.ndarray) -> float:
    """Return the frequency of the first four periods [Hz], by upward passages through the mean of the last quarter."""
    away = heights - heights[-len(heights) // 4 :].mean()
    up = np.flatnonzero((away[:-1] < 0) & (away[1:] >= 0))[:5]
    passed = times[up] - away[up] * (times[up + 1] - times[up]) / (away[up + 1] - away[up])
    return float((len(passed) - 1) / (passed[-1] - passed[0]))


def cut(data: Measured) -> Measured:
    """Return the rows from just before the beginning of the motion on."""
    begin = beginning(data)
    assert data.times is not None
    found = data.rows((data.times >= begin - 0.05) & (data.times <= begin + MOTION))
    assert found.times is not None
    return replace(found, times=found.times - found.times[0])


def heights(data: Measured, values: np.ndarray) -> np.ndarray:
    return values[:, [data.channels.index(c) for c in UP]].mean(axis=1)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", choices=("rest", "motion"))
    parser.add_argument("--write", action="store_true", help="write docs/reality.md, too")
    given = parser.parse_args()
    scene = load_scene(SCENE)
    files = {name: read(given.folder, name, scene) for name in ("free_0g", "free_52g")}
    made = {} if given.only == "motion" else {"beam rest": rests(files)}
    if given.only != "rest":
        made |= motions(files)
    for name, lines in made.items():
        print("\n".join(["", *lines]))
        if given.write:
            write_part("reality.md", name, lines)


def rests(files: dict[str, Measured]) -> list[str]:
    """Return as a table the modulus from the rest with 52 g by mesh, and the sag that it predicts of other rests."""
    data = rest_of(files["free_52g"])
    lines = [
        "| element | cells | E [kPa] | sag without load: simulated, measured [mm] | sag with 102 g: simulated [mm] |",
        "|---|---|---|---|---|",
    ]
    for element, meshes in MESHES.items():
        for cells in meshes:
            words = [f"mesh.element={element}", f"mesh.cells={cells}"]
            scene = at_rest(load_scene(SCENE, words))
            problem = Problem(plainly(scene), parameters(scene, ["material.young"]), data, POINTS)
            found = fit(problem, np.ones(1, dtype=bool))
            young = float(np.exp(found.u[0]))
            unloaded = load_scene(SCENE, [*words, "load=off", f"material.young={young}"])
            told, seen = 1e3 * told_rest(unloaded), 1e3 * sinking(rest_of(files["free_0g"]))
            heavy = load_scene(SCENE, [*words, "load.0.mass=0.102", f"material.young={young}"])
            row = f"{young / 1e3:.1f} | {told:.2f}, {seen:.2f} | {1e3 * told_rest(heavy):.2f}"
            lines.append(f"| `{element}` | {cells} | {row} |")
    return lines


def motions(files: dict[str, Measured]) -> dict[str, list[str]]:
    """Return as tables what is fitted to the motion with 52 g, and what is simulated with it beside measurements."""
    scene = load_scene(SCENE)
    data = cut(files["free_52g"])
    wanted = Wanted(("material.young", "damping.stiffness", "start"), "translation")
    result = identify(scene, data, POINTS, wanted, note=print)
    longer = dict(zip([p.name for p in result.fit.wanted], result.fit.longer, strict=True))
    for f in result.found:
        print(
            f"{f.parameter.name}: {f.value:.5g} ({f.low:.5g} to {f.high:.5g}) on this mesh, {f.true:.5g} "
            f"({f.true_low:.5g} to {f.true_high:.5g}) without its error {f.parameter.unit}; by noise "
            f"{longer[f.parameter.name]:.1f} times as long as if no error had to do with another"
        )
    print(f"fitted: {result.after.distance}")
    fitted = ["| value | on this mesh | without the error of mesh and steps |", "|---|---|---|"]
    for f, size, unit in zip(result.found[:2], (1e-3, 1e3), ("kPa", "ms"), strict=True):
        ranges = ((f.value, f.high - f.low), (f.true, f.true_high - f.true_low))
        text = " | ".join(f"{size * value:.3g} ± {0.5 * size * wide:.1g} {unit}" for value, wide in ranges)
        fitted.append(f"| `{f.parameter.name}` | {text} |")
    young, damping = (f.value for f in result.found[:2])
    words = [f"material.young={young}", f"damping.stiffness={damping}"]
    told = heights(data, result.every.aligned.values)
    seen = heights(data, data.values)
    both = frequency(data.times, told), frequency(data.times, seen)
    free = load_scene(SCENE, [*words, "load=off"])
    other = cut(files["free_0g"])
    shown = identify(free, other, POINTS, Wanted(("start",), "translation", mesh=False))
    told, seen = heights(other, shown.every.aligned.values), heights(other, other.values)
    print(f"0 g, predicted: {shown.every.distance}")
    lines = [
        "| quantity | simulated | measured |",
        "|---|---|---|",
        f"| frequency with 52 g (fitted) | {both[0]:.2f} Hz | {both[1]:.2f} Hz |",
        f"| frequency without load | {frequency(other.times, told):.2f} Hz | {frequency(other.times, seen):.2f} Hz |",
    ]
    for load, name, more in (
        ("with 52 g", "free_52g", "load.0.mass=0.052"),
        ("without load", "free_0g", "load=off"),
    ):
        sunk, was = told_rest(load_scene(SCENE, [*words, more])), sinking(rest_of(files[name]))
        lines.append(f"| sag {load} | {1e3 * sunk:.1f} mm | {1e3 * was:.1f} mm |")
    heavy = load_scene(SCENE, [*words, "load.0.mass=0.102"])
    grid = Measured(np.arange(0, 2.0, 0.005), None, None, UP, np.zeros((400, 3)))
    swung = heights(grid, predict(plainly(heavy), grid, POINTS))
    distances = [found.distance for found in (result.after, shown.every)]
    off = [1e3 * distance.rms for distance in distances if distance]
    lines += [
        "",
        f"Places of the markers in motion, root mean square: {off[0]:.1f} mm off with 52 g, {off[1]:.1f} mm without",
        f"load. Predicted for 102 g, not measured here: {frequency(grid.times, swung):.2f} Hz, "
        f"{1e3 * told_rest(heavy):.1f} mm.",
    ]
    return {"beam fit": fitted, "beam comparison": lines}


if __name__ == "__main__":
    main()
