# %% [markdown]
# # Step 7: the line to the robot
#
# Over USB the robot hears bytes. Here they go to a port in memory, so nothing can break. There are two languages:
# that of the workshop's firmware, and ours.

# %%
import matplotlib.pyplot as plt
import numpy as np
import show  # noqa: F401 - how pictures look

from tripod_driver.calibration import Calibration
from tripod_driver.framed import Decoder, encode
from tripod_driver.framed_messages import SetPulses
from tripod_driver.ports.mock import MockPort
from tripod_driver.protocol import LegacyDecoder, LegacyProtocol
from tripod_sim import Simulation, load_scene

calibration, legacy = Calibration(), LegacyProtocol()


def framed(angles: np.ndarray, sequence: int) -> bytes:
    """Return our packet: a pulse for each servo in tenths of a microsecond, a number, a checksum."""
    return encode(SetPulses(tuple(round(10 * p) for p in calibration.pulses(angles))), sequence % 256)


angles = np.array([-0.5, -0.6, -0.7])  # [rad]
print("legacy:", legacy.encode(angles).hex(" "), "(255, then whole degrees)")
print("framed:", framed(angles, 1).hex(" "), "(between zeros: what, number, pulses, checksum)")

# %% [markdown]
# ## Stream a motion
#
# The servos go round in a circle about the working pose, fifty packets a second. What arrives?

# %%
times = np.arange(0, 2, 0.02)
phases = np.pi * times[:, None] + 2 * np.pi / 3 * np.arange(3)
wanted = -1.45 + 0.2 * np.sin(phases)  # [rad], shape (100, 3)


def send(packets: list[bytes], noise: float = 0.0, seed: int = 0) -> bytes:
    """Send packets over a port in memory; return what arrives, with that share of its bits flipped."""
    port = MockPort()
    port.open()
    for packet in packets:
        port.write(packet)
    bits = np.unpackbits(np.frombuffer(port.arrived, np.uint8))
    flipped = np.random.default_rng(seed).random(bits.size) < noise
    return np.packbits(bits ^ flipped).tobytes()


def heard_framed(data: bytes) -> tuple[np.ndarray, Decoder]:
    """Return the angles [rad] that our firmware would set, and what it dropped."""
    decoder = Decoder()
    frames = decoder.feed(data)
    return np.array([calibration.angles([p / 10 for p in f.message.pulses]) for f in frames]), decoder


old = np.array(LegacyDecoder().feed(send([legacy.encode(a) for a in wanted])))
new, _ = heard_framed(send([framed(a, k) for k, a in enumerate(wanted)]))
plt.figure(figsize=(6, 3))
plt.plot(times, np.degrees(wanted[:, 0]), color="0.7", linewidth=4, label="wanted")
plt.plot(times, np.degrees(old[:, 0]), label="legacy")
plt.plot(times, np.degrees(new[:, 0]), "--", label="framed")
plt.gca().set(xlabel="time [s]", ylabel="servo 0 [degrees]", xlim=(0, 0.6))
plt.legend()
plt.show()

# %% [markdown]
# ## What does accuracy cost?
#
# **Question: how far from its place is the disc because of whole degrees, and how many bytes does it cost to have
# them finer?**


# %%
def places(angles: np.ndarray) -> np.ndarray:
    """Return where the effector comes to rest for rows of angles [mm]."""
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
ax.plot(*exact[:, :2].T, color="0.7", linewidth=4, label="wanted")
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
# A line of 115,200 baud carries 11,520 bytes a second: fifty packets a second need a few percent of it. Here
# accuracy costs hardly anything, and is still not there in the old language.
#
# ## Break it
#
# Motors make noise. Let one bit in 200 arrive wrong.

# %%
noisy = np.array(LegacyDecoder().feed(send([legacy.encode(a) for a in wanted], noise=0.005)))
plt.figure(figsize=(6, 3))
for k in range(3):
    plt.plot(np.degrees(noisy[:, k]), label=f"servo {k}")
plt.gca().set(xlabel="packet", ylabel="what the old firmware does [degrees]")
plt.legend(fontsize=8)
plt.show()
jump = np.abs(np.diff(noisy, axis=0)).max()
print(f"{len(noisy)} packets are taken for good; the largest jump is {np.degrees(jump):.0f} degrees")

# %% [markdown]
# The old firmware says nothing: any byte from 60 to 180 is an angle. The robot jerks.
#
# ## Repair it
#
# A packet with a checksum that does not fit is dropped, counted, and the servos keep what they had.

# %%
heard, decoder = heard_framed(send([framed(a, k) for k, a in enumerate(wanted)], noise=0.005))
print(f"{len(heard)} packets taken; dropped: { {str(k): n for k, n in decoder.dropped.items()} }")
worst = max(np.abs(wanted - row).max(axis=1).min() for row in heard)
print(f"every one that was taken is one that was sent, to {np.degrees(worst):.3f} degrees")

# %% [markdown]
# ## On your own
#
# - From which noise on does the new language let nothing through?
# - The driver also limits the speed, and stops when it hears nothing: [what it promises](../docs/robot.md).
# - `tripod doctor` looks for a board; `tripod driver port:=mock` runs the driver without one.
