"""Draw the pictures of the documentation, off-screen: `python docs/pictures.py` (needs matplotlib)."""

import sys
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.colors import LightSource
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from tripod_play.solve import solve
from tripod_sim import Simulation, load_scene
from tripod_sim.contact.contact_build import obstacle_parts

IMAGES = Path(__file__).parent / "images"
STATIC = ("inertia=off", "damping=off", "mesh.level=3")
FLAT, TALL = (-40.0, 22.0), (-90.0, 34.0)
"""Heights that a picture shows [mm]."""


def panel(figure: plt.Figure, at: tuple[int, int, int], title: str, heights: tuple[float, float]) -> plt.Axes:
    """Return empty axes in millimetres, all three at one scale."""
    ax = figure.add_subplot(*at, projection="3d")
    ax.set(xlim=(-62, 62), ylim=(-62, 62), zlim=heights, xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]")
    ax.set_box_aspect((124, 124, heights[1] - heights[0]))
    ax.view_init(elev=28, azim=-62)
    ax.set_title(title, fontsize=10)
    return ax


def draw_body(ax: plt.Axes, simulation: Simulation, colours: np.ndarray) -> None:
    """Draw the deformed surface, shaded by the sun; one colour of the map viridis (0 to 1) for each triangle."""
    corners = 1e3 * simulation.state.positions[simulation.mesh.surface]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    rgba = plt.get_cmap("viridis")(colours)
    shade = LightSource(azdeg=300, altdeg=55).shade_normals(
        normals / np.linalg.norm(normals, axis=1, keepdims=True)
    )
    rgba[:, :3] *= 0.55 + 0.45 * shade[:, None]
    ax.add_collection3d(
        Poly3DCollection(corners, facecolors=rgba, edgecolors=(0, 0, 0, 0.15), linewidths=0.3)
    )


def displacements(simulation: Simulation) -> np.ndarray:
    """Return how far each triangle has moved [mm]."""
    moved = np.linalg.norm(
        simulation.state.positions[: len(simulation.mesh.nodes)] - simulation.mesh.nodes, axis=1
    )
    return 1e3 * moved[simulation.mesh.surface].mean(axis=1)


def draw_arms(ax: plt.Axes, simulation: Simulation) -> None:
    """Draw each servo arm: its axis, and a line from there to the end that it holds."""
    for frame in simulation.driven_frames:
        axis = 1e3 * (frame.point + simulation.state.joints[-1] * frame.inward)
        held = 1e3 * simulation.state.positions[frame.nodes].mean(axis=0)
        ax.plot(*zip(axis, held, strict=True), color="0.25", linewidth=4, solid_capstyle="round")
        ax.plot(*np.array([axis - 9 * frame.axis, axis + 9 * frame.axis]).T, color="tab:red", linewidth=5)


def draw_box(ax: plt.Axes, low: tuple[float, ...], high: tuple[float, ...]) -> None:
    """Draw the edges of a fixing box [m]."""
    corners = 1e3 * np.array(list(product(*zip(low, high, strict=True))))
    edges = [(a, b) for a, b in product(corners, corners) if 0 < (a != b).sum() < 2]
    ax.add_collection3d(Line3DCollection(edges, colors="tab:red", linewidths=1.2))


def free_fall() -> plt.Figure:
    """Step 1: the free piece at three times."""
    figure = plt.figure(figsize=(6, 5.4), dpi=110)
    simulation = Simulation(load_scene("silicone_free", ["dt=0.001", "mesh.level=3"]))
    ax = panel(figure, (1, 1, 1), "the free piece after 0, 80 and 120 ms", TALL)
    for steps in (0, 80, 40):
        for _ in range(steps):
            simulation.step()
        draw_body(ax, simulation, np.full(len(simulation.mesh.surface), simulation.state.time / 0.12))
    return figure


def fixing_box() -> plt.Figure:
    """Steps 2 and 3: the end of one strip in a box, the rest hanging."""
    figure = plt.figure(figsize=(11, 5.0), dpi=110)
    scene = load_scene("silicone", ["mesh.level=3"])
    simulation = Simulation(scene)
    for k, seconds in enumerate((0.1, 1.9)):
        for _ in range(round(seconds / scene.dt)):
            simulation.step()
        moved = displacements(simulation)
        when = f"held in the red box, {simulation.state.time:.1f} s after release"
        ax = panel(figure, (1, 2, k + 1), f"{when}\nlargest displacement {moved.max():.0f} mm", TALL)
        draw_body(ax, simulation, moved / moved.max())
        for box in scene.fixed:
            draw_box(ax, box.low, box.high)
    return figure


