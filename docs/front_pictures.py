"""The pictures of the first page, off-screen: `python docs/front_pictures.py` (needs matplotlib).

`front.gif`: four scenes as `tripod run` shows them. `promise_accuracy.png`: the stored study of the Tripod in motion.
`promise_effects.png`: what its effects cost here, as `tripod explain` measures it. `promise_stability.png`: the energy
after its servos jumped.
"""

import json
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import Patch

import tripod_sim
from tripod_bringup.study_plot import colour_of
from tripod_sim import Simulation, load_scene
from tripod_sim.effects import EFFECTS
from tripod_sim.explain.report import Explanation, explain
from tripod_sim.recording import Recording
from tripod_sim.run import run
from tripod_view.player.of_run import film_of
from tripod_view.player.picture import Painter

IMAGES = Path(__file__).parent / "images"
STORED = Path(tripod_sim.__file__).parent
SHOWN = {"tripod": 2.4, "maze": 2.4, "drape": 1.2, "silicone_drop": 1.2}
"""Scenes, and how long each runs [s]; slow motion where that is less than the length of the picture."""
TILE, PICTURES, APART = (300, 240), 36, 80
"""Size of a scene, pictures, and time between two of them [ms]."""
COLOURS = 96


def film_strip(path: Path) -> None:
    """Write the scenes of SHOWN side by side as a GIF that goes on for ever."""
    strips = []
    for name, duration in SHOWN.items():
        kept: list[Recording] = []
        run(name, duration=duration, recorded=kept.append)
        film = film_of(kept[0].arrays())
        painter = Painter(film, TILE)
        wanted = np.linspace(film.times[0], film.times[-1], PICTURES)
        strips.append([painter.picture(int(np.abs(film.times - t).argmin())) for t in wanted])
    frames = [Image.fromarray(np.hstack(tiles)) for tiles in zip(*strips, strict=True)]
    colours = Image.fromarray(np.vstack([np.asarray(f) for f in frames[::6]])).quantize(COLOURS)
    flat = [frame.quantize(palette=colours, dither=Image.Dither.NONE) for frame in frames]
    flat[0].save(path, save_all=True, append_images=flat[1:], duration=APART, loop=0, optimize=True)


def axes(title: str, across: str, up: str) -> tuple[plt.Figure, plt.Axes]:
    """Return a figure whose words can be read at a third of a page's width."""
    plt.rcParams.update({"font.size": 15, "axes.spines.top": False, "axes.spines.right": False})
    figure, ax = plt.subplots(figsize=(5.6, 4.2), dpi=110, layout="constrained")
    ax.set_title(title, fontsize=16)
    ax.set(xlabel=across, ylabel=up)
    return figure, ax


def accuracy() -> plt.Figure:
    """The front of the study of the Tripod in motion, and all that was measured behind it."""
    study = json.loads((STORED / "studies" / "tripod_dynamic.json").read_text(encoding="utf-8"))
    figure, ax = axes(
        "Tripod in motion: error and its price", "CPU time of a simulated second [s]", "error [%]"
    )
    points = [p for p in study["points"] if p["status"] == "ok"]
    front = sorted((study["points"][k] for k in study["front"]), key=lambda p: p["cpu"])
    ax.loglog([p["cpu"] for p in front], [100 * p["error"] for p in front], "-", color="0.2", linewidth=2)
    for scheme in dict.fromkeys(p["settings"]["inertia.scheme"] for p in points):
        own = [p for p in points if p["settings"]["inertia.scheme"] == scheme]
        ax.loglog(
            [p["cpu"] for p in own], [100 * p["error"] for p in own], "o", color=colour_of(scheme, 0), markersize=5,
            alpha=0.75, label=scheme,
        )  # fmt: skip
    default = next(p for p in points if p["label"] == "the default")
    ax.loglog(default["cpu"], 100 * default["error"], "s", color="tab:red", markersize=10)
    place = (default["cpu"], 100 * default["error"])
    clear = {"facecolor": "white", "edgecolor": "none", "pad": 1, "alpha": 0.85}
    ax.annotate("the default", place, (12, 34), textcoords="offset points", color="tab:red", bbox=clear)
    ax.set_ylim(top=4 * ax.get_ylim()[1])
    ax.axvline(1.0, color="0.4", linestyle="--")
    ax.text(0.93, ax.get_ylim()[1], "real time", rotation=90, ha="right", va="top", color="0.4")
    ax.legend(loc="lower left", fontsize=11, frameon=False)
    return figure


def stability() -> plt.Figure:
    """Energy after a jump of all servos by 1.5 rad and of their bodies by 35 mm in one step, at several dt."""
    figure, ax = axes("Servos jump 1.5 rad in one step", "time [s]", "energy above rest [J]")
    for dt, colour in ((0.001, "tab:blue"), (0.01, "tab:orange"), (0.1, "tab:green")):
        simulation = Simulation(load_scene("tripod", [f"dt={dt}"]))
        goal, energies = np.array([-1.5, -1.5, -1.5, 0.035]), []
        for _ in range(round(2.0 / dt)):
            simulation.step(goal)
            now = simulation.energies()
            energies.append(now.kinetic + now.strain + now.gravity)
        shown = np.array(energies) - energies[-1]
        times = dt * np.arange(1, len(shown) + 1)
        seen = (shown > 1e-6) & (times <= 1.0)
        ax.semilogy(times[seen], shown[seen], "o-" if dt > 0.05 else "-", color=colour, linewidth=2)
        ax.plot([], [], color=colour, linewidth=3, label=f"dt = {1e3 * dt:g} ms")
    ax.legend(frameon=False)
    return figure


def effects() -> plt.Figure:
    """What each effect of the Tripod takes of a step, and what absent ones would: measured now, on this machine."""
    found = explain("tripod")
    on = {name: effect_time(found, name) for name in found.named}
    off = {cost.effect: cost.seconds for cost in found.absent if cost.measured and cost.seconds}
    bars = [
        (seconds, name, colour)
        for costs, colour in ((on, "tab:blue"), (off, "0.8"))
        for seconds, name in sorted((seconds, name) for name, seconds in costs.items() if seconds > 0)
    ]
    figure, ax = axes("Tripod: what an effect costs", "time of a step [us]", "")
    for k, (seconds, _, colour) in enumerate(bars):
        ax.barh(k, 1e6 * seconds, color=colour)
    ax.set_yticks(range(len(bars)), [name for _, name, _ in bars])
    ax.set_xscale("log")
    kinds = [Patch(color="tab:blue", label="on"), Patch(color="0.8", label="off: not paid for")]
    ax.legend(handles=kinds, frameon=False, loc="lower right")
    return figure


def effect_time(found: Explanation, name: str) -> float:
    """Return the time of the stages of a step that only one effect has [s]; 0 where it has none of its own."""
    own = EFFECTS[name].steps
    return sum(stage.seconds for stage in found.stages if own and stage.name.startswith(own))


def main(names: list[str], folder: Path = IMAGES) -> None:
    """Draw the pictures `names`, without names all."""
    if not names or "front" in names:
        film_strip(folder / "front.gif")
    for name, draw in {"accuracy": accuracy, "stability": stability, "effects": effects}.items():
        if not names or name in names:
            draw().savefig(folder / f"promise_{name}.png")


if __name__ == "__main__":
    main(sys.argv[1:])
