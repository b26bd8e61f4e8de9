# %% [markdown]
# # Lab A: the pendulum
#
# A chain of ten masses and springs swings down.
#
# - **Objectives**: explain explicit and implicit time steps; read the order of a scheme from a plot; find the longest
#   stable step.
# - **Prerequisites**: Newton's second law, Python with NumPy.
# - **Time**: 20 minutes.
#
# ## Equations
#
# A node of mass m at position x feels its springs and its weight:
#
#     m dv/dt = f(x),   dx/dt = v,   f = -k (l - l0) n + m g   for each spring of length l and direction n
#
# Semi-implicit Euler, which is explicit, uses the force at the beginning of the step. Implicit Euler uses the force
# at its end and has to solve an equation:
#
#     semi-implicit Euler:  v' = v + dt f(x)/m,    x' = x + dt v'
#     implicit Euler:       v' = v + dt f(x')/m,   x' = x + dt v'
#
# A scheme of order p has an error proportional to dt^p.

# %%
import matplotlib.pyplot as plt
import numpy as np
from show import cost, timed

from tripod_sim import Simulation, load_scene

simulation = Simulation(load_scene("pendulum"))  # semi-implicit Euler, 5 ms
for _ in range(6):
    x = simulation.positions
    plt.plot(x[:, 0], x[:, 2], "o-", label=f"{simulation.state.time:.1f} s")
    simulation.advance(40)
plt.gca().set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="The chain swings down")
plt.legend(fontsize=9)
plt.show()

# %% [markdown]
# ## Explicit or implicit?
#
# The springs of this scene have no damping, so the energy should stay constant. Compare five schemes with the same
# step.


# %%
def swing(seconds: float, **changes: object) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and energies [J]."""
    simulation = Simulation(
        load_scene("pendulum", [f"{k.replace('__', '.')}={v}" for k, v in changes.items()])
    )
    rows = []
    while simulation.state.time < seconds:
        simulation.step()
        e = simulation.energies()
        rows.append((simulation.state.time, e.kinetic + e.strain + e.gravity))
    return np.array(rows).T


for scheme in ("semi_implicit_euler", "rk4", "implicit_euler", "bdf2", "tr_bdf2"):
    plt.plot(*swing(5.0, inertia__scheme=scheme), label=scheme)
plt.gca().set(xlabel="time [s]", ylabel="energy [J]", title="Energy of the chain, dt = 5 ms")
plt.legend(fontsize=9)
plt.show()

# %% [markdown]
# Implicit Euler removes energy from every motion. TR-BDF2 is implicit too, and removes hardly any.
#
# ## What does accuracy cost?
#
# Where is the chain after one second? The reference is a Runge-Kutta solution with dt = 0.02 ms. **Question: which
# scheme and step reach an error below 1 mm in the least computing time?** Guess first, then run.


# %%
def place(scheme: str, dt: float) -> tuple[float, np.ndarray]:
    """Return the CPU time [s] and the positions of the nodes after one second [m]."""
    simulation = Simulation(load_scene("pendulum", [f"dt={dt}", f"inertia.scheme={scheme}"]))

    def run() -> np.ndarray:
        simulation.reset()
        simulation.advance(round(1 / dt))
        return simulation.positions.copy()

    return timed(run, repeat=3)


_, reference = place("rk4", 2e-5)
points, cheapest = {}, (np.inf, "nothing")
for scheme in ("semi_implicit_euler", "rk4", "implicit_euler", "tr_bdf2"):
    points[scheme] = []
    for dt in (0.01, 0.005, 0.002, 0.001, 0.0002):
        seconds, x = place(scheme, dt)
        error = 1e3 * np.linalg.norm(x - reference, axis=1).max()
        points[scheme].append((f"{1e3 * dt:g} ms", seconds, error))
        if error < 1:
            cheapest = min(cheapest, (seconds, f"{scheme}, dt = {1e3 * dt:g} ms"))
cost(points, "largest error after 1 s [mm]")
plt.show()
print(f"below 1 mm in the least time: {cheapest[1]}")

# %% [markdown]
# Read the slopes. Half the step gives half the error with semi-implicit Euler (order 1), a quarter with TR-BDF2
# (order 2), a sixteenth with RK4 (order 4; explicit, four evaluations of the forces a step).
# Implicit Euler is of order 1, too, but damps so much at these steps that its error falls by 1.5 to 1.8 only.
#
# ## Break it
#
# Light masses carry fast waves. Give each node 5 g, and forbid the program to divide its steps.

# %%
light = ["springs.node_mass=0.005", "inertia.substeps=off"]
simulation = Simulation(load_scene("pendulum", light))
heights = []
for _ in range(60):
    report = simulation.step()
    heights.append(simulation.positions[-1, 2])
plt.semilogy(np.abs(heights))
plt.gca().set(xlabel="step", ylabel="|height of the last node| [m]", title="An unstable simulation")
plt.show()
print(report.instability)
print(f"longest stable step: {1e3 * report.dt_limit:.2f} ms; this scene: {1e3 * simulation.scene.dt:g} ms")

# %% [markdown]
# ## Repair it
#
# There are two repairs: divide the steps (the default), or choose an implicit scheme, which has no such limit.

# %%
for repair in ("inertia.substeps=auto", "inertia.scheme=tr_bdf2"):
    simulation = Simulation(load_scene("pendulum", [*light, repair]))
    seconds, report = timed(lambda s=simulation: s.advance(200))
    substeps = report.parts / 200
    print(
        f"{repair:24} {report.instability or 'stable'}, {substeps:.0f} substeps a step, {1e3 * seconds:.1f} ms"
    )

# %% [markdown]
# ## Questions
#
# 1. The springs become ten times stiffer (`springs.stiffness=15000`). How does the longest stable step change?
# 2. Why does implicit Euler lose energy? Look at a single oscillator, m d²x/dt² = -k x.
# 3. RK4 won the race above. With which chain would TR-BDF2 win?
#
# <details><summary>Solutions</summary>
#
# <p>1. The limit is proportional to √(m / k), the inverse of the highest frequency. It falls by √10 = 3.2. Check it
# with <code>report.dt_limit</code>.</p>
#
# <p>2. With ω² = k / m, one step multiplies the amplitude by 1 / √(1 + (ω dt)²). This is less than one for every dt,
# so the scheme damps. The loss per step grows with dt.</p>
#
# <p>3. With a stiff chain. RK4 must take steps shorter than about 2.8 / ω of the fastest wave, although nobody wants
# to see that wave. TR-BDF2 only has to resolve the slow swing.</p>
#
# </details>
#
# In a terminal: `tripod run pendulum --view` shows the swing, `tripod study pendulum --quick` measures all schemes.