def assembly() -> plt.Figure:
    """Step 4: the robot flat and in its working pose."""
    figure = plt.figure(figsize=(11, 4.6), dpi=110)
    poses = {
        "at rest, sagging under its weight": (0, 0, 0, 0),
        "working pose": (-1.4965, -1.4965, -1.4965, 0.035),
    }
    for k, (title, joints) in enumerate(poses.items()):
        simulation = Simulation(load_scene("tripod", STATIC))
        for part in np.linspace(0, 1, 21)[1:]:
            simulation.step(part * np.array(joints))
        moved = displacements(simulation)
        ax = panel(figure, (1, 2, k + 1), f"{title}\nlargest displacement {moved.max():.1f} mm", FLAT)
        draw_body(ax, simulation, moved / moved.max())
        draw_arms(ax, simulation)
    return figure


def draw_boxes(ax: plt.Axes, boxes: np.ndarray, place: Callable[[np.ndarray], np.ndarray]) -> None:
    """Draw the floor and the walls of a maze; `place` brings its positions to world, both in metres."""
    for k, box in enumerate(boxes):
        low, high = box[:3] - box[3:], box[:3] + box[3:]
        corners = 1e3 * place(np.array(list(product(*zip(low, high, strict=True)))))
        quads = [
            corners[list(f)] for f in ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (1, 3, 7, 5))
        ]
        colour = (0.93, 0.89, 0.8, 0.85) if k == 0 else (0.6, 0.42, 0.25, 0.9)
        faces = Poly3DCollection(quads, facecolors=colour, edgecolors=(0, 0, 0, 0.25), linewidths=0.3)
        faces.set_zorder(10 if k == 0 else 30 - corners[:, 1].mean() * 0.1)  # from the back to the front
        ax.add_collection3d(faces)


def solved_maze() -> plt.Figure:
    """Step 8: the robot with the maze, and the way of the ball in a solved game."""
    simulation = Simulation(load_scene("maze", ["maze.source=holes"]))
    game, shown, way = simulation.ball_game, 6.0, []

    def watch(now: Simulation) -> None:
        way.append(game.local(now.state, now.state.ball))

    solution = solve(simulation, 0, watch=watch)
    track = np.array(way)
    figure = plt.figure(figsize=(11, 5.0), dpi=110)
    solve(simulation, 0, limit=shown)
    ax = panel(figure, (1, 2, 1), f"the ball on its way, after {shown:g} s", (-40.0, 22.0))
    draw_body(ax, simulation, np.full(len(simulation.mesh.surface), 0.35))
    draw_arms(ax, simulation)
    centre, rotation = simulation.state.centres[0], simulation.state.rotations[0]

    def place(q: np.ndarray) -> np.ndarray:
        return centre + (q + np.array([0, 0, game.plate.offset])) @ rotation.T

    obstacles, board = game.plate.board.obstacles, game.plate.board
    draw_boxes(ax, obstacles.boxes, place)
    ax.plot(*(1e3 * simulation.ball.position)[:, None], "o", color="tab:red", markersize=5, zorder=1e3)
    ax.computed_zorder = False
    ax.view_init(elev=42, azim=-62)
    flat = figure.add_subplot(1, 2, 2)
    for box in obstacles.boxes[1:]:
        flat.add_patch(plt.Rectangle(1e3 * (box[:2] - box[3:5]), *(2e3 * box[3:5]), color="0.35"))
    for x, y, radius in obstacles.holes:
        flat.add_patch(plt.Circle((1e3 * x, 1e3 * y), 1e3 * radius, color="black"))
    flat.add_patch(
        plt.Circle(1e3 * np.array(board.goal[:2]), 1e3 * board.goal[2], color="tab:green", alpha=0.4)
    )
    flat.plot(*(1e3 * track[:, :2].T), color="tab:red", linewidth=1)
    flat.plot(*(1e3 * track[0, :2]), "o", color="tab:red")
    flat.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]")
    flat.set_title(f"maze 'holes': goal reached after {solution.time:.1f} s", fontsize=10)
    return figure


