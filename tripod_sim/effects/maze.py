"""Effect: a plate with walls on the effector disc."""

from tripod_sim.effect import Described, Draft, Effect, Need
from tripod_sim.errors import SceneError
from tripod_sim.tables.maze import Maze
from tripod_sim.tables.short_forms import discs_of


def extend(maze: Maze, draft: Draft) -> None:
    """Fasten the plate's mass points to the disc."""
    from tripod_sim.maze.plate import fasten

    radius = draft.model.ball.radius if draft.model.ball else 0.0
    draft.rest, draft.groups, draft.plate = fasten(draft.rest, draft.groups, maze, radius)


def check(_: Maze, scene: Described) -> None:
    """Raise SceneError where the effector is no disc."""
    if not discs_of(scene):
        raise SceneError(
            "the plate of maze is fastened to a disc, but effector is a point or a set, which holds nothing: leave "
            "effector.point and effector.set out"
        )


def weigh(maze: Maze, draft: Draft) -> None:
    """Give them their mass."""
    nodes, mass = draft.plate.nodes, draft.plate.mass
    draft.load[nodes], draft.inert[nodes] = mass, mass


EFFECT = Effect(
    Maze,
    rank=130,
    needs=(Need("effector", "the plate is fastened to the disc; add [effector]"),),
    check=check,
    modules=("maze",),
    extend=extend,
    weigh=weigh,
)
