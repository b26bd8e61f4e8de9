"""A robot of your own, as far as a scene can tell: where the servos stand, what they hold, what the piece is made of.

python examples/own_robot.py           # compares own_robot.toml with the Tripod
tripod run examples/own_robot.toml --view
"""

from pathlib import Path

import numpy as np

from tripod_sim import Simulation, load_scene

OWN = Path(__file__).with_name("own_robot.toml")


def reach(scene: str) -> tuple[float, float]:
    """Bend all servos alike, slowly, to -0.4 rad; return how far the effector rises [m], the torque of each [N m]."""
    simulation = Simulation(load_scene(scene, ["inertia=off", "damping=off", "motion=off"]))
    start = simulation.effector.position
    for share in np.linspace(0, 1, 9)[1:]:
        simulation.step(np.array([-0.4, -0.4, -0.4, 0.0]) * share)
    moved = simulation.effector.position - start
    assert abs(moved[:2]).max() < 1e-6, "servos that turn alike move the effector straight up or down"
    return moved[2], abs(simulation.efforts).max()


def main() -> None:
    """Print both robots side by side."""
    for name, scene in (("the Tripod", "tripod"), ("our own", str(OWN))):
        rise, torque = reach(scene)
        print(f"{name:10}: all servos at -0.4 rad: effector {1e3 * rise:.2f} mm up, {torque:.3f} N m each")


if __name__ == "__main__":
    main()
