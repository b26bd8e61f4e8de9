"""How well does `tripod calibrate --identify` find a robot by each of its sensors? Synthetic Tripods with known zeros.

Each robot has zeros of its servos (3 degrees rms), a slide 0.5 mm rms beside that on the ruler and a modulus of its
own, and is computed with another element and mesh than the model's (`TRUTHS` of benchmarks/identify.py). It is taken
through the poses that the command chooses for a sensor, and seen with its errors: heights to 0.3 mm from a table 60 mm
below, the IMU to 0.5 degrees and tilted by up to 3, a marker to 0.1 mm across the camera's view and 0.3 mm along it,
glued 2 mm beside the centre.
Told are the root mean square error of zeros and slide, half the 90 % intervals, and how often these hold the truth.

Writes a line of JSON for each robot and sensor, goes on where it stopped, and prints the table.
"""

import argparse
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.doc_parts import write_part
from benchmarks.identify import MODEL, TRUTHS, robots, with_values
from tripod_identify.errors import FitError
from tripod_identify.fit import Prior
from tripod_identify.identify import Wanted, identify
from tripod_identify.measured import Measured
from tripod_identify.model import predict
from tripod_identify.observe import Sensor
from tripod_identify.safe_poses import LOOKS, RULER, telling_poses
from tripod_sim import StepError, load_scene

SAFE = (-2.1, 0.0)
"""Range of the servos [rad]."""

NOISE = {"heights": [3e-4], "imu": [np.radians(0.5)] * 2, "marker": [1e-4, 1e-4, 3e-4]}
"""Of each channel [m, rad]."""

CAMERA = Rotation.from_rotvec([np.pi, 0.0, 0.0]) * Rotation.from_rotvec([0.05, -0.1, 0.3])
"""Of the world in the camera's frame: it looks down."""

SITS = {
    "heights": Sensor(np.array([0, 0, 0.06]), np.zeros(3), np.zeros(3)),
    "imu": Sensor(np.zeros(3), np.array([0.05, -0.03, 0.0]), np.zeros(3)),
    "marker": Sensor(np.array([0.01, -0.02, 0.25]), CAMERA.as_rotvec(), np.array([0.002, 0, 0.003])),
}
"""How each sensor really sits."""


def one(seed: int, sensor: str, poses: np.ndarray) -> dict:
    """Return what is found of a robot."""
    look, rng = LOOKS[sensor], np.random.default_rng(seed)
    values = {f"servos.zero.{i}": float(0.05 * rng.standard_normal()) for i in range(3)}
    values |= {"servos.slide": 0.02 + RULER * float(rng.standard_normal())}
    values |= {"material.young": 250e3 * float(np.exp(0.1 * rng.standard_normal()))}
    real = with_values(load_scene("tripod", TRUTHS["element"]), values)
    data = Measured(None, poses, None, look.channels, np.zeros((len(poses), len(look.channels))))
    try:
        seen = predict(replace(real, sensor=SITS[sensor]), data, ())
    except StepError as error:
        return {"seed": seed, "sensor": sensor, "failed": str(error)}
    data = replace(data, values=seen + rng.standard_normal(seen.shape) * NOISE[sensor])
    wanted = Wanted(look.names, look.align, {"servos.slide": Prior(0.02, RULER)}, propose=False)
    began = time.process_time()
    try:
        found = identify(load_scene("tripod", MODEL), data, (), wanted)
    except (FitError, StepError) as error:
        return {"seed": seed, "sensor": sensor, "failed": str(error)}
    rows = {f.parameter.name: [values[f.parameter.name], f.true, f.true_low, f.true_high] for f in found.found
            if f.parameter.name in values}  # fmt: skip
    return {"seed": seed, "sensor": sensor, "cpu": time.process_time() - began, "found": rows}


def table(rows: list[dict]) -> str:
    """Return the table in Markdown."""
    lines = [
        "| sensor | robots | zero: error rms, half interval [degrees] | slide: error rms, half interval [mm] | zeros, "
        "slides, moduli found | intervals hold | CPU time [s] |",
        "|---|---|---|---|---|---|---|",
    ]
    for sensor in LOOKS:
        own = [r for r in rows if r["sensor"] == sensor]
        done = [r["found"] for r in own if "found" in r]
        if not done:
            continue
        part = {
            kind: np.array([v for r in done for k, v in r.items() if kind in k])
            for kind in ("zero", "slide", "young")
        }
        cells = []
        for kind, size in (("zero", np.degrees(1)), ("slide", 1e3)):
            p = part[kind].reshape(-1, 4)
            error, half = np.sqrt(((p[:, 1] - p[:, 0]) ** 2).mean()), np.median(0.5 * (p[:, 3] - p[:, 2]))
            cells.append(f"{size * error:.2f}, {size * half:.2f}")
        every = np.concatenate([p.reshape(-1, 4) for p in part.values()])
        hold = 100 * ((every[:, 2] <= every[:, 0]) & (every[:, 0] <= every[:, 3])).mean()
        of = len(done)
        share = [
            f"{100 * len(part[k]) / (of * n):.0f} %" for k, n in (("zero", 3), ("slide", 1), ("young", 1))
        ]
        cpu = np.median([r["cpu"] for r in own if "cpu" in r])
        cells += [", ".join(share), f"{hold:.0f} %", f"{cpu:.0f}"]
        lines.append(f"| `{sensor}` | {of} of {len(own)} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", type=int, default=10)
    parser.add_argument("--poses", type=int, default=20)
    parser.add_argument(
        "--results",
        type=Path,
        default=Path("calibrate_sensors"),
        help="begin of the names of files, gone on with",
    )
    parser.add_argument("--write", action="store_true", help="write docs/reality.md, too")
    given = parser.parse_args()
    rows = []
    for sensor, look in LOOKS.items():
        poses = telling_poses(load_scene("tripod", MODEL), look, [SAFE[0]] * 3, [SAFE[1]] * 3, given.poses)
        results = given.results.with_name(f"{given.results.stem}_{sensor}.jsonl")
        print(sensor, flush=True)
        rows += robots(results, given.robots, partial(one, sensor=sensor, poses=poses))
    print(f"{given.poses} poses:\n\n{table(rows)}")
    if given.write:
        write_part("reality.md", "sensors", table(rows).splitlines())


if __name__ == "__main__":
    main()
