"""Tables of the maze and of a ball."""

from dataclasses import dataclass

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


@dataclass(frozen=True)
class Ball:
    """A rigid ball: in the maze if there is one, else a rigid body in contact. Needs gravity.

    Outside of a maze and without [contact] a scene with a ball has that of the ball's friction, restitution and
    rest_speed, at a sixteenth of its radius; with [contact] that counts for the ball, too.

    Attributes:
        radius: [m].
        mass: [kg], spread evenly through the ball.
        friction: Coulomb's coefficient.
        restitution: Normal speed after an impact over that before it.
        rest_speed: Impacts below it do not bounce [m/s].
        rolling: Rolling resistance in the maze: moment over load and radius.
        substep: Longest part of a step in which it moves in the maze [s].
        position: Of the centre at the start [m]; in a maze it starts there where the maze says.
    """

    radius: float = number(0.002, unit="m", low=1e-5, high=1.0)
    mass: float = number(1e-4, unit="kg", above=0, high=10.0)
    friction: float = number(0.3, low=0, high=10.0)
    restitution: float = number(0.4, low=0, high=1.0)
    rest_speed: float = number(0.01, unit="m/s", low=1e-6, high=10.0)
    rolling: float = number(0.002, low=0, high=1.0)
    substep: float = number(5e-4, unit="s", low=1e-7, high=0.1)
    position: tuple[float, float, float] = number((0.0, 0.0, 0.02), unit="m", low=-10.0, high=10.0)
