"""`tripod scenes`: which scenes there are, and the text of one."""

import json
import sys
from dataclasses import asdict

BAD_ARGUMENTS = 2


def list_scenes(*, as_json: bool) -> None:
    """Print name and description of every shipped scene."""
    from tripod_sim.scene_file import load_scene, scene_names  # noqa: PLC0415 - not needed for the help

    listing = [(name, load_scene(name).description) for name in scene_names()]
    if as_json:
        print(json.dumps([{"name": name, "description": text} for name, text in listing]))
        return
    width = max((len(name) for name, _ in listing), default=0)
    for name, text in listing:
        print(f"{name:<{width}}  {text}".rstrip())


def print_scene(name: str, *, as_json: bool) -> int:
    """Print a scene as its file has it, or all of its values as JSON; return the exit code: 2 for no such scene."""
    from tripod_sim.errors import SceneError  # noqa: PLC0415 - not needed for the help
    from tripod_sim.scene_file import load_scene, scene_text  # noqa: PLC0415

    try:
        print(json.dumps(asdict(load_scene(name))) if as_json else scene_text(name).rstrip("\n"))
    except SceneError as error:
        print(f"tripod scenes: {error}", file=sys.stderr)
        return BAD_ARGUMENTS
    return 0
