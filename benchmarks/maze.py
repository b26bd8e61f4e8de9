"""The maze on the robot: time of a step, hard play, convergence of the ball's path, and mazes solved by themselves.

`python benchmarks/maze.py` prints all tables; `--only time hard path solve` chooses. CPU time of one thread.
"""

import argparse
import time

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np

from tripod_play.solve import solve
from tripod_play.tilt import tilt_map
from tripod_sim import Simulation, load_scene
from tripod_sim.ball.ball import Place, account

MAZES = ("first", "labyrinth", "holes")
KEYS = np.array(
    [
        (0.0, 0.0, 0.0),
        (0.2, 0.0, 0.03),
        (0.5, 0.0, 0.03),
        (0.7, 0.0, -0.03),
        (1.0, 0.02, 0.0),
        (1.4, -0.03, 0.02),
    ]
)
"""A table as the workshop's: time [s], tilt about x, tilt about y [rad]."""


def tilts_of(simulation):
    servos = simulation.scene.servos
    return tilt_map(
        simulation.compliance().w, simulation.state.joints[:3], servos.angle_min, servos.angle_max
    )


def hard_tilt(t, targets):
    """A new tilt every 0.5 s, reached in 0.1 s."""
    i, s = int(t / 0.5 + 1e-9), min((t % 0.5) / 0.1, 1.0)
    s = s * s * (3 - 2 * s)
    return (1 - s) * targets[i] + s * targets[i + 1]


def play_hard(dt, seconds, seed, overrides=()):
    """Return the ball's account and the times of the steps; a ball that is lost is put back to the start."""
    simulation = Simulation(load_scene("maze", [f"dt={dt}", *overrides]))
    tilts, start = tilts_of(simulation), simulation.state.copy()
    rng = np.random.default_rng(seed)
    targets = rng.uniform(-0.3, 0.3, (int(seconds / 0.5) + 2, 2))
    targets[0] = 0
    game, ball, grid = simulation.ball_game, simulation.state.ball, simulation.ball_game.plate.board.grid
    pitch, height = simulation.scene.maze.pitch, simulation.scene.maze.height
    energy, drift, through, lost = game.ball.energy(ball), 0.0, 0, 0
    totals, cell, gap, fastest, taken = np.zeros(5), grid.start, np.inf, 0.0, []
    joints = simulation.command

    def close():
        nonlocal drift, gap
        a = account(ball)
        drift += abs(game.ball.energy(ball) - energy - (a.work - a.loss + a.gain + a.shift))
        totals[:] += [a.work, a.loss, a.gain, a.shift, a.work + ball.load_work]
        gap = min(gap, a.gap)

    for k in range(round(seconds / dt)):
        joints[:3] = tilts(hard_tilt((k + 1) * dt, targets))
        begin = time.thread_time()
        simulation.step(joints)
        taken.append(time.thread_time() - begin)
        if ball.place is not Place.PLAYING:
            close()
            lost += 1
            start.ball.copy_to(ball)
            r = simulation.state.rotations[0]
            ball.position[:] = simulation.state.centres[0] + r @ (
                start.rotations[0].T @ (start.ball.position - start.centres[0])
            )
            energy, cell = game.ball.energy(ball), grid.start
            continue
        q = game.local(simulation.state, ball)
        now = grid.cell_at(q[0], q[1], pitch)
        near = {cell, *grid.neighbours(cell)}
        near |= {c for n in near for c in grid.neighbours(n)}
        through += now not in near and q[2] < height
        cell = now
        fastest = max(fastest, float(np.linalg.norm(ball.velocity)))
    close()
    return totals, drift, gap, through, lost, fastest, np.array(taken)


def hard(seconds):
    print(f"hard play, {seconds:g} s of tilts to 0.3 rad every 0.5 s on the robot; energies in uJ")
    print(
        "  dt [ms]  through  lost  fastest [m/s]  gap [um]     work     loss   gain   shift  of delay    unbooked"
    )
    for dt in (0.01, 0.005, 0.002, 0.001):
        totals, drift, gap, through, lost, fastest, _ = play_hard(dt, seconds, 3)
        w, d, g, s, c = 1e6 * totals
        print(
            f"  {1e3 * dt:7g}  {through:7d}  {lost:4d}  {fastest:13.3f}  {1e6 * gap:8.3f}  {w:7.1f}  {d:7.1f}  {g:5.3f}"
            f"  {s:6.3f}  {c:8.2f}  {1e6 * drift:10.1e}"
        )
    print(
        "through: passages where a wall stands; lost: over the walls, put back; of delay: work of ball and robot summed"
    )


