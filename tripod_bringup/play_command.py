"""`tripod play`: from the command line to `tripod_play` and back."""

import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from tripod_bringup.compiling import compiling_told
from tripod_bringup.long_work import interruptible, loading
from tripod_bringup.run_command import BAD_ARGUMENTS, FAILED, Progress, plain, progress_bar

NOT_SOLVED = 1
"""Exit code where a game is lost."""


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
    with loading("tripod play", shown=not quiet):
        import numpy as np  # noqa: PLC0415 - not needed for the help

        from tripod_ik.errors import IkError  # noqa: PLC0415
        from tripod_play.errors import PlayError  # noqa: PLC0415
        from tripod_play.follow import servo_path  # noqa: PLC0415
        from tripod_play.path_file import read_path  # noqa: PLC0415
        from tripod_sim import SceneError, Simulation, StepError, load_scene  # noqa: PLC0415
        from tripod_sim.scene.file import naming_file  # noqa: PLC0415

    shown = not quiet and sys.stderr.isatty()
    try:
        points = read_path(file)
        description = load_scene(scene, overrides)
        with interruptible("tripod play"), progress_bar("finding servo angles", shown=shown) as progress:
            path = servo_path(description, points, speed, progress=progress)
        for limit in path.limits:
            print(f"tripod play: {limit}", file=sys.stderr)
        if live:
            from tripod_play.node import PathNode  # noqa: PLC0415

            return _in_graph("path", lambda: PathNode(points, path), subnet=subnet, ros=ros)
        with interruptible("tripod play"), progress_bar("simulating", shown=shown) as progress:
            with naming_file(scene, overrides):
                simulation, dt = Simulation(description), description.dt
            joints, steps = simulation.command, int(np.ceil(path.times[-1] / dt)) + 1
            for k in range(steps):
                joints[:-1] = path.at((k + 1) * dt)
                if unstable := simulation.step(joints).instability:
                    raise StepError(unstable)
                if progress:
                    progress((k + 1) / steps)
    except (PlayError, IkError, SceneError) as error:
        return _complain(error, BAD_ARGUMENTS)
    except StepError as error:
        return _complain(error, FAILED)
    except ImportError as error:
        return _complain(error, FAILED)
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
    with loading("tripod play", shown=not quiet):
        from tripod_play.errors import PlayError  # noqa: PLC0415 - not needed for the help
        from tripod_play.player import PlayerSettings  # noqa: PLC0415
        from tripod_play.solve import Eye, solve  # noqa: PLC0415
        from tripod_sim import SceneError, Simulation, StepError, load_scene  # noqa: PLC0415
        from tripod_sim.scene.file import naming_file  # noqa: PLC0415

    words = [*([f"maze.source={maze}"] if maze else []), *overrides]
    try:
        description = load_scene(scene, words)
        if live:
            return _solve_live(description, PlayerSettings(), delay, subnet=subnet, ros=ros)
        eye, won = Eye(noise=noise, delay=delay), list[dict[str, Any]]()
        with (
            interruptible("tripod play"),
            progress_bar("building the scene", shown=not quiet and sys.stderr.isatty()) as progress,
            compiling_told("tripod play", progress.say if progress else None),
        ):
            with naming_file(scene, words):
                simulation = Simulation(description)
            for k in range(games):
                if progress:
                    progress.say(f"game {k + 1} of {games}")
                watch = partial(_show_game, progress, k, games, limit) if progress else None
                solution = solve(simulation, seed + k, eye=eye, limit=limit, watch=watch)
                won.append(
                    {"seed": seed + k, "solved": solution.solved, "time": solution.time, "why": solution.why}
                )
                if progress:
                    progress((k + 1) / games)
    except (PlayError, SceneError) as error:
        return _complain(error, BAD_ARGUMENTS)
    except StepError as error:
        return _complain(error, FAILED)
    except ImportError as error:
        return _complain(error, FAILED)
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


def _show_game(progress: Progress, number: int, games: int, limit: float, simulation: Any) -> None:
    """Show how far the games are: a game that is not won takes `limit` [s]."""
    progress((number + min(1.0, simulation.state.time / max(limit, 1e-9))) / games)


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
        return code or (0 if made[0].succeeded else NOT_SOLVED)
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


def _complain(error: Exception, code: int) -> int:
    print("tripod play: " + " ".join(str(error).split()), file=sys.stderr)
    return code
