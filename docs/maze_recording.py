"""Record a solved maze as a page: `python docs/maze_recording.py` writes docs/maze_game.html (needs viser)."""

from pathlib import Path

import numpy as np
import viser

from tripod_host.rotations import quaternion
from tripod_play.solve import solve
from tripod_sim import Simulation, load_scene

OUT = Path(__file__).parent / "maze_game.html"
RATE = 20.0
"""Pictures a second."""

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
FACES = np.array([t for a, b, c, d in QUADS for t in ((a, b, c), (a, c, d))])


def wxyz(q: np.ndarray) -> np.ndarray:
    """Return a quaternion (x, y, z, w) in viser's order."""
    return np.roll(q, 1)


def main() -> None:
    """Play the maze `first` and write the page; lengths are drawn in decimetres."""
    scale = 10.0
    simulation = Simulation(load_scene("maze", ["maze.source=first"]))
    game = simulation.ball_game
    boxes = game.plate.board.obstacles.boxes
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    server.request_share_url = lambda *a, **k: None
    scene = server.scene
    scene.set_up_direction("+z")
    server.initial_camera.position, server.initial_camera.look_at = (0.4, -0.55, 0.52), (0.0, 0.0, -0.12)
    surface = simulation.mesh.surface.astype(np.uint32)
    body = scene.add_mesh_simple("/body", scale * simulation.positions, surface, color=(90, 150, 200))
    plate = scene.add_frame("/plate", show_axes=False)
    for k, box in enumerate(boxes):
        colour = (235, 225, 205) if k == 0 else (150, 110, 70)
        scene.add_mesh_simple(f"/plate/{k}", scale * (box[:3] + CORNERS * box[3:]), FACES, color=colour)
    goal = game.plate.board.goal
    scene.add_icosphere(
        "/plate/goal",
        radius=scale * 0.0012,
        color=(60, 170, 80),
        position=(scale * goal[0], scale * goal[1], 0),
    )
    ball = scene.add_icosphere("/ball", radius=scale * 0.002, color=(200, 40, 40), subdivisions=2)
    serializer = server.get_scene_serializer()
    every = round(1 / (RATE * simulation.scene.dt))

    def show(now: Simulation) -> None:
        if now.state.step % every:
            return
        body.vertices = (scale * now.positions).astype(np.float32)
        r = now.state.rotations[0]
        plate.position = scale * (now.state.centres[0] + r @ [0, 0, game.plate.offset])
        plate.wxyz = wxyz(quaternion(r))
        ball.position, ball.wxyz = scale * now.ball.position, wxyz(now.ball.quaternion)
        serializer.insert_sleep(1 / RATE)

    solution = solve(simulation, 0, watch=show)
    assert solution.solved, solution.why
    serializer.insert_sleep(1.0)
    OUT.write_text(serializer.as_html(), encoding="utf-8")
    server.stop()
    print(f"{OUT.name}: {solution.time:.2f} s, {OUT.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