def row(name, taken):
    ms = 1e3 * np.array(taken)
    print(
        f"  {name:<23}  {np.median(ms):6.3f}   {ms.mean():6.3f}   {np.percentile(ms, 99):6.3f}"
        f"  {5 / ms.mean():6.1f}"
    )


def timing(steps):
    print(f"scene maze, dt 5 ms, {steps} steps, CPU time [ms]")
    print("  what                     median     mean      p99  real-time factor")
    rows = {
        "tilts of the key points": (),
        "without ball": ("ball=off",),
        "without maze": ("ball=off", "maze=off"),
    }
    for name, overrides in rows.items():
        simulation = Simulation(load_scene("maze", list(overrides)))
        tilts, dt, taken = tilts_of(simulation), simulation.scene.dt, []
        joints = simulation.command
        for k in range(steps):
            t = (k + 1) * dt % 3.0
            goal = [np.interp(t, [*KEYS[:, 0], 3.0], [*KEYS[:, i], 0.0]) for i in (1, 2)]
            joints[:3] = tilts(np.array(goal))
            begin = time.thread_time()
            simulation.step(joints)
            taken.append(time.thread_time() - begin)
        row(name, taken)
    _, _, _, _, _, _, taken = play_hard(0.005, steps * 0.005, 3)
    row("hard play", taken)


def path():
    print("path of the ball on a table of key points, in the plate's frame: difference to dt 0.5 ms [mm]")
    times, tracks, hits = np.arange(1, 141) * 0.01, {}, {}
    for dt in (0.01, 0.005, 0.002, 0.001, 0.0005):
        simulation = Simulation(load_scene("maze", [f"dt={dt}", "maze.source=first", "ball.rolling=0.0"]))
        tilts, track, joints = tilts_of(simulation), [], simulation.command
        game, ball = simulation.ball_game, simulation.state.ball
        for k in range(round(1.4 / dt)):
            t = (k + 1) * dt
            joints[:3] = tilts(np.array([np.interp(t, KEYS[:, 0], KEYS[:, i]) for i in (1, 2)]))
            simulation.step(joints)
            if round(t / dt) % round(0.01 / dt) == 0:
                track.append(game.local(simulation.state, ball)[:2])
            if dt not in hits and account(ball).hardest > 0.01:
                hits[dt] = t
        tracks[dt] = np.array(track)
    first = min(hits.values(), default=1.4)
    print(f"  first bounce at {first:.3f} s; times shown [s]:", *(f"{t:6.2f}" for t in times[9::20]))
    for dt, track in tracks.items():
        if dt == 0.0005:
            continue
        error = 1e3 * np.linalg.norm(track - tracks[0.0005], axis=1)
        before = error[times < first].max()
        print(
            f"  dt {1e3 * dt:4g} ms: to the first bounce {before:.4f};", *(f"{e:6.3f}" for e in error[9::20])
        )


def solving(seeds):
    print(
        f"mazes solved on the robot, {seeds} seeds each: noise 0.3 mm, delay 60 ms (three periods of 20 ms), dt 5 ms"
    )
    print("  maze        solved   median [s]   slowest [s]")
    for name in MAZES:
        simulation = Simulation(load_scene("maze", [f"maze.source={name}"]))
        results = [solve(simulation, seed) for seed in range(seeds)]
        times = [r.time for r in results if r.solved]
        print(
            f"  {name:<10}  {len(times):2d}/{seeds:<2d}  {np.median(times) if times else np.nan:10.2f}  "
            f"{max(times, default=np.nan):12.2f}",
            *(r.why for r in results if not r.solved),
            flush=True,
        )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=("time", "hard", "path", "solve"), default=None)
    parser.add_argument("--steps", type=int, default=2000, help="steps of each timing (default 2000)")
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="simulated time of hard play (default 60)"
    )
    parser.add_argument("--seeds", type=int, default=20, help="games for each maze (default 20)")
    options = parser.parse_args()
    print(f"1000 x 1000 float64 product, one thread: {1e3 * calibration():.1f} ms")
    chosen = options.only or ("time", "hard", "path", "solve")
    if "time" in chosen:
        timing(options.steps)
    if "hard" in chosen:
        hard(options.seconds)
    if "path" in chosen:
        path()
    if "solve" in chosen:
        solving(options.seeds)


if __name__ == "__main__":
    main()
