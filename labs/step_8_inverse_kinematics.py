# %% [markdown]
# # Step 8: inverse kinematics and the maze
#
# Which servo angles move the disc to a target? For a soft robot there is no closed formula. The simulator provides a
# linear approximation, the Jacobian.
#
# - **Objectives**: compute a Jacobian; explain Newton's iteration for a target; read which limit stops the robot.
# - **Prerequisites**: [step 4](step_4_assembly.ipynb); Jacobians.
# - **Time**: 30 minutes.
#
# ## Equations
#
# The disc is at p(q) for servo angles q. With the Jacobian J = dp/dq the iteration for a target is
#
#     choose dq with the smallest |p + J dq - target|² within the limits of angles and torques;   q = q + dq
#
# This is a quadratic program. It is solved again with a new J until the target is reached. J comes from the compliance
# W of the body, its response to forces and torques: J = W_pt W_tt^-1, with rows p of the disc and columns t of the
# servos.

# %%
import matplotlib.pyplot as plt
import numpy as np
from show import cost, timed

from tripod_ik.solve_once import solve_once
from tripod_play.solve import solve
from tripod_sim import Simulation, load_scene

STATIC = ["inertia=off", "damping=off"]
START = [*STATIC, "servos.angles=[-1.4965,-1.4965,-1.4965]", "servos.slide=0.035"]

simulation = Simulation(load_scene("tripod", START))
w = simulation.compliance().w  # response of effector (6 rows) and servos (3 rows) to forces and torques
jacobian = w[:3, 6:] @ np.linalg.inv(w[6:, 6:])  # effector displacement per servo angle [m/rad]
print("Jacobian [mm/rad], one column for each servo:\n", (1e3 * jacobian).round(2))

# %% [markdown]
# This holds for small moves only:

# %%
place, moves = simulation.effector.position.copy(), (0.02, 0.05, 0.1, 0.2, 0.3)
missed = []
for turn in moves:
    simulation.reset()
    simulation.step(simulation.command + np.array([turn, 0, 0, 0]))
    missed.append(1e3 * np.linalg.norm(simulation.effector.position - place - jacobian @ [turn, 0, 0]))
plt.figure(figsize=(5, 3))
plt.plot(moves, missed, "o-")
plt.gca().set(xlabel="turn of servo 0 [rad]", ylabel="error of the Jacobian [mm]")
plt.show()

# %% [markdown]
# So the program iterates: it moves with the Jacobian, computes the new equilibrium and its Jacobian, and repeats:

# %%
answer = solve_once(load_scene("tripod"), [0.005, 0.0, -0.006], slide=0.035)
print(f"{answer['outcome']} after {answer['iterations']} iterations, error {1e6 * answer['error']:.3f} um")
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
# **Question: which model has an error below 0.5 mm on it, and what does it cost? Why do more iterations not help?**

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
        print(
            f"{element:9} level {level}: error {max(errors):6.3f} mm, {1e3 * min(seconds):4.0f} ms a target"
        )
cost(points, "error on the robot [mm]")
plt.show()

# %% [markdown]
# More iterations remove the error of the iteration, which is already far smaller. The error of the model remains.
#
# ## Break it
#
# Choose a target that the robot cannot reach, and one that needs more torque than allowed. The search for the closest
# pose needs many solutions, so take a coarse model:

# %%
quick = load_scene("tripod", ["mesh.element=h8_modes", "mesh.level=1"])
far = solve_once(quick, [0.03, 0.0, -0.006], slide=0.035)
print(f"{far['outcome']}; {1e3 * far['error']:.1f} mm from the target")
near = [0.008, 0.0, -0.005]
weak = solve_once(quick, near, slide=0.035, torque_max=0.06, hard=True)
print(
    f"{weak['outcome']}; {1e3 * weak['error']:.2f} mm from the target; limits: {', '.join(weak['active_limits'])}"
)

# %% [markdown]
# It moves as close as it can, reports the remaining distance, and names the limit.
#
# ## Repair it
#
# Move the target to a place within reach, or raise the limit:

# %%
there = solve_once(quick, [0.012, 0.0, -0.009], slide=0.035)
print(f"12 mm to the side: {there['outcome']}")
strong = solve_once(quick, near, slide=0.035, torque_max=0.17, hard=True)
print(f"with 0.17 N m: {strong['outcome']}, torques {np.round(strong['torques'], 3)} N m")

# %% [markdown]
# ## The maze
#
# Tilting the disc rolls a ball. The program plans a path and lets inverse kinematics find the angles for a tilt, fifty
# times a second. The camera that sees the ball is late and noisy.

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
# ## Questions
#
# 1. Why is the second entry of the first column of the Jacobian zero?
# 2. All entries of its third row are equal. What does that mean?
# 3. The Jacobian's error grows with the turn of the servo. By which power?
#
# <details><summary>Solutions</summary>
#
# <p>1. Servo 0 moves in the plane y = 0, and the robot is symmetric to that plane. So it cannot move the disc along
# y.</p>
#
# <p>2. Each servo lifts the disc by the same amount, by the symmetry of 120 degrees. All three together move it
# straight up.</p>
#
# <p>3. By the second: a linear approximation leaves an error of order (dq)². Twice the turn, four times the error.</p>
#
# </details>
#
# In a terminal: `tripod play holes` plays another maze. A maze of your own: [examples](../examples/README.md).
