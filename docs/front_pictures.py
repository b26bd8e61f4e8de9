"""Draw the first page's pictures and that of the robots: `python docs/front_pictures.py` (needs matplotlib).

`film.webp`: four scenes as `tripod run` shows them; `robots.webp`: four robots with cables and air.
`promise_accuracy.png`: the stored study of the moving robot. `promise_stability.png`: the robot after a jump of its
servos. `promise_effects.png`: the time of a step with more effects, measured on this machine.
"""

import json
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.ticker import FixedLocator, NullLocator

import tripod_study
from tripod_sim import Simulation, load_scene
from tripod_study.recording import Recording
from tripod_study.run import run
from tripod_view.player.of_run import film_of
from tripod_view.player.picture import Painter

IMAGES = Path(__file__).parent / "images"
STORED = Path(str(tripod_study.__file__)).parent


@dataclass(frozen=True)
class Tile:
    """A scene of the film: its caption, changes to the scene, and how much of the run is shown [s]."""

    scene: str
    caption: str
    changes: tuple[str, ...]
    shown: float


TILES = (
    Tile("tripod", "Three servos bend the robot", (), 2.6),
    Tile("maze", "A ball rolls in a maze on the robot", ("mesh.level=4", "dt=0.0025"), 2.2),
    Tile("drape", "A cloth falls on a sphere", ("dt=0.005",), 1.2),
    Tile(
        "silicone_drop", "Silicone falls on a cube", ("mesh.level=4", "dt=0.0025", "inertia.scheme=bdf2"), 1.2
    ),
)
"""The four scenes, from left to right and from top to bottom."""

ROBOTS = (
    Tile("finger_cable", "finger_cable", (), 1.0),
    Tile("finger_pneumatic", "finger_pneumatic", (), 1.0),
    Tile("diamond", "diamond", (), 2.0),
    Tile("trunk", "trunk", (), 1.0),
)
"""Robots with cables and air, at the end of what is shown."""

SIZE, COLUMNS, RATE, SECONDS, LAST = (432, 300), 2, 25.0, 4.0, 1.0
"""Size of a tile, tiles in a row, pictures a second, length of the film and of its last picture [s]."""
FINER, QUALITY, MOST_BYTES = 2, 82, 3_000_000
"""Pixels of a side averaged to one, beside what the painter does itself; of the WebP; largest file."""


def film(path: Path) -> None:
    """Write TILES as one animated WebP that repeats for ever."""
    frames = mosaics(TILES, round(RATE * SECONDS))
    durations = [round(1e3 / RATE)] * (len(frames) - 1) + [round(1e3 * LAST)]
    words = {"duration": durations, "loop": 0, "quality": QUALITY, "method": 4}
    frames[0].save(path, save_all=True, append_images=frames[1:], **words)
    if path.stat().st_size > MOST_BYTES:
        raise SystemExit(f"{path.name} has {path.stat().st_size} bytes; at most {MOST_BYTES}: lower QUALITY")


def robots(path: Path) -> None:
    """Write ROBOTS as one picture."""
    mosaics(ROBOTS, 1)[0].save(path, quality=QUALITY, method=6)


def mosaics(tiles: tuple[Tile, ...], count: int) -> list[Image.Image]:
    """Return `count` pictures of tiles, evenly spaced over what is shown of each; the last at its end."""
    columns = [list(tile_pictures(tile, count)) for tile in tiles]
    rows = [columns[k : k + COLUMNS] for k in range(0, len(columns), COLUMNS)]
    return [
        Image.fromarray(np.vstack([np.hstack([tile[k] for tile in row]) for row in rows]))
        for k in range(count)
    ]


def tile_pictures(tile: Tile, count: int) -> Iterator[NDArray[np.uint8]]:
    """Run the scene of a tile; yield `count` pictures with the caption in them."""
    kept: list[Recording] = []
    run(tile.scene, overrides=tile.changes, duration=tile.shown, recorded=kept.append)
    arrays = kept[0].arrays()
    times = np.asarray(arrays["time"])
    wanted = np.linspace(times[-1], times[0], count)[::-1]
    steps = np.unique(np.abs(times[:, None] - wanted).argmin(axis=0))
    shown = film_of(arrays, steps)
    painter = Painter(shown, (FINER * SIZE[0], FINER * SIZE[1]))
    font = ImageFont.load_default(size=17 * FINER)
    for when in wanted:
        large = Image.fromarray(painter.picture(int(np.abs(shown.times - when).argmin())))
        ImageDraw.Draw(large).text((12 * FINER, 8 * FINER), tile.caption, fill=(40, 48, 56), font=font)
        yield np.asarray(large.resize(SIZE, Image.Resampling.LANCZOS))


def axes(title: str, across: str, up: str) -> tuple[plt.Figure, plt.Axes]:
    """Return a figure that can be read at a third of the width of a page."""
    plt.rcParams.update({"font.size": 15, "axes.spines.top": False, "axes.spines.right": False})
    figure, ax = plt.subplots(figsize=(5.6, 4.4), dpi=110, layout="constrained")
    ax.set_title(title, fontsize=16)
    ax.set(xlabel=across, ylabel=up)
    return figure, ax


