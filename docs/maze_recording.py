"""Record a solved maze as a page: `python docs/maze_recording.py` writes docs/maze_game.html."""

from pathlib import Path

import numpy as np

from tripod_play.solve import solve
from tripod_sim import Simulation, load_scene
from tripod_study.recording import Recording
from tripod_view.player.film import Film
from tripod_view.player.html import write_html
from tripod_view.player.of_run import film_of

OUT = Path(__file__).parent / "maze_game.html"
RATE, LONGEST = 20, 60.0
"""Pictures a second, and the longest game [s]."""


def film() -> Film:
    """Return the film of the maze `first`, solved."""
    simulation = Simulation(load_scene("maze", ["maze.source=first"]))
    recording = Recording(simulation, round(LONGEST / simulation.scene.dt))
    solution = solve(simulation, 0, watch=recording.add)
    assert solution.solved, solution.why
    every = round(1 / (RATE * simulation.scene.dt))
    return film_of(recording.arrays(), np.arange(0, recording.count, every))


if __name__ == "__main__":
    write_html(film(), OUT)
    print(f"{OUT.name}: {OUT.stat().st_size / 1e6:.2f} MB")
