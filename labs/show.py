"""Plots for the labs: deformed bodies in 3-D, and error over computing time."""

import time
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LightSource, ListedColormap, Normalize
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from tripod_sim import Simulation

mpl.rcParams.update({"figure.dpi": 80, "font.size": 11, "axes.grid": True, "grid.alpha": 0.3})

COLOURS = ListedColormap(plt.get_cmap("viridis")(np.linspace(0.2, 1.0, 256)))
"""Colours of a displacement, from 0 to the largest; the darkest ones of viridis would hide the shading."""

LEAST = 1e-2
"""Smallest end of a colour bar [mm]; below it a displacement is rounding."""


def body(simulation: Simulation, title: str = "", *, axes: Any = None, size: float | None = None) -> Any:
    """Draw the bodies with their displacement as colour, in millimetres; return the axes.

    Args:
        simulation: Its present state is drawn.
        title: Text above the picture.
        axes: 3-D axes to draw into; None: new ones.
        size: Half the width of the picture [m]; None: the bodies fill it.
    """
    skin = simulation.skin
    x = simulation.shown(simulation.positions)
    axes = axes or bodies(1)[0]
    moved = 1e3 * np.linalg.norm(x - skin.nodes, axis=1)[skin.surface].mean(axis=1)
    scale = ScalarMappable(Normalize(0, max(moved.max(), LEAST)), COLOURS)
    _surface(axes, x, skin.surface, scale.to_rgba(moved))
    bar = axes.figure.colorbar(scale, ax=axes, location="bottom", shrink=0.7, aspect=25, pad=0.1)
    bar.set_label("displacement [mm]")
    bar.locator = MaxNLocator(3)
    bar.formatter = FuncFormatter(lambda value, _: f"{value:g}")
    bar.update_ticks()
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
        axes.tick_params(axis=name, labelsize=9, pad=0)
        getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(3))
    axes.set_box_aspect((1, 1, 1))
    axes.view_init(elev=24, azim=-62)
    axes.set_title(title)
    return axes


def bodies(count: int) -> Sequence[Any]:
    """Return `count` 3-D axes side by side."""
    figure = plt.figure(figsize=(3.9 * count, 4.4), layout="constrained")
    return [figure.add_subplot(1, count, k + 1, projection="3d", computed_zorder=False) for k in range(count)]


def sphere(axes: Any, centre: Sequence[float], radius: float) -> None:
    """Draw a sphere, such as an obstacle; `centre` and `radius` in metres."""
    _sphere(axes, np.asarray(centre), radius, zorder=1)


def cost(
    points: dict[str, Sequence[tuple[str, float, float]]], ylabel: str, xlabel: str = "CPU seconds"
) -> None:
    """Plot errors over computing times.

    Args:
        points: For each series, the label, computing time [s] and error of its points.
        ylabel: Of the errors.
        xlabel: Of the times.
    """
    _, axes = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    for name, series in points.items():
        labels, seconds, errors = zip(*series, strict=True)
        axes.loglog(seconds, errors, "o-", label=name)
        for label, s, e in zip(labels, seconds, errors, strict=True):
            axes.annotate(label, (s, e), xytext=(4, 3), textcoords="offset points", fontsize=9)
    for axis in (axes.xaxis, axes.yaxis):
        _log_ticks(axis)
    axes.set(xlabel=xlabel, ylabel=ylabel)
    axes.legend(fontsize=9)


def order(
    points: dict[str, Sequence[tuple[float, float]]],
    orders: Sequence[int],
    ylabel: str,
    xlabel: str = "step [ms]",
) -> None:
    """Plot errors over step lengths with dashed lines of the given orders.

    Args:
        points: For each series, the step (or mesh size, or distance) and the error of its points.
        orders: Slopes of the dashed lines; an error of order p falls by a factor of 2^p when the step is halved.
        ylabel: Of the errors.
        xlabel: Of the steps.
    """
    _, axes = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    for name, series in points.items():
        axes.loglog(*zip(*series, strict=True), "o-", label=name)
    steps, errors = np.array([point for series in points.values() for point in series]).T
    for p in orders:
        line = errors.max() * (np.unique(steps) / steps.max()) ** p
        axes.loglog(np.unique(steps), line, "--", color="0.5", linewidth=1)
        axes.annotate(
            f"order {p}", (steps.min(), line[0]), xytext=(6, -14), textcoords="offset points", fontsize=9
        )
    for axis in (axes.xaxis, axes.yaxis):
        _log_ticks(axis)
    axes.set_xticks(np.unique(steps))
    axes.set(xlabel=xlabel, ylabel=ylabel)
    axes.legend(fontsize=9)


def timed(work: Callable[[], Any], repeat: int = 1) -> tuple[float, Any]:
    """Return the CPU time of `work()` [s], the smallest of `repeat` calls, and its result."""
    least = np.inf
    for _ in range(repeat):
        began = time.process_time()
        result = work()
        least = min(least, time.process_time() - began)
    return least, result


def _log_ticks(axis: Any) -> None:
    """Label 1, 2 and 5 of each decade, or only the decades where there are more than two."""
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 100 * low else (1,), numticks=20))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


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