def accuracy() -> plt.Figure:
    """Return the errors and computing times of the stored accuracy study of the moving robot."""
    study = json.loads((STORED / "studies" / "tripod_dynamic.json").read_text(encoding="utf-8"))
    figure, ax = axes(
        "Each dot is a mesh and a time step",
        "computing time for 1 s of motion [s]",
        "error of the motion [%]",
    )
    points = [p for p in study["points"] if p["status"] == "ok"]
    best = sorted((study["points"][k] for k in study["front"]), key=lambda p: p["cpu"])
    ax.axvspan(min(p["cpu"] for p in points) / 1.5, 1.0, color="tab:green", alpha=0.1, linewidth=0)
    ax.loglog([p["cpu"] for p in points], [100 * p["error"] for p in points], "o", color="0.65", markersize=5)
    times, errors = [p["cpu"] for p in best], [100 * p["error"] for p in best]
    ax.loglog(times, errors, "o-", color="tab:blue", linewidth=2, markersize=5, label="best choices")
    default = next(p for p in points if p["label"] == "the default")
    ax.loglog(
        default["cpu"],
        100 * default["error"],
        "s",
        color="tab:red",
        markersize=11,
        label="the robot's default",
    )
    ax.set(xlim=(min(p["cpu"] for p in points) / 1.5, 40), ylim=(0.1, 90))
    ax.text(0.03, 65, "faster than real time", color="tab:green", va="center", fontsize=13)
    ax.legend(loc="lower left", fontsize=12, frameon=False)
    for axis, ticks in ((ax.xaxis, (0.03, 0.1, 0.3, 1, 3, 10)), (ax.yaxis, (0.1, 0.3, 1, 3, 10, 30))):
        axis.set_major_locator(FixedLocator(ticks))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_locator(NullLocator())
    return figure


def stability() -> plt.Figure:
    """Return the height of the disc after all servos have jumped into the working pose, with three time steps."""
    figure, ax = axes(
        "All servos jump by 86° in one step", "time after the jump [s]", "height of the disc [mm]"
    )
    for dt, colour, style in ((0.1, "tab:green", "o--"), (0.01, "tab:orange", "-"), (0.001, "tab:blue", "-")):
        simulation = Simulation(load_scene("tripod", [f"dt={dt}"]))
        heights = [1e3 * simulation.effector.position[2]]
        for _ in range(round(0.5 / dt)):
            simulation.step(WORKING_POSE)
            heights.append(1e3 * simulation.effector.position[2])
        ax.plot(
            dt * np.arange(len(heights)),
            heights,
            style,
            color=colour,
            linewidth=2,
            label=f"step of {1e3 * dt:g} ms",
        )
    ax.legend(frameon=False)
    return figure


def effects() -> plt.Figure:
    """Return the time of a step of the moving robot, alone and with each of three more effects, on this machine."""
    figure, ax = axes("One step of 5 ms, coarse mesh", "computing time [ms]", "")
    times = {name: 1e3 * step_time(changes) for name, changes in ADDED.items()}
    for k, (name, value) in enumerate(reversed(times.items())):
        ax.barh(k, value, color="tab:blue" if name == "robot" else "0.75")
        ax.text(value, k, f" {value:.2g}", va="center")
    ax.set_yticks(range(len(times)), list(reversed(times)))
    ax.set_xlim(right=1.15 * max(times.values()))
    return figure


ADDED = {
    "robot": [],
    "with servo\ndynamics": ["servo_dynamics={}"],
    "with a ball": ["ball={}"],
    "with contact\nof silicone": ["contact={self_contact=true}"],
}
"""Bars of `effects`, and what each adds to the scene."""

WORKING_POSE = np.array([-1.5, -1.5, -1.5, 0.035])
"""Angles of the servos [rad], slide of their bodies [m]."""


def step_time(changes: list[str]) -> float:
    """Return the CPU time of a step [s]: the mean of 100 steps of a motion, the least of five tries."""
    same = ["mesh.level=2", "mesh.element=h8_modes", "dt=0.005", "inertia.scheme=implicit_euler"]
    simulation, tries = Simulation(load_scene("tripod", [*same, *changes])), []
    for _ in range(5):
        simulation.reset()
        began = time.process_time()
        for k in range(100):
            simulation.step(-0.2 * WORKING_POSE * np.sin(-k / 20) * [1, 1, 1, 0])
        tries.append((time.process_time() - began) / 100)
    return min(tries)


def main(names: list[str], folder: Path = IMAGES) -> None:
    """Draw the pictures `names`, without names all."""
    if not names or "film" in names:
        film(folder / "film.webp")
    if not names or "robots" in names:
        robots(folder / "robots.webp")
    for name, draw in {"accuracy": accuracy, "stability": stability, "effects": effects}.items():
        if not names or name in names:
            draw().savefig(folder / f"promise_{name}.png")


if __name__ == "__main__":
    main(sys.argv[1:])
