"""Catch and throw on the simulated robot: keys, set-points, the followers' slew rate, soft body and ball together."""

import numpy as np
import pytest

from tripod_graph.command import CommandFollower, CommandLimits
from tripod_graph.names import SERVOS, SLIDE
from tripod_sim import Simulation, load_scene
from tripod_teleop.drive import Drive
from tripod_teleop.keys import KEYS
from tripod_teleop.operate import Operator

EVERY = 10
"""Steps between two set-points, as the node sends them."""
AHEAD = 0.01
"""Time that the node gives the followers for a jump [s]."""


class Player:
    """A scene under the keys; heights are those of the ball's centre above the effector's."""

    def __init__(self, speed: float) -> None:
        """`speed`: slew rate of the servos [rad/s]."""
        limits = CommandLimits(angle_speed=speed)
        self.simulation = Simulation(load_scene("tripod_ball", ["mesh.level=1"]))
        self.follower = CommandFollower(limits)
        drive = Drive(limits, speed=0.5, hold=0.2, pose_time=3.0)
        self.operator = Operator("teleop", drive)
        self.step = 0

    def press(self, key: str, seconds: float) -> tuple[float, float]:
        """Press a key and play; return the largest and the last height of the ball [m]."""
        s, heights = self.simulation, []
        dt = s.scene.dt
        self.operator.act(KEYS[key], tuple(self.follower.joints), 1.0 + self.step * dt, self.step * dt)
        for k in range(round(seconds / dt)):
            now = self.step * dt
            if k % EVERY == 0:
                joints = self.operator.setpoint(tuple(self.follower.joints), now)
                if joints is not None:
                    time = AHEAD if self.operator.drive.at_once else EVERY * dt
                    self.follower.accept([*SERVOS, SLIDE], [time], [joints], now)
            s.step(self.follower.setpoint(now))
            self.step += 1
            assert s.ball
            assert s.effector
            heights.append(s.ball.position[2] - s.effector.position[2])
        return max(heights), heights[-1]


@pytest.mark.parametrize(("speed", "least"), [(4.0, 0.001), (10.5, 0.03)])
def test_after_the_working_pose_z_throws_the_ball_and_it_is_caught_again(speed: float, least: float) -> None:
    """With the command's default slew rate, and with the speed of an SG90."""
    player = Player(speed)
    player.press("t", 0.5)
    _, seat = player.press("a", 4.0)
    for key in ("Q", "z", "Q", "z"):
        highest, last = player.press(key, 1.2)
        if key == "z":
            assert highest > seat + least
        assert last == pytest.approx(seat, abs=5e-5)
        rigid, contact = player.simulation.state.rigid, player.simulation.report.contact
        assert rigid
        assert contact
        assert np.linalg.norm(rigid.velocities[0]) < 1e-3
        assert np.linalg.norm(rigid.centres[0, :2]) < 5e-4
        assert contact.smallest_gap > -1e-6
    angle = {"Q": -np.pi / 3, "z": -np.pi / 4}
    assert player.follower.joints == pytest.approx([angle["z"]] * 3 + [0.035])
    assert player.simulation.ball_event == ""


def test_without_the_slide_the_default_slew_rate_lifts_the_ball_but_does_not_throw_it() -> None:
    player = Player(4.0)
    _, seat = player.press("t", 1.0)
    assert player.press("Q", 1.2)[1] == pytest.approx(seat, abs=5e-5)
    low = player.simulation.ball.position[2]
    highest, last = player.press("z", 1.2)
    assert highest < seat + 5e-5
    assert last == pytest.approx(seat, abs=5e-5)
    assert player.simulation.ball.position[2] > low + 0.003
