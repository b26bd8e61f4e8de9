"""Bodies that touch: one step of an implicit scheme with contact, stage by stage.

1. Contacts: what is nearer than the alarm distance and, in fast steps, what would come that near without forces: what
   forces hold comes less far than it would, and is met then by what only seemed to miss it.
2. Response: the minimum of the step's potential with these contacts, roughly at first.
3. Continuous detection over the moves found: what comes too close on the way is added and the response repeated, so
   that nothing passes through anything, at last to its tolerance. Where that does not end the step fails, and the loop
   of `integrators.substeps` halves it; the shortest substep is truncated before the hit.

A hit is a jump of the velocity, over which no scheme may look back: bodies would bounce off by what it remembers. So a
step of a multistep scheme in which something hits is one of implicit Euler, as is the next one, which has nothing to
look back on. Where moves without forces show the hit, the scheme's own stages are not even tried. What replaces a step
that failed is made of steps of implicit Euler, too.
"""

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray, IndexArray
from tripod_sim.contact import response_kernels as kernels
from tripod_sim.contact.bodies import Body
from tripod_sim.contact.contact_set import ContactSet, inherit
from tripod_sim.contact.detection import Detector
from tripod_sim.contact.hit_kernels import hits, meets
from tripod_sim.contact.impact import Impact, inverse_masses
from tripod_sim.contact.problem import DescentError, StepProblem
from tripod_sim.contact.response import Law, Outcome, Response
from tripod_sim.integrators.report import ContactReport
from tripod_sim.integrators.scheme import ImplicitScheme, Stage
from tripod_sim.integrators.schemes import implicit_euler
from tripod_sim.mesh.surfaces import Part, join

if TYPE_CHECKING:  # an effect that is absent is not imported
    from tripod_sim.contact.rigid_bodies import RigidBodies
    from tripod_sim.contact.servo_bodies import ServoBodies
    from tripod_sim.contact.solid_nodes import SolidNodes


TINY = 1e-12
"""Moves that are none [m]."""


