# %% [markdown]
# # The pendulum
#
# A chain of ten masses and springs swings down. You see what a time step is, and what it costs to take a good one.

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
plt.gca().set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title="The chain on its way down")
plt.legend()
plt.show()

# %% [markdown]
# ## Explicit or implicit?
#
# An explicit scheme takes the forces as they are. An implicit one solves for the forces at the end of the step. No
# force here takes energy away, so the line of the energy should be flat.


# %%
def swing(seconds: float, **changes: object) -> tuple[np.ndarray, np.ndarray]:
    """Return times and energies."""
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
plt.gca().set(xlabel="time [s]", ylabel="energy [J]", title="dt = 5 ms")
plt.legend()
plt.show()

# %% [markdown]
# Implicit Euler takes energy from every motion. TR-BDF2 is implicit as well, and takes hardly any.
#
# ## What does accuracy cost?
#
# Where is the chain after one second? The truth: Runge-Kutta with steps of 0.02 ms. **Question: which scheme is
# within 1 mm in the least time?** Guess first, then run.


# %%
def place(scheme: str, dt: float) -> tuple[float, np.ndarray]:
    """Return CPU seconds and where the nodes are after one second."""
    simulation = Simulation(load_scene("pendulum", [f"dt={dt}", f"inertia.scheme={scheme}"]))

    def run() -> np.ndarray:
        simulation.reset()
        simulation.advance(round(1 / dt))
        return simulation.positions.copy()

    return timed(run, repeat=3)


_, truth = place("rk4", 2e-5)
points, cheapest = {}, (np.inf, "nothing")
for scheme in ("semi_implicit_euler", "rk4", "implicit_euler", "tr_bdf2"):
    points[scheme] = []
    for dt in (0.01, 0.005, 0.002, 0.001, 0.0002):
        seconds, x = place(scheme, dt)
        error = 1e3 * np.linalg.norm(x - truth, axis=1).max()
        points[scheme].append((f"{1e3 * dt:g} ms", seconds, error))
        if error < 1:
            cheapest = min(cheapest, (seconds, f"{scheme}, dt = {1e3 * dt:g} ms"))
cost(points, "largest error after 1 s [mm]")
plt.show()
print(f"within 1 mm in the least time: {cheapest[1]}")

# %% [markdown]
# Read the slopes: half the step is half the error with both Eulers, a quarter with TR-BDF2, a sixteenth with RK4.
#
# ## Break it
#
# Light masses make fast waves. Let each weigh 5 g, and forbid the program to divide its steps.

# %%
light = ["springs.node_mass=0.005", "inertia.substeps=off"]
simulation = Simulation(load_scene("pendulum", light))
heights = []
for _ in range(60):
    report = simulation.step()
    heights.append(simulation.positions[-1, 2])
plt.semilogy(np.abs(heights))
plt.gca().set(xlabel="step", ylabel="|height of the end| [m]", title="This is no pendulum")
plt.show()
print(report.instability)
print(f"the longest stable step: {1e3 * report.dt_limit:.2f} ms; asked for: {1e3 * simulation.scene.dt:g} ms")

# %% [markdown]
# ## Repair it
#
# There are two ways. Divide the steps (the program does so by itself), or take an implicit scheme, which needs no
# limit.

# %%
for repair in ("inertia.substeps=auto", "inertia.scheme=tr_bdf2"):
    simulation = Simulation(load_scene("pendulum", [*light, repair]))
    seconds, report = timed(lambda s=simulation: s.advance(200))
    print(
        f"{repair:24} {report.instability or 'stable'}, {report.parts / 200:.0f} parts a step, {1e3 * seconds:.1f} ms"
    )

# %% [markdown]
# ## On your own
#
# - Ten times stiffer springs: `springs.stiffness=15000`. How does the limit change? (It goes with the root of k / m.)
# - `tripod run pendulum --view` shows the swing; `tripod study pendulum` measures all schemes.
