# %% [markdown]
# # Step 8: inverse kinematics and the maze
#
# Where must the servos be, so that the disc is where you want it? A soft robot has no formula for that. It has a
# tangent.

# %%
import matplotlib.pyplot as plt
import numpy as np
from show import cost, timed

from tripod_ik.once import solve_once
from tripod_play.solve import solve
from tripod_sim import Simulation, load_scene

STATIC = ["inertia=off", "damping=off"]
START = [*STATIC, "servos.angles=[-1.4965,-1.4965,-1.4965]", "servos.slide=0.035"]

simulation = Simulation(load_scene("tripod", START))
w = simulation.compliance().w  # answers of effector (6 rows) and servos (3 rows) to forces and torques
jacobian = w[:3, 6:] @ np.linalg.inv(w[6:, 6:])  # effector's move per servo angle [m/rad]
print("millimetres per radian of each servo:\n", (1e3 * jacobian).round(2))

# %% [markdown]
# That is right for small moves only:

# %%
place, moves = simulation.effector.position.copy(), (0.02, 0.05, 0.1, 0.2, 0.3)
missed = []
for turn in moves:
    simulation.reset()
    simulation.step(simulation.command + np.array([turn, 0, 0, 0]))
    missed.append(1e3 * np.linalg.norm(simulation.effector.position - place - jacobian @ [turn, 0, 0]))
plt.figure(figsize=(5, 3))
plt.plot(moves, missed, "o-")
plt.gca().set(xlabel="turn of servo 0 [rad]", ylabel="the tangent is wrong by [mm]")
plt.show()

# %% [markdown]
# So the program takes a step along the tangent, looks where it is, and takes a new tangent, until it is there:

# %%
answer = solve_once(load_scene("tripod"), [0.005, 0.0, -0.006], slide=0.035)
print(f"{answer['outcome']} after {answer['iterations']} tangents, {1e6 * answer['error']:.3f} um left")
print(
    "angles [degrees]:",
    np.degrees(answer["angles"]).round(1),
    " torques [N m]:",
    np.round(answer["torques"], 3),
)

# %% [markdown]
# ## What does accuracy cost?
#
# The answer is exact for the model. The robot is made of silicone, not of a mesh. Let a fine mesh play the robot.
# **Question: which model is right to 0.5 mm on it, and what does it cost? Why do more iterations not help?**

# %%
robot = Simulation(load_scene("tripod", [*START, "mesh.element=h20", "mesh.level=8"]))
targets = [(0.004 * np.cos(a), 0.004 * np.sin(a), -0.007) for a in (0.0, np.pi / 3)]
points = {}
for element, levels in {"t4": (5, 6), "h8_modes": (1, 12), "h20": (1, 13)}.items():
    points[element] = []
    for level in levels:
        model = load_scene("tripod", [f"mesh.element={element}", f"mesh.level={level}"])
        errors, seconds = [], []
        for target in targets:
            taken, answer = timed(lambda m=model, t=target: solve_once(m, t, slide=0.035))
            robot.step(np.append(answer["angles"], 0.035))
            errors.append(1e3 * np.linalg.norm(robot.effector.position - target))
            seconds.append(taken)
        points[element].append((f"level {level}", min(seconds), max(errors)))
        print(f"{element:9} level {level}: {max(errors):6.3f} mm off, {1e3 * min(seconds):4.0f} ms a target")
cost(points, "error on the robot [mm]")
plt.show()

# %% [markdown]
# ## Break it
#
# Ask for a place that the robot cannot reach, and for one that costs more torque than it may. A search for the closest
# pose looks at many, so take a coarse model:

# %%
quick = load_scene("tripod", ["mesh.element=h8_modes", "mesh.level=1"])
far = solve_once(quick, [0.03, 0.0, -0.006], slide=0.035)
print(f"{far['outcome']}; {1e3 * far['error']:.1f} mm are missing")
near = [0.008, 0.0, -0.005]
weak = solve_once(quick, near, slide=0.035, torque_max=0.06, hard=True)
print(
    f"{weak['outcome']}; {1e3 * weak['error']:.2f} mm are missing; limits: {', '.join(weak['active_limits'])}"
)

# %% [markdown]
# It goes as close as it can, says how much is missing, and which limit binds.
#
# ## Repair it
#
# Move the target to what it can do, or lift the limit:

# %%
there = solve_once(quick, [0.012, 0.0, -0.009], slide=0.035)
print(f"12 mm to the side: {there['outcome']}")
strong = solve_once(quick, near, slide=0.035, torque_max=0.17, hard=True)
print(f"with 0.17 N m: {strong['outcome']}, torques {np.round(strong['torques'], 3)} N m")

# %% [markdown]
# ## The maze
#
# Tilting the disc rolls a ball. The program plans a way, and asks inverse kinematics for tilts, fifty times a
# second. The ball is seen late, with noise.

# %%
simulation = Simulation(load_scene("maze", ["maze.source=first"]))
game = solve(simulation, seed=1)
board = simulation.plate.board
_, ax = plt.subplots(figsize=(3.6, 3.6))
for x, y, _, a, b, _ in 1e3 * board.obstacles.boxes[1:]:
    ax.add_patch(plt.Rectangle((x - a, y - b), 2 * a, 2 * b, color="0.5"))
ax.plot(*(1e3 * game.track.T), color="tab:orange")
ax.set(aspect="equal", xlabel="x on the plate [mm]", ylabel="y [mm]", title=f"{game.why}, {game.time:.1f} s")
plt.show()

# %% [markdown]
# ## On your own
#
# - Where is the border of what can be reached? `tripod reach --out reach.csv --plot reach.png`
# - Draw a maze of your own: [examples](../examples/README.md).
# - `tripod solve holes`
