"""`tripod path`, `tripod solve` and `tripod maze`: from the command line to `tripod_play` and back."""

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from tripod_bringup.compiling import compiling_told
from tripod_bringup.run_command import BAD_ARGUMENTS, FAILED, plain, progress_bar

NOT_SOLVED = 1
"""Largest --limit and --delay [s], and --noise [m]."""


def path_command(
    file: Path,
    *,
    scene: str,
    overrides: list[str],
    speed: float,
    live: bool,
    subnet: bool,
    ros: Sequence[str],
    as_json: bool,
    quiet: bool,
) -> int:
    """Play a path and return the exit code: 2 bad input, 1 the motion broke off."""  # fmt: skip
    import numpy as np  # noqa: PLC0415 - not needed for the help

    from tripod_ik.errors import IkError  # noqa: PLC0415
    from tripod_play.errors import PlayError  # noqa: PLC0415
    from tripod_play.follow import servo_path  # noqa: PLC0415
    from tripod_play.path_file import read_path  # noqa: PLC0415
    from tripod_sim import SceneError, Simulation, StepError, load_scene  # noqa: PLC0415

    shown = not quiet and sys.stderr.isatty()
    try:
        points = read_path(file)
        description = load_scene(scene, overrides)
        with progress_bar(shown=shown) as progress:
            path = servo_path(description, points, speed, progress=progress)
        for limit in path.limits:
            print(f"tripod path: {limit}", file=sys.stderr)
        if live:
            from tripod_play.node import PathNode  # noqa: PLC0415

            return _in_graph("path", lambda: PathNode(points, path), subnet=subnet, ros=ros)
        simulation, dt = Simulation(description), description.dt
        joints, steps = simulation.command, int(np.ceil(path.times[-1] / description.dt)) + 1
        with progress_bar(shown=shown) as progress:
            for k in range(steps):
                joints[:-1] = path.at((k + 1) * dt)
                if unstable := simulation.step(joints).instability:
                    raise StepError(unstable)
                if progress:
                    progress((k + 1) / steps)
    except (PlayError, IkError, SceneError) as error:
        return _complain("path", error, BAD_ARGUMENTS)
    except StepError as error:
        return _complain("path", error, FAILED)
    except ImportError as error:
        return _complain("path", error, FAILED)
    pose = simulation.effector
    result: dict[str, Any] = {
        "scene": description.name,
        "key_points": len(points.times),
        "time": float(path.times[-1]),
        "file_time": float(points.times[-1]),
        "limits": [str(limit) for limit in path.limits],
        "angles": simulation.state.joints[:-1],
        "effector": {"position": pose.position, "quaternion": pose.quaternion} if pose else None,
    }
    if simulation.ball:
        result["ball"] = {"position": simulation.ball.position, "event": simulation.ball_event}
    _show(result, as_json=as_json, quiet=quiet)
    return 0