def draw_surface(ax: plt.Axes, corners: np.ndarray, colour: tuple[float, ...]) -> None:
    """Draw shaded triangles (n, 3, 3) [m]."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    shade = LightSource(azdeg=300, altdeg=55).shade_normals(
        normals / np.linalg.norm(normals, axis=1, keepdims=True)
    )
    rgba = np.tile(np.array(colour), (len(corners), 1))
    rgba[:, :3] *= 0.55 + 0.45 * shade[:, None]
    ax.add_collection3d(
        Poly3DCollection(1e3 * corners, facecolors=rgba, edgecolors=(0, 0, 0, 0.25), linewidths=0.3)
    )


def cut(corners: np.ndarray, centre: tuple[float, float], reach: float) -> np.ndarray:
    """Return triangles with what is further than `reach` [m] from `centre` in x and y pulled to there."""
    shown, middle = corners.copy(), np.array(centre)
    shown[..., :2] = np.clip(shown[..., :2], middle - reach, middle + reach)
    return shown


def rigid_bodies() -> plt.Figure:
    """Rigid bodies: the block on the incline, the bouncing ball, the stack at rest."""
    figure = plt.figure(figsize=(11, 4.6), dpi=110)
    cases = (
        ("incline", (0.0, 0.5, 0.8), (0.1, 0.0), "the block after 0, 0.5 and 0.8 s"),
        ("bounce", (0.0, 0.31, 0.53, 0.76), (0.0, 0.0), "the ball after 0, 0.31, 0.53 and 0.76 s"),
        ("stack", (1.0,), (0.0, 0.0), "the stack after 1 s"),
    )
    for k, (name, times, middle, title) in enumerate(cases):
        scene = load_scene(name)
        simulation = Simulation(scene)
        ax = figure.add_subplot(1, len(cases), k + 1, projection="3d")
        reach = 0.3
        floor = cut(
            obstacle_parts(scene.obstacles)[0].vertices[obstacle_parts(scene.obstacles)[0].triangles],
            middle,
            reach,
        )
        if name == "incline":  # pulled in along x, it must follow its slope
            floor[..., 2] = -np.tan(np.radians(20)) * floor[..., 0]
        ax.computed_zorder = False
        draw_surface(ax, floor, (0.93, 0.89, 0.8, 1.0))
        faces = simulation.mesh.surface
        for n, when in enumerate(times):
            for _ in range(round((when - simulation.state.time) / scene.dt)):
                simulation.step()
            colour = plt.get_cmap("viridis")(0.3 + 0.6 * n / len(times))
            draw_surface(ax, simulation.positions[faces], colour)
        top = 650.0 if name == "bounce" else 400.0
        ax.set(
            xlim=(1e3 * (middle[0] - reach), 1e3 * (middle[0] + reach)), ylim=(-300, 300), zlim=(-200, top),
            xticks=(-200, 0, 200, 400) if middle[0] else (-200, 0, 200), yticks=(-200, 0, 200),
            xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]",
        )  # fmt: skip
        ax.set_box_aspect((600, 600, top + 200))
        ax.view_init(elev=14, azim=-75)
        ax.set_title(title, fontsize=10)
    return figure


def falling_piece() -> plt.Figure:
    """The silicone piece that falls on a cube, at three times."""
    figure = plt.figure(figsize=(11, 4.4), dpi=110)
    scene = load_scene("silicone_drop")
    simulation = Simulation(scene)
    cube = obstacle_parts(scene.obstacles)[0]
    for k, when in enumerate((0.05, 0.12, 2.0)):
        for _ in range(round((when - simulation.state.time) / scene.dt)):
            simulation.step()
        ax = panel(figure, (1, 3, k + 1), f"after {simulation.state.time:.2f} s", (-85.0, 10.0))
        ax.computed_zorder = False
        draw_surface(ax, cube.vertices[cube.triangles], (0.93, 0.89, 0.8, 1.0))
        moved = displacements(simulation)
        draw_body(ax, simulation, moved / moved.max())
        ax.view_init(elev=18, azim=-62)
    return figure


PICTURES = {
    "silicone_free": free_fall, "silicone": fixing_box, "tripod": assembly, "maze": solved_maze,
    "rigid": rigid_bodies, "silicone_drop": falling_piece,
}  # fmt: skip


def main(names: Sequence[str] = (), folder: Path = IMAGES) -> None:
    """Draw the pictures `names`, without names all."""
    folder.mkdir(exist_ok=True)
    for name, draw in PICTURES.items():
        if names and name not in names:
            continue
        figure = draw()
        figure.tight_layout()
        figure.savefig(folder / f"{name}.png")
        plt.close(figure)


if __name__ == "__main__":
    main(sys.argv[1:])
