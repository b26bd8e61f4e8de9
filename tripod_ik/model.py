"""The robot's own model: the quasi-static simulation, asked for its linearised response at given angles.

Pure: no ROS. It stands in where no simulator is in the graph, and answers the command line.
"""

from dataclasses import replace

import numpy as np

from tripod_graph.names import SERVOS, WORKING_POSE
from tripod_ik.arrays import FloatArray, frozen
from tripod_ik.errors import IkError
from tripod_ik.state import LinearState
from tripod_sim.compliance import Compliance
from tripod_sim.scene import Scene
from tripod_sim.simulation import Simulation
from tripod_sim.state import State

Saved = tuple[tuple[State, FloatArray], LinearState | None]
"""What `StaticModel.save` gives and `restore` takes."""

TOLERANCE = 1e-7
"""Unbalanced force [N] of the model's equilibria: with 10 mm/N that is a nanometre."""


def linear_state(c: Compliance) -> LinearState:
    """Return the compliance of a simulation as inverse kinematics takes it; raise IkError if it cannot be used."""
    return LinearState(
        SERVOS[: len(c.angles)], c.angles, c.torques, c.position, c.quaternion, c.equilibrium_offset, c.w
    )


class StaticModel:
    """A robot at rest: each set of angles has an equilibrium, reached along the way from the one before.

    Attributes:
        simulation: Of the scene without inertia, damping, servo dynamics and ball: where a ball lies nobody tells it.
        slide: Inward shift of the servo bodies [m].
    """

    def __init__(
        self, scene: Scene, slide: float = WORKING_POSE[3], angles: FloatArray | None = None
    ) -> None:
        """Build the model and bring it to `angles` [rad], shape (s,); None means the working pose.

        Raises:
            IkError: the scene has no servos or no effector, or the pose is out of its limits.
            SceneError: the scene cannot be built.
            StepError: there is no way to the pose.
        """
        if not (scene.servos and scene.effector):
            raise IkError(f"scene {scene.name!r} has no servos or no effector: there is nothing to solve for")
        wanted = np.array(WORKING_POSE[:3]) if angles is None else frozen("angles", angles, (3,))
        least, most = scene.servos.angle_min, scene.servos.angle_max
        for name, angle in zip(SERVOS, wanted.tolist(), strict=True):
            if not least <= angle <= most:
                raise IkError(f"{name} is to begin at {angle:g} rad; allowed is {least:g} to {most:g} rad")
        if not 0 <= slide <= scene.servos.slide_max:
            raise IkError(f"slide is {slide:g} m; allowed is 0 to {scene.servos.slide_max:g} m")
        solver = replace(scene.solver, tolerance=min(TOLERANCE, scene.solver.tolerance))
        self.simulation = Simulation(
            replace(scene, inertia=None, damping=None, servo_dynamics=None, ball=None, solver=solver)
        )
        self.slide = slide
        self._state: LinearState | None = None
        start, end = self.simulation.state.joints.copy(), np.append(wanted, slide)
        for part in np.linspace(0.0, 1.0, 11)[
            1:
        ]:  # angles and slide in proportion: the strips stay stretched
            self.simulation.step(start + part * (end - start))

    @property
    def angles(self) -> FloatArray:
        """Of the servos [rad], shape (s,), a copy."""
        return self.simulation.state.joints[:-1].copy()

    def move(self, angles: FloatArray) -> LinearState:
        """Bring the servos to `angles` [rad], shape (s,), and return the state there.

        Raises:
            SceneError: the angles are out of the scene's limits.
            StepError: no equilibrium on the way, or none that has a compliance; the model stays where it was.
        """
        goal = np.append(angles, self.slide)
        if not np.array_equal(goal, self.simulation.state.joints):
            before = self.simulation.save()
            try:
                self.simulation.step(goal)
                self._state = linear_state(self.simulation.compliance())
            except Exception:
                self.simulation.restore(before)
                self._state = None
                raise
        return self.state()

    def state(self) -> LinearState:
        """Return the state at the present angles; computed once for each pose."""
        if self._state is None:
            self._state = linear_state(self.simulation.compliance())
        return self._state

    def save(self) -> Saved:
        """Return what `restore` needs to come back here."""
        return self.simulation.save(), self._state

    def restore(self, saved: Saved) -> None:
        """Return to where `save` was called, without moving there: on the same branch."""
        before, self._state = saved
        self.simulation.restore(before)
