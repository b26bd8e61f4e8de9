"""Small hobby servos (S90 class): limited speed, pulses at 50 Hz, a dead band, a stall torque.

A servo holds a pulse p [rad], the command as it was when the last pulse came. Outside its dead band, |p - angle| > d,
it turns towards p, s = sign(p - angle), on the torque-speed line of a motor at constant voltage [Condit2004],

    u = u0 (1 - L / T),   0 <= u <= u0,   L = s torque,

u0 the no-load speed, T the stall torque, L the load: what the servo exerts on the body in the direction in which it
turns. Inside the dead band the motor is off, so a move ends at the band's edge. The gear holds: no load turns a servo
back, and none drives it faster than u0. A servo whose load has reached the stall torque stands still, short of its
command.

The load is the constraint reaction of the last step. Taken as it is, that couples speed and load explicitly: where
the body answers with k angle + C speed (k [N m / rad] its stiffness, C [N m s] its damping and inertia), speeds
alternate and grow once C u0 / T > 1, which stiff damping alone reaches. Therefore the load at the end of a step of h is
foreseen:

    L' = L + k h u + C (u - u_last),   so   u = (u0 - (u0 / T) (L - C u_last)) / (1 + (k h + C) u0 / T).

k and C are measured when the simulation is built, by turning each servo a little, in the undeformed body and in the
start pose, the larger of the two (of flat, bent and working pose the flat one is the stiffest). In a pose where they
are r times as large, the recurrence of angle and speed has trace 1 - a - b and determinant -a, with a = (r - 1) C q,
b = r k h q and q = (u0 / T) / (1 + (k h + C) u0 / T). It is stable where |a| < 1, b > 0 and 2 a + b < 2: for all r up
to 2, whatever h, k and C. What is foreseen changes the path of a move by O(h), and where a servo stalls not at all.
"""

from dataclasses import dataclass

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.copying import Copyable
from tripod_sim.tables.robot import ServoDynamics

NEARLY = 0.98
"""Share of the stall torque from which a servo counts as stalled: it then has 2 % of its speed left."""


@dataclass(frozen=True)
class Stall:
    """A servo that its load keeps from moving or, beyond the stall torque, only the gear holds.

    Attributes:
        servo: Its number.
        load: Torque that it would have to overcome [N m].
        stall_torque: That it has [N m].
        short: How far its angle is from its pulse [rad]; in the dead band where only the gear holds.
    """

    servo: int
    load: float
    stall_torque: float
    short: float

    def __str__(self) -> str:
        return (
            f"servo_{self.servo} is stalled: the load of {self.load:.3f} N m reaches its stall torque of "
            f"{self.stall_torque:.3f} N m, and it stays {abs(self.short):.3f} rad from its command; "
            "reduce the load or the angle"
        )


@dataclass(eq=False)
class ServoState(Copyable):
    """What servos remember; their angles are joints of the `State`.

    Attributes:
        command: Angles last asked for [rad], shape (s,).
        pulse: Angles of the last pulse [rad], shape (s,).
        speed: Over the last step [rad/s], shape (s,).
        clock: Time since the last pulse [s].
    """

    command: FloatArray
    pulse: FloatArray
    speed: FloatArray
    clock: float


class ServoMotion:
    """Where the servos of one scene turn in a step.

    Attributes:
        stiffness: k of the module's equation [N m / rad], shape (s,); 0 until measured.
        drag: C of the module's equation [N m s], shape (s,); 0 until measured.
    """

    def __init__(self, dynamics: ServoDynamics, count: int) -> None:
        self.dynamics = dynamics
        self.stiffness, self.drag = np.zeros(count), np.zeros(count)

    def start(self, angles: FloatArray) -> ServoState:
        """Return the state of servos at rest at `angles` [rad], shape (s,), the first pulse due at once."""
        return ServoState(angles.copy(), angles.copy(), np.zeros_like(angles), self.dynamics.refresh)

    def advance(
        self, servos: ServoState, angles: FloatArray, command: FloatArray, torques: FloatArray, h: float
    ) -> FloatArray:
        """Return the angles [rad] after a step, shape (s,); `servos` becomes the state after it.

        Args:
            servos: State at the start of the step, changed in place.
            angles: At the start of the step [rad], shape (s,).
            command: Angles asked for during the step [rad], shape (s,); every pulse in it carries them.
            torques: That the servos exert on the body, of the last step [N m], shape (s,).
            h: The step [s].
        """
        d = self.dynamics
        turned = angles.tolist()
        asked, pulse, last = command.tolist(), servos.pulse.tolist(), servos.speed.tolist()
        loads, drag = torques.tolist(), self.drag.tolist()
        line = d.speed / d.stall_torque
        damping = (1 + line * (self.stiffness * h + self.drag)).tolist()
        left, clock = h, servos.clock
        while left > 0:
            if clock >= d.refresh * (1 - 1e-9):  # sums of steps miss the period by rounding
                clock, pulse = max(clock - d.refresh, 0.0), asked
            part = min(left, d.refresh - clock)
            left = 0.0 if part > left * (1 - 1e-9) else left - part
            clock += part
            for i, target in enumerate(pulse):
                way = abs(target - turned[i]) - d.dead_band
                if way <= 0:
                    continue
                s = 1.0 if target > turned[i] else -1.0
                u = (d.speed - line * s * (loads[i] - drag[i] * last[i])) / damping[i]
                turned[i] += s * min(min(max(u, 0.0), d.speed) * part, way)
        after = np.array(turned)
        servos.command[:], servos.pulse[:], servos.clock = asked, pulse, clock
        servos.speed[:] = (after - angles) / h
        return after

    def stalled(self, servos: ServoState, angles: FloatArray, torques: FloatArray) -> tuple[Stall, ...]:
        """Return the servos that stand against a load, at `angles` [rad] and `torques` [N m], both of shape (s,)."""
        found, d = [], self.dynamics
        for i, (pulse, angle, torque) in enumerate(
            zip(servos.pulse.tolist(), angles.tolist(), torques.tolist(), strict=True)
        ):
            short = pulse - angle
            turning = abs(short) > d.dead_band * (1 + 1e-9)
            load = (torque if short > 0 else -torque) if turning else abs(torque)
            if load >= d.stall_torque * (NEARLY if turning else 1.0):
                found.append(Stall(i, load, d.stall_torque, short))
        return tuple(found)