def solve_command(
    maze: str,
    *,
    scene: str,
    overrides: list[str],
    seed: int,
    games: int,
    noise: float,
    delay: float,
    limit: float,
    live: bool,
    subnet: bool,
    ros: Sequence[str],
    as_json: bool,
    quiet: bool,
) -> int:
    """Solve a maze and return the exit code: 2 bad input, 1 a game was not won."""  # fmt: skip
    from tripod_play.errors import PlayError  # noqa: PLC0415 - not needed for the help
    from tripod_play.player import PlayerSettings  # noqa: PLC0415
    from tripod_play.solve import Eye, solve  # noqa: PLC0415
    from tripod_sim import SceneError, Simulation, StepError, load_scene  # noqa: PLC0415

    for name, value, most, unit in (
        ("limit", limit, 1e6, "s"),
        ("noise", noise, 1, "m"),
        ("delay", delay, 1, "s"),
    ):
        if not 0 <= value <= most:
            wrong = f"--{name} is {value:g} {unit}; allowed is 0 to {most:g} {unit}"
            return _complain("solve", ValueError(wrong), BAD_ARGUMENTS)
    words = [*([f"maze.source={maze}"] if maze else []), *overrides]
    try:
        description = load_scene(scene, words)
        if live:
            return _solve_live(description, PlayerSettings(), delay, subnet=subnet, ros=ros)
        eye, won = Eye(noise=noise, delay=delay), list[dict[str, Any]]()
        with (
            progress_bar(shown=not quiet and sys.stderr.isatty()) as progress,
            compiling_told("tripod solve", progress.say if progress else None),
        ):
            simulation = Simulation(description)
            for k in range(games):
                solution = solve(simulation, seed + k, eye=eye, limit=limit)
                won.append(
                    {"seed": seed + k, "solved": solution.solved, "time": solution.time, "why": solution.why}
                )
                if progress:
                    progress((k + 1) / games)
    except (PlayError, SceneError) as error:
        return _complain("solve", error, BAD_ARGUMENTS)
    except StepError as error:
        return _complain("solve", error, FAILED)
    except ImportError as error:
        return _complain("solve", error, FAILED)
    times = sorted(g["time"] for g in won if g["solved"])
    result = {
        "maze": description.maze.source if description.maze else None,
        "games": won,
        "solved": len(times),
        "median_time": times[len(times) // 2] if times else None,
    }
    if as_json:
        print(json.dumps(plain(result)))
    elif not quiet:
        for game in won:
            print(f"seed {game['seed']}: {game['why']} ({game['time']:.2f} s)")
        median = f"; median {result['median_time']:.2f} s" if times else ""
        print(f"{result['maze']}: {len(times)} of {len(won)} solved{median}")
    return 0 if len(times) == len(won) else NOT_SOLVED


def _solve_live(description: Any, settings: Any, delay: float, *, subnet: bool, ros: Sequence[str]) -> int:
    from tripod_play.errors import PlayError  # noqa: PLC0415
    from tripod_sim.maze.board import make_board  # noqa: PLC0415

    if not (description.maze and description.ball):
        raise PlayError(f"scene {description.name!r} has no maze with a ball in it")
    board = make_board(description.maze, description.ball.radius)
    clearance = 0.5 * (description.maze.pitch - description.maze.wall) - description.ball.radius
    settings = replace(settings, clearance=clearance)
    from tripod_play.node import SolveNode  # noqa: PLC0415

    return _in_graph(
        "solve", lambda: SolveNode(board, description.maze.offset, settings, delay), subnet=subnet, ros=ros
    )


def maze_command(source: str) -> int:
    """Print a maze and return the exit code."""
    from tripod_sim import SceneError  # noqa: PLC0415
    from tripod_sim.maze.board import maze_names, read_maze  # noqa: PLC0415
    from tripod_sim.maze.grid import maze_to_text  # noqa: PLC0415

    if not source:
        print("\n".join(maze_names()))
        return 0
    try:
        print(maze_to_text(read_maze(source)), end="")
    except SceneError as error:
        return _complain("maze", error, BAD_ARGUMENTS)
    return 0


def _in_graph(name: str, make: Callable[[], Any], *, subnet: bool, ros: Sequence[str]) -> int:
    """Run a node until it is done, or told to stop before, which is no success."""
    from tripod_graph.run import run_node  # noqa: PLC0415

    made: list[Any] = []

    def build() -> Any:
        made.append(make())
        return made[0]

    words = [*(["--subnet"] if subnet else []), "--ros-args", *ros]
    code = run_node(name, build, words, until=lambda: bool(made[0].done))
    if made and made[0].done:
        print(made[0].done)
        return code or (0 if made[0].done.startswith(("goal", "path")) else NOT_SOLVED)
    return code or NOT_SOLVED


def _show(result: dict[str, Any], *, as_json: bool, quiet: bool) -> None:
    if as_json:
        print(json.dumps(plain(result)))
    elif not quiet:
        print(
            f"{result['key_points']} key points, {result['file_time']:.2f} s, played in {result['time']:.2f} s"
        )
        if effector := result["effector"]:
            print(f"effector  {', '.join(f'{1e3 * x:.3f}' for x in effector['position'])} mm")
        if ball := result.get("ball"):
            print(
                f"ball      {', '.join(f'{1e3 * x:.3f}' for x in ball['position'])} mm  {ball['event']}".rstrip()
            )


def _complain(name: str, error: Exception, code: int) -> int:
    print(f"tripod {name}: " + " ".join(str(error).split()), file=sys.stderr)
    return code
