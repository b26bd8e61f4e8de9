"""Pictures for the labs: a body in space, and error over computing time."""

import time
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LightSource
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from tripod_sim import Simulation

mpl.rcParams.update({"figure.dpi": 72, "font.size": 9, "axes.grid": True, "grid.alpha": 0.3})


def body(simulation: Simulation, title: str = "", *, axes: Any = None, size: float | None = None) -> Any:
    """Draw what is simulated, coloured by how far it has moved, in millimetres; return the axes.

    Args:
        simulation: What to draw, as it is now.
        title: Above the picture.
        axes: 3-D axes to draw into; None: new ones.
        size: Half the width of the picture [m]; None: so that the body fits.
    """
    skin = simulation.skin
    x = simulation.shown(simulation.positions)
    axes = axes or plt.figure(figsize=(4.4, 3.6)).add_subplot(projection="3d", computed_zorder=False)
    moved = np.linalg.norm(x - skin.nodes, axis=1)[skin.surface].mean(axis=1)
    _surface(axes, x, skin.surface, plt.get_cmap("viridis")(0.35 + 0.65 * moved / max(moved.max(), 1e-9)))
    for box in (held for held in simulation.scene.fixed if held.low and held.high):
        low, high = np.maximum(box.low, x.min(axis=0) - 2e-3), np.minimum(box.high, x.max(axis=0) + 2e-3)
        corners = 1e3 * np.array(list(product(*zip(low, high, strict=True))))
        edges = [(a, b) for a, b in product(corners, corners) if 0 < (a != b).sum() < 2]
        axes.add_collection3d(Line3DCollection(edges, colors="tab:red", linewidths=1.2, zorder=3))
    for frame in simulation.driven_frames:
        hub = 1e3 * (frame.point + simulation.state.joints[-1] * frame.inward)
        held = 1e3 * simulation.state.positions[frame.nodes].mean(axis=0)
        axes.plot(*zip(hub, held, strict=True), color="0.25", linewidth=3, zorder=1)
        axes.plot(
            *np.array([hub - 9 * frame.axis, hub + 9 * frame.axis]).T, color="tab:red", linewidth=4, zorder=1
        )
    if simulation.ball:
        _sphere(axes, simulation.ball.position, simulation.scene.ball.radius, zorder=3)
    centre = 1e3 * 0.5 * (x.min(axis=0) + x.max(axis=0))
    half = 1e3 * (size or 0.55 * np.ptp(x, axis=0).max())
    for name, middle in zip("xyz", centre, strict=True):
        axes.set(**{f"{name}lim": (middle - half, middle + half), f"{name}label": f"{name} [mm]"})
        getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(3))
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=24, azim=-62)
    axes.set_title(title)
    return axes


def bodies(count: int) -> Sequence[Any]:
    """Return so many 3-D axes beside each other."""
    figure = plt.figure(figsize=(3.6 * count, 3.4))
    return [figure.add_subplot(1, count, k + 1, projection="3d", computed_zorder=False) for k in range(count)]


def sphere(axes: Any, centre: Sequence[float], radius: float) -> None:
    """Draw a sphere that bodies lie on, both in metres."""
    _sphere(axes, np.asarray(centre), radius, zorder=1)


def cost(
    points: dict[str, Sequence[tuple[str, float, float]]], ylabel: str, xlabel: str = "CPU seconds"
) -> None:
    """Draw errors over computing times; `points`: by series, label, seconds and error of each."""
    _, axes = plt.subplots(figsize=(6.4, 3.4))
    for name, series in points.items():
        labels, seconds, errors = zip(*series, strict=True)
        axes.loglog(seconds, errors, "o-", label=name)
        for label, s, e in zip(labels, seconds, errors, strict=True):
            axes.annotate(label, (s, e), xytext=(4, 3), textcoords="offset points", fontsize=8)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1, 2, 5), numticks=9))
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter(NullFormatter())
    axes.set(xlabel="CPU seconds", ylabel=ylabel)
    axes.legend(fontsize=8)


def timed(work: Callable[[], Any], repeat: int = 1) -> tuple[float, Any]:
    """Return the CPU seconds of `work()`, the least of so many times, and what it returned."""
    least = np.inf
    for _ in range(repeat):
        began = time.process_time()
        result = work()
        least = min(least, time.process_time() - began)
    return least, result


def _surface(axes: Any, x: np.ndarray, triangles: np.ndarray, rgba: np.ndarray) -> None:
    corners = 1e3 * x[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    shade = LightSource(azdeg=300, altdeg=55).shade_normals(normals)
    rgba[:, :3] *= 0.55 + 0.45 * shade[:, None]
    axes.add_collection3d(
        Poly3DCollection(corners, facecolors=rgba, edgecolors=(0, 0, 0, 0.3), linewidths=0.3, zorder=2)
    )


def _sphere(axes: Any, centre: np.ndarray, radius: float, zorder: float) -> None:
    u, v = np.mgrid[0 : 2 * np.pi : 17j, 0 : np.pi : 9j]
    unit = np.array([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)])
    axes.plot_surface(*(1e3 * (centre[:, None, None] + radius * unit)), color="tab:orange", zorder=zorder)
