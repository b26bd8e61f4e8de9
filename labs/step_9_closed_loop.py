# %% [markdown]
# # Step 9: the closed loop
#
# The robot is never like its model: the silicone is stiffer, a servo horn sits a tooth further. A sensor on the
# disc sees the difference.

# %%
from collections import deque

import matplotlib.pyplot as plt
import numpy as np
from show import cost, timed

from tripod_ik.errors import IkError
from tripod_ik.feedback import ModelError
from tripod_ik.model import StaticModel
from tripod_ik.rotation import normal_of, tilt_between
from tripod_ik.tracker import Tracker
from tripod_ik.tracker_settings import Goal, TrackerSettings
from tripod_sim import load_scene

DT = 0.02  # between two commands [s]
WORKING = np.full(3, -1.4965)
OFF = np.radians([2.0, -2.0, 2.0])  # of the servo horns
TILT = normal_of(0.1, -0.08)  # where the disc shall look


def follow(
    correction: ModelError | None,
    *,
    late: float = 0.04,
    wrong: float = 0.0,
    young: float = 275e3,
    seconds: float = 2.0,
    words: tuple[str, ...] = ("mesh.element=h8_modes", "mesh.level=1"),
) -> np.ndarray:
    """Ask for a tilt after 0.1 s; return the error of the tilt at each command [rad].

    Args:
        correction: Learns from the sensor; None: open loop.
        late: Delay of the sensor [s].
        wrong: By how much the sensor is turned about the vertical on the disc [rad].
        young: Of the robot's silicone [Pa]; the model believes 250 kPa.
        seconds: How long to follow [s].
        words: The model's scene; the robot's is a fine one of the same kind.
    """
    model = StaticModel(load_scene("tripod", list(words)))
    robot = StaticModel(load_scene("tripod", ["mesh.level=2", f"material.young={young}"]))
    tracker = Tracker(TrackerSettings(goal=Goal.ORIENTATION), correction=correction)
    height = model.state().equilibrium[2]
    seen = deque(maxlen=round(late / DT) + 1)
    turn = np.array([[np.cos(wrong), -np.sin(wrong), 0], [np.sin(wrong), np.cos(wrong), 0], [0, 0, 1]])
    command, errors = WORKING, []
    for k in range(round(seconds / DT)):
        normal = robot.move(command + OFF).equilibrium_rotation[:, 2]
        errors.append(np.linalg.norm(tilt_between(normal, TILT)))
        seen.append(turn @ normal)
        if correction:
            correction.measure(None, seen[0], k * DT)
        if k == 5:
            tracker.aim(np.array([0, 0, height]), TILT, k * DT)
        command = tracker.update(model.move(command), k * DT).result.command
    return np.array(errors)


def draw(curves: dict[str, np.ndarray]) -> None:
    """Draw errors over time."""
    plt.figure(figsize=(6, 3))
    for name, errors in curves.items():
        plt.semilogy(DT * np.arange(len(errors)), np.degrees(errors), label=name)
    plt.gca().set(xlabel="time [s]", ylabel="error of the tilt [degrees]")
    plt.legend(fontsize=8)
    plt.show()


draw({"open loop": follow(None), "with the sensor": follow(ModelError(time=0.4))})

# %% [markdown]
# In the open loop the error stays. With the sensor, the program learns how far the robot is from its model, and
# takes that off the target. It is the integral part of a controller.
#
# ## What does accuracy cost?
#
# A better model is slower. A sensor corrects a bad one. **Question: with the sensor, does the better model still
# pay?**

# %%
points = {"open loop": [], "with the sensor": []}
for words in (
    ("mesh.element=t4", "mesh.level=5"),
    ("mesh.element=h8_modes", "mesh.level=1"),
    ("mesh.element=h8_modes", "mesh.level=2"),
    ("mesh.element=h20", "mesh.level=1"),
):
    for name, series in points.items():
        correction = ModelError(time=0.4) if name == "with the sensor" else None
        seconds, errors = timed(lambda c=correction, w=words: follow(c, words=w))
        label = " ".join(word.partition("=")[2] for word in words)
        series.append((label, seconds, np.degrees(errors[-1])))
cost(points, "error of the tilt after 2 s [degrees]")
plt.show()

# %% [markdown]
# At rest the sensor makes up for any of these models. In motion the model still leads: until the sensor has spoken,
# there is nothing else.
#
# ## Break it
#
# Learn too fast, from a sensor that is later than you were told:

# %%
draw(
    {
        "learns in 0.4 s, sensor 0.04 s late": follow(ModelError(time=0.4, delay=0.03)),
        "learns in 0.05 s, sensor 0.3 s late": follow(ModelError(time=0.05, delay=0.03), late=0.3),
    }
)

# %% [markdown]
# It corrects again and again what it has corrected long ago. And a sensor that gives no direction at all:

# %%
try:
    ModelError().measure(None, np.array([0.0, 0.0, 0.0]), 0.0)
except IkError as error:
    print(error)

# %% [markdown]
# ## Repair it
#
# Tell the program how late the sensor is, or learn more slowly. It is stable while the delay that it does not know
# of is shorter than the time in which it learns.

# %%
draw(
    {
        "told of the delay": follow(ModelError(time=0.4, delay=0.3), late=0.3),
        "learns in 1 s": follow(ModelError(time=1.0, delay=0.03), late=0.3),
    }
)

# %% [markdown]
# ## On your own
#
# - Mount the sensor a quarter turn off: `follow(ModelError(), wrong=np.pi / 2)`. And 20 degrees?
# - On the real robot: `tripod ik feedback:=imu`, [inverse kinematics](../docs/inverse_kinematics.md).
