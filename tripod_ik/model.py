"""The robot's own model: the quasi-static simulation, asked for its linearised response at given angles.

Pure: no ROS. It stands in where no simulator is in the graph, and answers the command line.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tripod_graph.names import WORKING_ANGLE, WORKING_SLIDE, servo_names
from tripod_host.arrays import FloatArray
from tripod_ik.arrays import frozen
from tripod_ik.errors import IkError
from tripod_ik.snap_through import longest_step
from tripod_ik.solvable import nothing_to_solve
from tripod_ik.state import LinearState
from tripod_ik.symmetry import Image, images
from tripod_sim.compliance import Compliance
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene, at_rest
from tripod_sim.simulation import Simulation
from tripod_sim.state import State
from tripod_sim.tables.joints import Joints
from tripod_sim.tables.short_forms import joints_of

Saved = tuple[tuple[State, FloatArray], LinearState | None, Image]
"""What `StaticModel.save` gives and `restore` takes."""

TOLERANCE = 1e-7
"""Unbalanced force [N] of the model's equilibria: with 10 mm/N that is a nanometre."""

ITERATIONS = 100
"""Linear solves after which one for an equilibrium is given up, and the move halved. With slack strips some take 60 to
100; most that would go on find none near, and go on for hundreds in every part of the move."""

SAME = 1e-6
"""Positions of the effector that differ by less [m] belong to one equilibrium; two are millimetres apart."""

ASIDE = (0.1, -0.2, 0.15)
"""Turns of the servos from home [rad], in this order again and again, at which images of a pose are compared."""

SHORTEST = 1e-3
"""Part of a way [rad] below which an end of the equilibria is no longer looked for, by default."""

MISSED, PART = 1e-4, 0.05
"""A move that differs by more than MISSED [m] and that part of its length from what the Jacobians at both ends say, was
no smooth one."""


def goes_on(before: LinearState, after: LinearState, least_margin: float = 0.0) -> bool:
    """Return whether two states belong to one family of equilibria, as far as their Jacobians tell, none of which on
    the straight way between them is less firm than `least_margin`.
    """
    move = np.linalg.norm(after.equilibrium - before.equilibrium)
    smooth = after.stability_margin > 0 and foretold_miss(before, after) <= MISSED + PART * move
    return bool(smooth and softest_between(before, after) >= least_margin)


def foretold_miss(before: LinearState, after: LinearState) -> float:
    """Return how far the effector's move from one state to another is from what the Jacobians at both ends say [m]."""
    move, turn = after.equilibrium - before.equilibrium, after.angles - before.angles
    return float(np.linalg.norm(move - 0.5 * (before.jacobian[:3] + after.jacobian[:3]) @ turn))


def softest_between(before: LinearState, after: LinearState) -> float:
    """Return the least stability margin on the straight way between two states, as their stability margin and its
    slopes foretell.

    ρ |ρ| is what goes to zero in proportion to the angles: where it falls towards the other state from both, it is
    least where the two straight lines meet.
    """
    turn = after.angles - before.angles
    (a, fall), (b, rise) = (
        (
            s.stability_margin * abs(s.stability_margin),
            2 * abs(s.stability_margin) * float(s.stability_margin_slope @ turn),
        )
        for s in (before, after)
    )
    least = min(a, b)
    if fall < 0 < rise:
        t = (b - rise - a) / (fall - rise)
        if 0 < t < 1:
            least = min(least, a + t * fall)
    return float(np.sign(least) * np.sqrt(abs(least)))


def linear_state(c: Compliance, joints: Joints | None = None) -> LinearState:
    """Return the compliance of a simulation as inverse kinematics takes it; raise IkError if it cannot be used.

    `joints`: those of its scene, where some of them may be no servos. No stability margin is known of these.
    """
    if joints and joints.others:
        return LinearState.of_actuators(
            joints.actuators, commands=c.angles, efforts=c.efforts, effector=c.position, rotation=c.quaternion,
            equilibrium_offset=c.equilibrium_offset, W=c.w, jacobian=c.jacobian, stiffness=c.stiffness, places=c.places,
        )  # fmt: skip
    soft = c.stability_margin
    return LinearState(
        servo_names(len(c.angles)), c.angles, c.efforts, c.position, c.quaternion, c.equilibrium_offset, c.w,
        soft.value if soft else 1.0, soft.slope if soft else np.zeros(0), places=c.places,
    )  # fmt: skip


def home_angles(count: int, slide: float) -> FloatArray:
    """Return the angles [rad] at which the strips are stretched with a slide [m], shape (count,).

    They are in proportion between the flat piece, not slid in, and the working pose.
    """
    return np.full(count, WORKING_ANGLE * slide / WORKING_SLIDE)