class ContactSolver:
    """Deformable bodies, rigid bodies and fixed obstacles, and the contacts among them.

    Attributes:
        nodes: The deformable bodies; None for none.
        soft: How many surfaces these have, the first ones.
        rigid: The rigid bodies; None for none.
        kinematic: The bodies of servos; None for none.
        bodies: All of these, in this order.
        ranges: The surface vertices of each of them.
        parts: All surfaces, in the order of `bodies`, then obstacles.
        obstacles: Vertices of what never moves [m], shape (k, 3).
        positions: Of all surface vertices at the start of the step [m].
        contacts: Of the last step.
        problem: Potential of the step.
        solved: Whether the forces of the last stage are found to the tolerance.
        some_held: Whether something on the surfaces does not yield along some axis.
    """

    MOST_PASSES, MOST_RAISES = 8, 4

    PART_SPEED, SOFT_PART_SPEED = 0.05, 0.5
    """At which bodies that begin too close are parted [m/s]: they keep it, so it is hardly a bounce. It is more with
    penalty, under which they sink in to be pressed at all."""

    YIELDS = 1e-6
    """Square of the cosine between the normal and what a vertex may do, above which it yields to pressure."""

    HIT, SLOW, NOISE, CREEP = 0.05, 0.1, 4.0, 7.0
    """Way within a step, in contact distances, by which what touches may approach without hitting, unless that is
    faster than `rest_speed`, of rigid bodies than this share of it; the least such way, and that by which a rigid body
    may slip where friction has stopped it, in tolerances."""

    def __init__(
        self,
        law: Law,
        alarm: float,
        scheme: ImplicitScheme = implicit_euler.SCHEME,
        *,
        obstacles: list[Part],
        nodes: "tuple[SolidNodes, list[Part]] | None" = None,
        rigid: "tuple[RigidBodies, list[Part]] | None" = None,
        kinematic: "ServoBodies | None" = None,
    ) -> None:
        """Join the surfaces.

        Args:
            law: What contacts do.
            alarm: Distance below which contacts are made [m], larger than the contact distance.
            scheme: Of the steps; in statics any.
            obstacles: Fixed bodies.
            nodes: The deformable bodies and their surfaces, in the order of the vertices.
            rigid: The rigid bodies and their surfaces, vertices about the centre.
            kinematic: The bodies of servos.
        """
        self.law, self._slow = law, min(0.5 * alarm, alarm - law.distance)
        self.nodes, self.rigid = nodes[0] if nodes else None, rigid[0] if rigid else None
        self.kinematic, self.soft = kinematic, len(nodes[1]) if nodes else 0
        moving: list[tuple[Body, list[Part]]] = []
        if nodes:
            moving.append(nodes)
        if rigid:
            rigid[0].bound_by(rigid[1])
            moving.append(rigid)
        if kinematic:
            moving.append((kinematic, kinematic.parts))
        self.bodies = [body for body, _ in moving]
        self.parts = [part for _, own in moving for part in own] + obstacles
        self.surfaces, self.positions = join(self.parts)
        ends = np.cumsum([0, *(len(body.base) for body in self.bodies)]).tolist()
        self.ranges = [slice(*of) for of in pairwise(ends)]
        self.obstacles, n = self.positions[ends[-1] :].copy(), len(self.positions)
        base, width = np.full(n, -1, dtype=np.int64), np.full(n, 3, dtype=np.int64)
        self._arm, self._yields, at = np.zeros((n, 3)), np.zeros((n, 3), dtype=bool), 0
        for body, own in zip(self.bodies, self.ranges, strict=True):
            base[own], width[own] = np.where(body.base >= 0, body.base + at, -1), body.width
            self._yields[own] = ~body.held
            at += body.unknowns
        self._free = kernels.Freedom(base, width, self._arm, self.surfaces.radius)
        self.some_held = any(body.held.any() for body in self.bodies)
        self.contacts, self._kept = ContactSet(), ContactSet()
        self.problem = StepProblem(self.bodies, self.contacts)
        self._scheme, self._before = scheme, 0.0
        self._history: tuple[float, list[FloatArray]] = 0.0, []
        self._looks_back, self.solved = scheme.is_multistep, True
        for body in self.bodies:
            body.looked_back = self._looks_back
        self._bounded = nodes[0] if nodes and nodes[0].bound else None
        self.response = Response(
            law, self.problem, self.contacts, self._bounded, apart=rigid is not None or self.soft > 1
        )
        self._ends, self._u = self.positions.copy(), np.zeros(self.problem.unknowns)
        self._place()
        held = np.asarray(~self._yields.any(axis=1))
        self.detector = Detector(self.surfaces, self.positions, law.distance, alarm, held)
        soft = nodes[0].unknowns if nodes else 0
        self._impact = Impact(law, self.contacts, self.bodies, self.problem.slices, soft)
        self._start_rate, self._end_rate = np.zeros((2, len(self._u)))
        self._warm_up()

    def _warm_up(self) -> None:
        """Compile what is needed only when something hits, so that the first hit is no slower than others."""
        self.detector.warm_up(self.positions)
        self.response.warm_up()
        c, none = self.contacts.arrays, np.zeros_like(self._u)
        self._impact.warm_up()
        if self._looks_back:
            hits(c, 0, none, none, 0.0, 0.0, 0.0, 0.0)
            meets(c, 0, none, none, 0.0)
            kernels.set_drift(c, 0, none)

    def positions_now(self) -> FloatArray:
        """Return where all surface vertices are now [m], shape (n, 3): a view that the next step overwrites."""
        self._place()
        return self.positions

    def forget(self) -> None:
        """Drop the forces and the factorisation kept from the last step, and what the next may look back on."""
        self.contacts.count, self._before = 0, 0.0
        self.problem.forget()

    def drop_history(self) -> None:
        """Let the next step look back on nothing."""
        self._before = 0.0

    def owners(self) -> tuple[IndexArray, IndexArray]:
        """Return the node and the rigid body of each surface vertex, -1 for none, both of shape (n,)."""
        row, body = np.full((2, len(self.positions)), -1, dtype=np.int64)
        at = dict(zip(map(id, self.bodies), self.ranges, strict=True))
        if self.nodes:
            row[at[id(self.nodes)]] = self.nodes.nodes
        if self.rigid:
            body[at[id(self.rigid)]] = self.rigid.owners()
        return row, body

    def keep_history(self) -> None:
        """Remember what the next step may look back on, for `recall_history`."""
        self._history = self._before, [a.copy() for body in self.bodies for a in body.past()]

    def recall_history(self) -> None:
        """Let the next step look back on what that of `keep_history` would have; forces stay a first guess."""
        self._before, past = self._history
        if not self._before:  # it looks back on nothing
            return
        for array, kept in zip([a for body in self.bodies for a in body.past()], past, strict=True):
            array[:] = kept

    def _place(self) -> None:
        """Write `positions` of moving vertices, and their arms."""
        for body, own in zip(self.bodies, self.ranges, strict=True):
            body.place(self.positions[own], self._arm[own])

    def _ends_of(self, u: FloatArray) -> None:
        """Write where vertices are after the moves `u`."""
        for body, own, part in zip(self.bodies, self.ranges, self.problem.slices, strict=True):
            body.ends(u[part], self._ends[own])

    def forces(self) -> FloatArray:
        """Return what contacts pressed and pulled all surface vertices with in the last step [N], shape (n, 3)."""
        out = np.zeros_like(self.positions)
        kernels.spread(self.contacts.arrays, self.contacts.count, out)
        return out

    def _drop_held(self) -> None:
        """Leave out contacts of which neither side yields along the normal."""
        c, count = self.contacts.arrays, self.contacts.count
        along = (c.normal[:count, None] ** 2 * self._yields[c.vertex[:count]]).sum(axis=2)
        yields = ((c.weight[:count] != 0.0) & (along > self.YIELDS)).any(axis=1)
        left = int(yields.sum())
        if left < count:
            for array in c:
                array[:left] = array[:count][yields]
            self.contacts.count = left

    def step(self, h: float, report: ContactReport, *, truncates: bool = False) -> bool:
        """Advance all bodies by `h` [s], by the scheme's own stages if these may look back, else by implicit Euler.

        Args:
            h: Length of the step [s].
            report: What it takes is added to this.
            truncates: Whether the moves end before something would pass through something else; else that fails.

        Returns:
            Whether it is done; if not, the scheme's own stages are not smooth, and the step is to be made again.

        Raises:
            DescentError: something would pass through, or the forces are not found.
        """
        report.meets = np.inf
        if not self._before:
            smooth = self._begin_anew(h, report, truncates=truncates)
        else:
            smooth = self._look_back(h, report)
            if not smooth:
                self._before = 0.0
                return False
        self._before = h if smooth else 0.0
        self._tell(report)
        return True

    def creep(self, stage: Stage, report: ContactReport) -> float:
        """Make a stage from rest to rest; return what it leaves to inertia [N], infinite where something would pass.

        Raises DescentError.
        """
        u = self._u
        self._begin(stage, stage.s)
        if self._respond(u, stage, report) < 1.0:
            return np.inf
        inverse = inverse_masses(self.bodies, self.problem.slices)
        give = np.diagonal(inverse, axis1=1, axis2=2).ravel()
        moved = give > 0.0
        self._finish(u)
        for body in self.bodies:
            body.stop()
        report.parts += 1
        self._tell(report)
        return float(np.linalg.norm(u[moved] / give[moved])) / stage.s**2

    def _tell(self, report: ContactReport) -> None:
        """Write the present contacts to `report`."""
        c = self.contacts
        pressure = c.arrays.pressure[: c.count]
        report.contacts, report.pressed = c.count, int((pressure > 0).sum())
        report.force = float(pressure.sum())

    def _look_back(self, h: float, report: ContactReport) -> bool:
        """Advance by the scheme's own stages; return False, the bodies in between, where that is not smooth."""
        u = self._u
        try:
            for stage in self._scheme.stages(h, self._before):
                if self._begin(stage, h) < 1.0 or self._respond(u, stage, report) < 1.0 or self._hits(u, h):
                    return False
                self._finish(u)
        except DescentError:
            return False
        report.parts += 1
        return True

    def _begin_anew(self, h: float, report: ContactReport, *, truncates: bool) -> bool:
        """Advance by implicit Euler; return whether the scheme may look back on that."""
        u, stage = self._u, self._scheme.start(h)
        report.restarted = self._looks_back
        report.meets = self._begin(stage, h)
        share = self._respond(u, stage, report, patient=truncates)
        if share < 1.0:
            if not truncates:
                raise DescentError(
                    f"after {max(share, 0.0):.0%} of it something would pass through something else"
                )
            self._truncate(u, share)
            report.cut = max(report.cut, 1.0 - share)
        report.parts += 1
        smooth = self._looks_back and share >= 1.0 and not self._hits(u, h)
        rebounds = self._impact.begins(u, h, self.NOISE * self.law.tolerance * self.law.distance / h)
        self._finish(u)
        if rebounds:
            self._rebound(report, h)
        return smooth and not rebounds

    def _begin(self, stage: Stage, h: float) -> float:
        """Write the moves of a stage without forces to `_u`, and what they touch to `contacts`.

        Return the share of them after which something hits that a scheme may not look back on in a step of `h` [s];
        infinite for none, and where no scheme looks back.
        """
        u, c = self._u, self.contacts
        self._place()
        self.problem.begin(stage, u)
        self._detect(u)
        self._prepare(stage)
        if not self._looks_back:
            return np.inf
        for body, part in zip(self.bodies, self.problem.slices, strict=True):
            body.rate_at_start(self._start_rate[part])
        return float(meets(c.arrays, c.count, self._start_rate, u, self._slowest(h)))

    def _prepare(self, stage: Stage) -> None:
        """Write what the contacts of a stage are made of."""
        c = self.contacts
        if self.some_held:
            self._drop_held()
        speed = self.SOFT_PART_SPEED if self.law.response == "penalty" else self.PART_SPEED
        kernels.prepare(c.arrays, c.count, self.positions, self._free, speed * max(stage.length, stage.s))
        if c.count and not stage.begins:
            kernels.set_drift(c.arrays, c.count, self._u - stage.s * self._rates_at_end(self._u))
        self.problem.renew()

    def _hits(self, u: FloatArray, h: float) -> bool:
        """Return whether a scheme may not look back on the moves `u` in a step of `h` [s], of a stage that was begun.

        Something hits; or the forces are not found; or a bound of strains pulls, or a spring of penalty presses, which
        have no damping but that of implicit Euler.
        """
        if not self.solved or any(body.taut() for body in self.bodies):
            return True
        c, law = self.contacts, self.law
        if not (c.arrays.pressure[: c.count] > 0.0).any():
            return False
        if law.response == "penalty":
            return True
        self._rates_at_end(u)
        slowest, least = self._slowest(h), law.tolerance * law.distance / h
        slow = min(slowest, max(self.SLOW * law.rest_speed, self.NOISE * least))
        creep = min(slow, self.CREEP * least)
        rates = self._start_rate, self._end_rate
        return bool(hits(c.arrays, c.count, *rates, slowest, slow, creep, law.friction))

    def _rates_at_end(self, u: FloatArray) -> FloatArray:
        """Write the velocities of the unknowns after the moves `u` to `_end_rate`, and return it."""
        for body, part in zip(self.bodies, self.problem.slices, strict=True):
            body.rate_at_end(u[part], self._end_rate[part])
        return self._end_rate

    def _slowest(self, h: float) -> float:
        """Return the speed [m/s] above which what meets in a step of `h` [s] hits."""
        law = self.law
        slowest = min(law.rest_speed, self.HIT * law.distance / h)
        return max(slowest, self.NOISE * law.tolerance * law.distance / h)

    def _detect(self, u: FloatArray) -> None:
        """Fill `contacts` for a step that without forces makes the moves `u`."""
        c, kept = self.contacts, self._kept
        c.arrays, kept.arrays = kept.arrays, c.arrays
        kept.count, c.count = c.count, 0
        self.detector.near(self.positions, c, kept)
        self._ends_of(u)
        if float(np.abs(self._ends - self.positions).max(initial=0.0)) > self._slow:
            self.detector.met(self.positions, self._ends, c, share=self.detector.alarm / self.law.distance)
        inherit(kept.arrays, kept.count, c.arrays, c.count)

    def _respond(self, u: FloatArray, stage: Stage, report: ContactReport, *, patient: bool = False) -> float:
        """Let forces change the moves `u`; return 1, or the fraction of them until which nothing is passed.

        Unless `patient`, forces that are far off are not sought again: a shorter step finds them sooner.
        """
        c, share, rough = self.contacts, 0.0, True
        for number in range(self.MOST_PASSES):
            if number and share < 1.0:
                self._prepare(stage)
            outcome = self._solve(u, report, rough=rough)
            self._ends_of(u)
            before = c.count
            share = self.detector.met(self.positions, self._ends, c, take_all=number > 2)
            if share >= 1.0:
                if outcome.done:
                    return 1.0
                rough = False  # when it is clear what touches, the forces are worth being found exactly
                continue
            if not (rough or patient) and outcome.smallest < -self.law.distance:
                return share  # not solved: once more would not help, a shorter step does
            report.met += c.count - before
        return share

    def _solve(self, u: FloatArray, report: ContactReport, *, rough: bool) -> Outcome:
        """Move `u` to the minimum with the present contacts, and within the bound of strains if there is one."""
        bounded, why = self._bounded, ""
        for _ in range(1 + self.MOST_RAISES):
            try:
                outcome = self.response.solve(u, rough=rough)
            except DescentError as error:
                if not (bounded and bounded.exceeds(u[: bounded.unknowns])):
                    raise
                why = str(error)
                break
            report.passes += 1
            report.rounds += outcome.rounds
            report.way = outcome.way
            report.residual, report.smallest_gap = outcome.residual, outcome.smallest
            self.solved = outcome.solved
            if not (bounded and outcome.done and bounded.exceeds(u[: bounded.unknowns])):
                return outcome
            why = f"gaps, slips or lengths are still {outcome.residual:.2g} m off; take a smaller dt"
            bounded.tighten()  # what hangs on the body may be far heavier than its nodes
            self.problem.renew()
        if bounded:
            bounded.forget()
        raise DescentError(f"strain_limit cannot be kept: {why}; set a larger one, or hold fewer nodes")

    def _truncate(self, u: FloatArray, share: float) -> None:
        """Shorten the moves `u` until nothing is passed. Raises DescentError where that is not due to these."""
        scale = 0.9 * share
        while True:
            u *= scale
            self._ends_of(u)
            share = self.detector.met(self.positions, self._ends, self._kept)
            if share >= 1.0:
                return
            if not np.abs(u).max(initial=0.0) > TINY:
                raise DescentError(
                    "what is held or driven goes through something that cannot give way; move one of the two, or "
                    "slow the motion down"
                )
            scale = 0.9 * share if share > 1e-3 else 0.0

    def _finish(self, u: FloatArray) -> None:
        """Let the bodies make the moves `u`."""
        for body, part in zip(self.bodies, self.problem.slices, strict=True):
            body.finish(u[part])

    def _rebound(self, report: ContactReport, h: float) -> None:
        """Give the bodies, at the end of a step of `h` [s], the velocities after the impact."""
        c, impact = self.contacts, self._impact
        self._place()
        kernels.prepare(c.arrays, c.count, self.positions, self._free, np.inf)
        impact.solve()
        report.lowered = max(report.lowered, impact.lowered)
        report.residual = max(report.residual, impact.residual * h)
