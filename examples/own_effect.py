"""An effect of your own: water, which lifts the silicone piece and slows it down.

    python examples/own_effect.py

A scene that is to know water needs a file in the library (docs/architecture.md, "Adding an effect"). From outside there
is this way: build the parts of a simulation, let their system take loads on the nodes, and write the forces before each
step. A force is then constant within a step, as that of a ball in a maze is: a strong damper or a stiff spring needs a
short dt, or a term of its own with a Hessian (`forces.term.BlockTerm`) when the system is made.
"""

import numpy as np

from tripod_sim import load_scene
from tripod_sim.build import build
from tripod_sim.forces.loads import NodalLoads

G = np.array([0.0, 0.0, -9.81])  # [m/s²]
LIFT = 0.8  # density of the water over that of the piece
DRAG = 2.0  # force per mass and speed [1/s]


def fall(overrides: list[str], *, lift: float, drag: float) -> tuple[np.ndarray, np.ndarray]:
    """Let the piece, held at one end, fall for 0.5 s; return where its nodes are and how fast, [m] and [m/s]."""
    scene = load_scene("silicone", [*overrides, "solver.tolerance=1e-9"])
    parts = build(scene)
    system, stepper, mass = parts.system, parts.stepper, parts.mass[:, None]
    loads = NodalLoads(system.rest)
    system.take(loads)
    state = system.start_state(np.zeros(1))
    for _ in range(round(0.5 / scene.dt)):
        loads.force[:] = -lift * mass * G - drag * mass * state.velocities  # [N], one row a node
        stepper.step(state, state.joints.copy(), scene.dt)
    return state.positions, state.velocities


def main() -> None:
    """Check the lift against less gravity and the drag against the scene's own damping, and show both."""
    lifted, _ = fall([], lift=LIFT, drag=0.0)
    lighter, _ = fall([f"gravity.acceleration=[0,0,{(1 - LIFT) * G[2]}]"], lift=0.0, drag=0.0)
    assert abs(lifted - lighter).max() < 1e-6, "to lift every node by a part of its weight is less gravity"

    for dt in ("0.005", "0.0025"):
        ours, _ = fall([f"dt={dt}"], lift=LIFT, drag=DRAG)
        theirs, _ = fall([f"dt={dt}", f"damping.mass={DRAG}"], lift=LIFT, drag=0.0)
        apart = abs(ours - theirs).max()
        print(f"dt {dt} s: {1e3 * apart:.3f} mm from the drag that the scene computes itself")

    dry, speed = fall([], lift=0.0, drag=0.0)
    wet, slow = fall([], lift=LIFT, drag=DRAG)
    print(
        f"lowest point after 0.5 s: {1e3 * dry[:, 2].min():.0f} mm in air, {1e3 * wet[:, 2].min():.0f} mm in water"
    )
    print(
        f"fastest node: {np.linalg.norm(speed, axis=1).max():.2f} and {np.linalg.norm(slow, axis=1).max():.2f} m/s"
    )


if __name__ == "__main__":
    main()
