"""A maze of your own: a text file, refused if it has no way to the goal, then played by the robot.

python examples/own_maze.py            # writes corner.txt beside you, and plays it
tripod run maze --set maze.source=corner.txt --view
"""

from pathlib import Path

from tripod_play.solve import solve
from tripod_sim import SceneError, Simulation, load_scene

MAZE = """\
+---+---+---+
| S         |
+---+---+   +
| G         |
+---+---+---+
"""


def main() -> None:
    """Write the maze, see a bad one refused, and let inverse kinematics roll the ball to the goal."""
    Path("closed.txt").write_text(MAZE.replace("+---+---+   +", "+---+---+---+"))
    try:
        Simulation(load_scene("maze", ["maze.source=closed.txt"]))
    except SceneError as error:
        print(f"refused: {error}")

    Path("corner.txt").write_text(MAZE)
    solution = solve(Simulation(load_scene("maze", ["maze.source=corner.txt"])), seed=1)
    print(f"{solution.why} after {solution.time:.2f} s")
    assert solution.solved


if __name__ == "__main__":
    main()