class StaticModel:
    """A robot at rest: each set of angles has an equilibrium, reached along the way from the one before.

    Its commands are those of `state`: angles, and spans of other actuators. With these no stability margin is known,
    and moves are not followed along the equilibria.

    Attributes:
        spans: Commands in SI over those of the model, shape (s,).
        simulation: Of the scene without what moves by itself: inertia, damping, servo dynamics, ball, other bodies.
        slide: Inward shift of the servo bodies [m].
        scene: What it was built from.
        linearisations: How many states it has computed.
    """

    def __init__(self, scene: Scene, slide: float = WORKING_SLIDE, angles: FloatArray | None = None) -> None:
        """Build the model and bring it to `angles` [rad], shape (s,).

        None means the pose of that slide, see `home_angles`, or with other actuators that of the start; of a robot that
        begins with that slide, or does not slide, the pose in which it begins where the body is firmer there.

        A slide is one of servos: without any that slide it does not count.

        Raises:
            IkError: the scene has no servos or no effector, or the pose is out of its limits.
            SceneError: the scene cannot be built.
            StepError: there is no way to the pose.
        """
        joints, reason = joints_of(scene), nothing_to_solve(scene)
        if reason or not joints:
            raise IkError(reason)
        count = joints.count
        self.spans = joints.spans
        near = np.clip(
            joints.start[:-1] / self.spans if joints.others else home_angles(count, slide),
            joints.low / self.spans,
            joints.high / self.spans,
        )
        wanted = near if angles is None else frozen("angles", angles, (count,))
        for a, value in zip(joints.actuators, (wanted * self.spans).tolist(), strict=True):
            slack = 0.0 if a.unit == "rad" else 1e-9 * (a.high - a.low)
            if not a.low - slack <= value <= a.high + slack:
                raise IkError(
                    f"{a.name} would start at {value:g} {a.unit}; allowed: {a.low:g} to {a.high:g} {a.unit}"
                )
        if not joints.slides:
            slide = joints.slide
        if not 0 <= slide <= joints.slide_max:
            raise IkError(f"slide is {slide:g} m; allowed: 0 to {joints.slide_max:g} m")
        s = scene.solver
        solver = replace(
            s, tolerance=min(TOLERANCE, s.tolerance), max_iterations=min(ITERATIONS, s.max_iterations)
        )
        self.simulation = Simulation(replace(at_rest(scene), solver=solver))
        self.slide, self.scene, self.linearisations = slide, scene, 0
        self._state: LinearState | None = None
        self._image = images(count, mirrored=False)[0]
        self._joints = joints
        start, end = self.simulation.command, np.append(wanted * self.spans, slide)
        slides = slide != joints.slide and joints.slides
        own = None if slides or angles is not None else (self.state().stability_margin, self.save())
        for part in np.linspace(0.0, 1.0, 11)[
            1:
        ]:  # angles and slide in proportion: the strips stay stretched
            self.simulation.step(start + part * (end - start))
        self._state = None
        if own and own[0] > self.state().stability_margin:
            self.restore(own[1])
        self._home = self.save()

    @property
    def angles(self) -> FloatArray:
        """Of the servos [rad], shape (s,), a copy."""
        return np.asarray((self.simulation.command[:-1] / self.spans)[self._image.servos])

    def move(self, angles: FloatArray) -> LinearState:
        """Bring the servos to `angles` [rad], shape (s,), and return the state there.

        Raises:
            IkError: `angles` has another shape or is not finite.
            SceneError: the angles are out of the scene's limits.
            StepError: no equilibrium on the way, or none that has a compliance; the model stays where it was.
        """
        goal = np.append(self._image.back(self._angles(angles)) * self.spans, self.slide)
        if not np.array_equal(goal, self.simulation.command):
            before = self.simulation.save()
            try:
                self.simulation.step(goal)
                self._state = self._linearised()
            except Exception:
                self.simulation.restore(before)
                self._state = None
                raise
        return self.state()

    def _angles(self, angles: FloatArray) -> FloatArray:
        """Return a copy of `angles`. Raises IkError: another shape, or not finite."""
        return frozen("angles", angles, (len(self.simulation.efforts),))

    def follow(
        self,
        angles: FloatArray,
        *,
        least_margin: float = 0.0,
        shortest: float = SHORTEST,
        longest: float = np.inf,
        passed: list[LinearState] | None = None,
    ) -> LinearState:
        """Bring the servos to `angles` as `move` does, but only along the present equilibria, in parts where need be.

        Args:
            angles: [rad], shape (s,).
            least_margin: Stability margin that no pose on the way may be below; parts are then no longer than what
                stability margin and its slope foretell is to be trusted.
            shortest: Part of the way [rad] below which an end of the equilibria is no longer looked for.
            longest: Part of the way [rad] to go at once, at most: from one side of a snap to the other all may look
                smooth.
            passed: States on the way are put here, the last one with them.

        Raises:
            IkError: `angles` has another shape or is not finite.
            SceneError: the angles are out of the scene's limits.
            StepError: the equilibria end on the way: the body would snap. The model stays where it was.
        """
        if self._joints.others:
            state = self.move(angles)
            if passed is not None:
                passed.append(state)
            return state
        begin, start, angles = self.save(), self.angles, self._angles(angles)
        whole, done = angles - start, 0.0
        far = float(np.abs(whole).max())
        most = 1.0 / np.ceil(max(far / longest, 1.0))
        part = most
        while done < 1.0:
            here, before = self.save(), self.state()
            if least_margin > 0 and far > 0:
                part = min(part, max(longest_step(before), shortest) / far)
            end = 1.0 if done + part > 1.0 - 1e-9 else done + part
            try:
                after = self.move(angles if end == 1.0 else start + end * whole)
                if goes_on(before, after, least_margin):
                    done, part = end, min(most, 2 * part)
                    if passed is not None:
                        passed.append(after)
                    continue
                soft = after.stability_margin < least_margin and goes_on(
                    before, after
                )  # and so it is in shorter parts
            except StepError:
                soft = False
            self.restore(here)
            part = (end - done) / 2
            if soft or part * far < shortest:
                self.restore(begin)
                raise StepError(
                    "the body has no equilibrium on the way there: it would snap (jump to another shape); take "
                    "smaller moves"
                )
        return self.state()

    def state(self) -> LinearState:
        """Return the state at the present angles; computed once for each pose."""
        if self._state is None:
            self._state = self._linearised()
        return self._state

    def _linearised(self) -> LinearState:
        self.linearisations += 1
        return self._image.state(linear_state(self.simulation.compliance(), self._joints))

    def shown(self, vector: Sequence[float]) -> FloatArray:
        """Return a vector of what is simulated, shape (3,), as the pose has it, which may be an image of that."""
        return np.asarray(self._image.matrix @ vector)

    @property
    def home(self) -> FloatArray:
        """Angles that the model was built at [rad], shape (s,)."""
        return np.asarray(self._home[0][0].joints[: len(self.simulation.efforts)] / self.spans)

    def go_home(self) -> LinearState:
        """Return to the pose that the model was built in, without moving there, and return the state."""
        self.restore(self._home)
        return self.state()

    def settle(self) -> bool:
        """Go to the equilibrium that the straight way from the pose of the beginning leads to; return whether it is
        another one.

        Where a strip hangs slack the body has two equilibria at the same angles, and which one it is in depends on its
        way. This one depends on the angles alone. With other actuators than servos that is not looked for.
        """
        if self._joints.others:
            return False
        here, state = self.save(), self.state()
        self.go_home()
        try:
            settled = self.move(state.angles)
        except (SceneError, StepError):
            self.restore(here)
            return False
        if np.abs(settled.equilibrium - state.equilibrium).max() > SAME:
            return True
        self.restore(here)
        return False

    def save(self) -> Saved:
        """Return what `restore` needs to come back here."""
        return self.simulation.save(), self._state, self._image

    def restore(self, saved: Saved) -> None:
        """Return to where `save` was called, without moving there: on the same branch."""
        before, self._state, self._image = saved
        self.simulation.restore(before)

    def symmetries(self) -> list[Image]:
        """Return the images that the robot, at its home and about it, is of itself; the pose itself first.

        They are looked for, not known: servos may be anywhere, and the body need not be the same in all directions. Of
        other actuators there are none.
        """
        here, home = self.save(), self.go_home()
        n = len(home.angles)
        if self._joints.others or home.places:
            self.restore(here)
            return images(n, mirrored=False)[:1]
        turn = np.resize(ASIDE, n)
        found = [images(n, mirrored=False)[0]]
        for mirrored in (True, False):
            group = images(n, mirrored=mirrored)
            generators = (group[1 % n], *group[n : n + 1])
            if all(self._is_image(home.angles, home.angles + turn, image) for image in generators):
                found = group
                break
        self.restore(here)
        return found

    def _is_image(self, home: FloatArray, angles: FloatArray, image: Image) -> bool:
        """Return whether the robot's pose at the image of `angles` is the image of that there."""
        if np.ptp(home) > 0:
            return False
        found = []
        for there in (angles, angles[image.servos]):
            self.go_home()
            try:
                found.append(self.move(there))
            except (SceneError, StepError):
                return False
        away = found[1].equilibrium - image.matrix @ found[0].equilibrium
        return bool(np.abs(away).max() < SAME)


def image_of(saved: Saved, image: Image) -> Saved:
    """Return what brings a model to the image of where it was saved; it goes on there as the image of itself."""
    before, state, first = saved
    return before, image.state(state) if state else None, image.of(first)
