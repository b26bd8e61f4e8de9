"""Effect: a plate with walls on the effector disc."""

from dataclasses import dataclass

from tripod_sim.effect import Draft, Effect, Need
from tripod_sim.tables.fields import number


@dataclass(frozen=True)
class Maze:
    """A plate with walls on the effector disc. Needs effector.

    Attributes:
        source: Name of a shipped maze, the path of a text file (`.txt`) or of an STL surface (`.stl`), relative to the
            scene's file, or `random:SEED`, or `random:SEED:COLUMNSxROWS`.
        pitch: Distance of the centres of two cells [m].
        wall: Thickness of the walls [m].
        height: Of the walls above the floor [m].
        thickness: Of the floor [m].
        offset: Of the floor's top above the centre of the disc [m].
        mass: Of the whole plate [kg], spread evenly over its floor.
        hole_radius: Of the holes [m].
        scale: Length unit of an STL file [m]: 0.001 for millimetres.
        start: Of the ball in an STL maze: x, y [m] in the plate's frame.
        goal: Centre x, y of the goal of an STL maze and its radius [m]; a radius of 0 is no goal.
    """

    source: str = "labyrinth"
    pitch: float = number(0.007, unit="m", above=0, high=1.0)
    wall: float = number(0.001, unit="m", low=1e-5, high=1.0)
    height: float = number(0.004, unit="m", above=0, high=1.0)
    thickness: float = number(0.002, unit="m", above=0, high=1.0)
    offset: float = number(0.008, unit="m", low=0, high=1.0)
    mass: float = number(0.008, unit="kg", above=0, high=100.0)
    hole_radius: float = number(0.0026, unit="m", above=0, high=1.0)
    scale: float = number(0.001, unit="m", above=0, high=1e3)
    start: tuple[float, float] = number((0.0, 0.0), unit="m")
    goal: tuple[float, float, float] = number((0.0, 0.0, 0.0), unit="m")


def extend(maze: Maze, draft: Draft) -> None:
    """Fasten the plate's mass points to the disc."""
    from tripod_sim.maze.plate import fasten

    radius = draft.scene.ball.radius if draft.scene.ball else 0.0
    draft.rest, draft.groups, draft.plate = fasten(draft.rest, draft.groups, maze, radius)


def weigh(maze: Maze, draft: Draft) -> None:
    """Give them their mass."""
    nodes, mass = draft.plate.nodes, draft.plate.mass
    draft.load[nodes], draft.inert[nodes] = mass, mass


EFFECT = Effect(
    Maze,
    rank=130,
    needs=(Need("effector", "the plate is fastened to the disc; add [effector]"),),
    modules=("maze",),
    extend=extend,
    weigh=weigh,
)
