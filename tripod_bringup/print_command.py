"""`tripod print`: scenes, mazes, robots and parameters as text, to read or to write into a file and change."""

import json
import sys
from dataclasses import asdict

from tripod_bringup.run_command import BAD_ARGUMENTS


def list_scenes(*, as_json: bool) -> None:
    """Print name and description of every shipped scene."""
    from tripod_sim.scene.file import load_scene, scene_names  # noqa: PLC0415 - not needed for the help

    listing = [(name, load_scene(name).description) for name in scene_names()]
    if as_json:
        print(json.dumps([{"name": name, "description": text} for name, text in listing]))
        return
    width = max((len(name) for name, _ in listing), default=0)
    for name, text in listing:
        print(f"{name:<{width}}  {text}".rstrip())


def print_scene(name: str, *, as_json: bool) -> int:
    """Print the file of a scene, or all of its values as JSON; return the exit code: 2 for no such scene."""
    from tripod_sim.errors import SceneError  # noqa: PLC0415 - not needed for the help
    from tripod_sim.scene.file import load_scene, scene_text  # noqa: PLC0415

    try:
        print(json.dumps(asdict(load_scene(name))) if as_json else scene_text(name).rstrip("\n"))
    except SceneError as error:
        return _complain("scene", error)
    return 0


def print_maze(source: str) -> int:
    """Print a maze, without a source the names of the shipped ones; return the exit code: 2 for no such maze."""
    from tripod_sim.errors import SceneError  # noqa: PLC0415 - not needed for the help
    from tripod_sim.maze.board import maze_names, read_maze  # noqa: PLC0415
    from tripod_sim.maze.grid import maze_to_text  # noqa: PLC0415

    if not source:
        print("\n".join(maze_names()))
        return 0
    try:
        print(maze_to_text(read_maze(source)), end="")
    except SceneError as error:
        return _complain("maze", error)
    return 0


def print_urdf(scene: str, overrides: list[str]) -> int:
    """Print the robot of a scene as URDF; return the exit code: 2 for a bad scene or one without a robot."""
    from tripod_sim.errors import SceneError  # noqa: PLC0415
    from tripod_sim.scene.description import urdf  # noqa: PLC0415 - not needed for the help
    from tripod_sim.scene.file import load_scene  # noqa: PLC0415

    try:
        print(urdf(load_scene(scene, overrides)), end="")
    except SceneError as error:
        return _complain("urdf", error)
    return 0


def _complain(what: str, error: Exception) -> int:
    print(f"tripod print {what}: {error}", file=sys.stderr)
    return BAD_ARGUMENTS
