"""Draw the pictures of the documentation: `python docs/pictures.py` (needs matplotlib)."""

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.colors import LightSource
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from tripod_sim import Simulation, load_scene

IMAGES = Path(__file__).parent / "images"
STATIC = ("inertia=off", "damping=off", "mesh.level=3")


def draw(ax: plt.Axes, simulation: Simulation, title: str) -> None:
    """Draw the deformed surface, shaded by the sun and coloured by displacement, and the arms that hold it."""
    x, rest, triangles = simulation.state.positions, simulation.mesh.nodes, simulation.mesh.surface
    corners = 1e3 * x[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    moved = 1e3 * np.linalg.norm(x - rest, axis=1)[triangles].mean(axis=1)
    colours = plt.get_cmap("viridis")(moved / max(moved.max(), 1e-9))
    shade = LightSource(azdeg=300, altdeg=55).shade_normals(
        normals / np.linalg.norm(normals, axis=1, keepdims=True)
    )
    colours[:, :3] *= 0.55 + 0.45 * shade[:, None]
    ax.add_collection3d(
        Poly3DCollection(corners, facecolors=colours, edgecolors=(0, 0, 0, 0.15), linewidths=0.3)
    )
    for i, frame in enumerate(simulation.driven_frames):
        axis = 1e3 * (frame.point + simulation.state.joints[-1] * frame.inward)
        held = 1e3 * x[frame.nodes].mean(axis=0)
        ax.plot(*zip(axis, held, strict=True), color="0.25", linewidth=4, solid_capstyle="round")
        ends = np.array([axis - 9 * frame.axis, axis + 9 * frame.axis])
        ax.plot(*ends.T, color="tab:red", linewidth=5, label="servo axes" if i == 0 else None)
    ax.set(xlim=(-62, 62), ylim=(-62, 62), zlim=(-40, 22), xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]")
    ax.set_box_aspect((124, 124, 62))
    ax.view_init(elev=28, azim=-62)
    ax.set_title(f"{title}\nlargest displacement {moved.max():.1f} mm", fontsize=10)


def main() -> None:
    """Draw the robot flat and in its working pose."""
    IMAGES.mkdir(exist_ok=True)
    figure = plt.figure(figsize=(11, 4.6), dpi=110)
    for k, (title, joints) in enumerate(
        {
            "at rest, sagging under its weight": (0, 0, 0, 0),
            "working pose": (-1.4965, -1.4965, -1.4965, 0.035),
        }.items()
    ):
        simulation = Simulation(load_scene("tripod", STATIC))
        for part in np.linspace(0, 1, 21)[1:]:
            simulation.step(part * np.array(joints))
        draw(figure.add_subplot(1, 2, k + 1, projection="3d"), simulation, title)
    figure.tight_layout()
    figure.savefig(IMAGES / "tripod.png")


if __name__ == "__main__":
    main()
