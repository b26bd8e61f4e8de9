# %% [markdown]
# # Step 9: the closed loop
#
# The robot differs from its model: the silicone is stiffer, a servo horn is mounted one tooth off. A sensor on the disc
# measures the difference.
#
# - **Objectives**: explain integral feedback; find its stability limit; decide between a better model and a sensor.
# - **Prerequisites**: [step 8](step_8_inverse_kinematics.ipynb); feedback control.
# - **Time**: 30 minutes.
#
# ## Equations
#
# The model predicts the tilt m(q), the sensor measures y. The program learns the error e of the model with a time
# constant T and subtracts it from the target r:
#
#     de/dt = (y - m(q) - e) / T,   q solves m(q) = r - e
#
# At rest e = y - m(q), so y = r: the error of the model is compensated. If the sensor is late by a time that the
# program does not know, the loop is stable only while that time is shorter than about T.

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
TILT = normal_of(0.1, -0.08)  # commanded normal of the disc


def follow(
    correction: ModelError | None,
    *,
    late: float = 0.04,
    wrong: float = 0.0,
    young: float = 275e3,
    seconds: float = 2.0,
    words: tuple[str, ...] = ("mesh.element=h8_modes", "mesh.level=1"),
) -> np.ndarray:
    """Command a tilt after 0.1 s; return the error of the tilt at each command [rad].

    Args:
        correction: Estimator of the model error; None: open loop.
        late: Delay of the sensor [s].
        wrong: Angle by which the sensor is mounted off about the vertical [rad].
        young: Young's modulus of the robot [Pa]; the model has 250 kPa.
        seconds: Duration [s].
        words: Changes to the scene of the model; the robot has a finer mesh.
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
    """Plot errors over time."""
    plt.figure(figsize=(6, 3))
    for name, errors in curves.items():
        plt.semilogy(DT * np.arange(len(errors)), np.degrees(errors), label=name)
    plt.gca().set(xlabel="time [s]", ylabel="error of the tilt [degrees]")
    plt.legend(fontsize=8)
    plt.show()


draw({"open loop": follow(None), "with the sensor": follow(ModelError(time=0.4))})

# %% [markdown]
# In the open loop the error remains. With the sensor the program learns the error of the model and subtracts it from
# the target. It acts like the integral part of a controller.
#
# ## What does accuracy cost?
#
# A better model is slower. A sensor corrects a poor one. **Question: with the sensor, does the better model still
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
# At rest the sensor compensates each of these models. In motion the model still decides, until the sensor has reported.
#
# ## Break it
#
# Learn too fast, from a sensor that is later than the program assumes:

# %%
draw(
    {
        "T = 0.4 s, sensor 0.04 s late": follow(ModelError(time=0.4, delay=0.03)),
        "T = 0.05 s, sensor 0.3 s late": follow(ModelError(time=0.05, delay=0.03), late=0.3),
    }
)

# %% [markdown]
# The program corrects the same error again and again. Now a sensor that reports no direction at all:

# %%
try:
    ModelError().measure(None, np.array([0.0, 0.0, 0.0]), 0.0)
except IkError as error:
    print(error)

# %% [markdown]
# ## Repair it
#
# State the true delay of the sensor, or learn more slowly.

# %%
draw(
    {
        "T = 0.4 s, delay known": follow(ModelError(time=0.4, delay=0.3), late=0.3),
        "T = 1 s, delay unknown": follow(ModelError(time=1.0, delay=0.03), late=0.3),
    }
)

# %% [markdown]
# ## Questions
#
# 1. Mount the sensor 20 degrees off about the vertical: `follow(ModelError(time=0.4), wrong=np.radians(20))`. Which
#    error remains?
# 2. And with a quarter turn, `wrong=np.pi / 2`?
# 3. Would a longer time constant help in either case?
#
# <details><summary>Solutions</summary>
#
# <p>1. 2.5 degrees. The program believes the sensor. The commanded tilt of 7.3 degrees appears turned by 20 degrees,
# and 2 sin(10°) · 7.3 = 2.5.</p>
#
# <p>2. 16 degrees, twice the commanded tilt: the correction is at a right angle to the error.</p>
#
# <p>3. No. Neither error depends on the speed of learning. Check the mounting with one known tilt.</p>
#
# </details>
#
# In a terminal: `tripod ik --set feedback=imu` uses its sensor: [inverse kinematics](../docs/inverse_kinematics.md).
