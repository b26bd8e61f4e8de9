"""The picture of `tripod reach`: where the effector gets, from above and from the side, and how far it tilts."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tripod_host.writing import replaced

if TYPE_CHECKING:
    from tripod_ik.reach import Reach


def draw(found: "Reach", path: Path, title: str) -> None:
    """Draw the poses into `path`: positions and tilts, coloured by the torque margin; what is too heavy in grey."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - only where a picture is wanted

    figure = Figure(figsize=(13, 4.6), layout="constrained")
    above, side, tilts = figure.subplots(1, 3)
    x, y, z = 1e3 * found.position.T
    tilt, margin = np.degrees(found.tilt), found.margin
    order = np.argsort(z)
    _scatter(above, x[order], y[order], margin[order])
    above.set(xlabel="x [mm]", ylabel="y [mm]", title="from above", aspect="equal")
    _scatter(side, x, z, margin)
    side.set(xlabel="x [mm]", ylabel="z [mm]", title="from the side", aspect="equal")
    colours = _scatter(tilts, tilt, z, margin)
    tilts.set(xlabel="tilt [degrees]", ylabel="z [mm]", title="tilt and height")
    for axes in (above, side, tilts):
        axes.grid(visible=True, alpha=0.3)
    if colours is not None:
        figure.colorbar(colours, ax=[above, side, tilts], label="torque margin [N m]")
    figure.suptitle(f"Reach: {title}; {len(found.bearable)} of {len(found.table)} poses within the torque")
    with replaced(path) as file:
        figure.savefig(file, format=path.suffix[1:].lower(), dpi=110)


def _scatter(axes: Any, x: Any, y: Any, margin: Any) -> Any:
    """Draw points; return what has the colour scale, or None if there is no point with colour."""
    heavy = margin < 0
    axes.scatter(x[heavy], y[heavy], s=7, color="0.75", label="torque too large")
    if heavy.any():
        axes.legend(loc="best", fontsize="small")
    if heavy.all():
        return None
    return axes.scatter(x[~heavy], y[~heavy], s=9, c=margin[~heavy], cmap="viridis", vmin=0.0)
