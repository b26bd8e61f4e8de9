# %% [markdown]
# # Step 7: the serial line to the robot
#
# The computer sends bytes to the robot over USB. Here they go to a port in memory, so nothing can break. There are two
# protocols: `legacy`, which the workshop's firmware speaks, and `framed`, which this project's firmware speaks.
#
# - **Objectives**: encode angles; compute the load of a line; explain what a checksum protects.
# - **Prerequisites**: [step 4](step_4_assembly.ipynb); bytes and bits.
# - **Time**: 20 minutes.
#
# ## Equations
#
# A servo turns with the width of a pulse, 544 to 2400 us for 0 to 180 degrees. `legacy` sends whole degrees, one byte
# for a servo. `framed` sends the width in tenths of a microsecond, with a checksum. The resolutions are
#
#     legacy: 1 degree     framed: 0.1 us · 180 degrees / 1856 us = 0.01 degrees
#
# If each bit is wrong with probability p, a packet of n bits arrives intact with probability (1 - p)^n.

# %%
import matplotlib.pyplot as plt
import numpy as np
import show  # noqa: F401 - sets the style of the plots

from tripod_driver.calibration import Calibration
from tripod_driver.framed import Decoder, encode
from tripod_driver.framed_messages import SetPulses
from tripod_driver.ports.mock import MockPort
from tripod_driver.protocol import LegacyDecoder, LegacyProtocol
from tripod_sim import Simulation, load_scene

calibration, legacy = Calibration(), LegacyProtocol()


def framed(angles: np.ndarray, sequence: int) -> bytes:
    """Return a `framed` packet: a pulse width for each servo [0.1 us], a sequence number, a checksum."""
    return encode(SetPulses(tuple(round(10 * p) for p in calibration.pulses(angles))), sequence % 256)


angles = np.array([-0.5, -0.6, -0.7])  # [rad]
print("legacy:", legacy.encode(angles).hex(" "), "(255, then whole degrees)")
print("framed:", framed(angles, 1).hex(" "), "(between zeros: type, sequence number, pulses, checksum)")

# %% [markdown]
# ## Stream a motion
#
# The servos move on a circle about the working pose, with fifty packets a second. What arrives?

# %%
times = np.arange(0, 2, 0.02)
phases = np.pi * times[:, None] + 2 * np.pi / 3 * np.arange(3)
wanted = -1.45 + 0.2 * np.sin(phases)  # [rad], shape (100, 3)


def send(packets: list[bytes], noise: float = 0.0, seed: int = 0) -> bytes:
    """Send packets over a port in memory; return the bytes that arrive, with a share `noise` of bits flipped."""
    port = MockPort()
    port.open()
    for packet in packets:
        port.write(packet)
    bits = np.unpackbits(np.frombuffer(port.arrived, np.uint8))
    flipped = np.random.default_rng(seed).random(bits.size) < noise
    return np.packbits(bits ^ flipped).tobytes()


def heard_framed(data: bytes) -> tuple[np.ndarray, Decoder]:
    """Return the angles that this project's firmware would set [rad], and the decoder with its counts."""
    decoder = Decoder()
    frames = decoder.feed(data)
    return np.array([calibration.angles([p / 10 for p in f.message.pulses]) for f in frames]), decoder


old = np.array(LegacyDecoder().feed(send([legacy.encode(a) for a in wanted])))
new, _ = heard_framed(send([framed(a, k) for k, a in enumerate(wanted)]))
plt.figure(figsize=(6, 3))
plt.plot(times, np.degrees(wanted[:, 0]), color="0.7", linewidth=4, label="commanded")
plt.plot(times, np.degrees(old[:, 0]), label="legacy")
plt.plot(times, np.degrees(new[:, 0]), "--", label="framed")
plt.gca().set(xlabel="time [s]", ylabel="servo 0 [degrees]", xlim=(0, 0.6))
plt.legend()
plt.show()

# %% [markdown]
# ## What does accuracy cost?
#
# **Question: how large is the error of the disc due to whole degrees, and how many bytes do finer angles cost?**


# %%
def places(angles: np.ndarray) -> np.ndarray:
    """Return where the effector is at rest for rows of angles [mm]."""
    simulation = Simulation(load_scene("tripod", ["inertia=off", "damping=off", "mesh.level=1"]))
    for k in range(20):
        simulation.step(np.append(angles[0], 0.035) * (k + 1) / 20)
    found = []
    for row in angles:
        simulation.step(np.append(row, 0.035))
        found.append(1e3 * simulation.effector.position)
    return np.array(found)


exact = places(wanted)
_, ax = plt.subplots(figsize=(4.2, 3.6))
ax.plot(*exact[:, :2].T, color="0.7", linewidth=4, label="commanded")
for name, heard, size in (
    ("legacy", old, len(legacy.encode(angles))),
    ("framed", new, len(framed(angles, 1))),
):
    place = places(heard)
    ax.plot(*place[:, :2].T, label=name)
    off = np.linalg.norm(place - exact, axis=1)
    print(
        f"{name}: {size:2} bytes a packet; the disc is off by {off.mean():.4f} mm on average, {off.max():.4f} at most"
    )
ax.set(xlabel="x [mm]", ylabel="y [mm]", aspect="equal")
ax.legend(fontsize=8)
plt.show()

# %% [markdown]
# A line of 115,200 baud carries 11,520 bytes a second. Fifty packets a second need 2 % of it with `legacy` and 6 % with
# `framed`. Here accuracy costs almost nothing.
#
# ## Break it
#
# Motors disturb the line. Let one bit in 200 arrive wrong.

# %%
noisy = np.array(LegacyDecoder().feed(send([legacy.encode(a) for a in wanted], noise=0.005)))
plt.figure(figsize=(6, 3))
for k in range(3):
    plt.plot(np.degrees(noisy[:, k]), label=f"servo {k}")
plt.gca().set(xlabel="packet", ylabel="angle that legacy sets [degrees]")
plt.legend(fontsize=8)
plt.show()
jump = np.abs(np.diff(noisy, axis=0)).max()
print(f"{len(noisy)} packets are accepted; the largest jump is {np.degrees(jump):.0f} degrees")

# %% [markdown]
# `legacy` has no check: each byte from 60 to 180 is an angle. The robot jerks.
#
# ## Repair it
#
# `framed` drops a packet whose checksum is wrong and counts it. The servos keep their last angles.

# %%
heard, decoder = heard_framed(send([framed(a, k) for k, a in enumerate(wanted)], noise=0.005))
print(f"{len(heard)} packets accepted; dropped: { {str(k): n for k, n in decoder.dropped.items()} }")
worst = max(np.abs(wanted - row).max(axis=1).min() for row in heard)
print(f"each accepted packet equals one that was sent, to {np.degrees(worst):.3f} degrees")

# %% [markdown]
# ## Questions
#
# 1. A packet of `framed` has 14 bytes. Which share arrives intact if one bit in 200 is wrong?
# 2. From which noise on does hardly any packet get through?
# 3. The line becomes silent. What should the board do?
#
# <details><summary>Solutions</summary>
#
# <p>1. (1 - 0.005)^112 = 57 %. The run above takes 65 of 100.</p>
#
# <p>2. With one wrong bit in 50, (1 - 0.02)^112 = 10 % are left; with one in 20, 0.3 %.</p>
#
# <p>3. Hold the last angles for a short time, then switch the servos off. This project's firmware does both after 0.5 s
# each.</p>
#
# </details>
#
# What the driver and the firmware guarantee: [the real robot](../docs/robot.md). In a terminal: `tripod doctor` looks
# for a board, `tripod driver --set port=mock` runs the driver without one.
