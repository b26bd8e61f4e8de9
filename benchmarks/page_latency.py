"""From key or slider to servo: how long until what a hand does in the browser moves a servo of the simulator.

A real Chromium shows the page of `tripod_view.node` beside `tripod_runtime.node`. A press is timed from the event in
the browser (the time that its own clock gives it) to the first joint state in which that servo has moved, as a node of
this program hears it. Both clocks are the machine's. Before each press the joints rest. Run it on a quiet machine.
"""

import argparse
import contextlib
import os
import random
import shutil
import subprocess
import sys
import threading
import time

from calibration import calibration  # it sets the number of threads, so it comes before NumPy

# isort: split
import numpy as np
import rclpy
from playwright.sync_api import sync_playwright
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState

from tripod_bringup.node_values import node_package
from tripod_graph import names
from tripod_graph.qos import RELIABLE

MOVED = 1e-4  # [rad]
REST, PATIENCE = 0.5, 5.0  # [s]
FLAGS = ("--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run")


class Joints:
    """Hears joint states in a thread; `times` and `angles` keep them."""

    def __init__(self) -> None:
        rclpy.init()
        node = rclpy.create_node("page_latency")
        self.heard: list[tuple[float, tuple[float, ...]]] = []
        node.create_subscription(
            JointState,
            names.SIM_JOINT_STATES,
            lambda m: self.heard.append((time.time(), tuple(m.position))),
            RELIABLE,
        )
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        threading.Thread(target=executor.spin, daemon=True).start()

    def moved(self, servo: int, since: float, before: float) -> float:
        """Return when a servo was first heard to have moved from `before` [rad]; NaN if it does not."""
        until = time.time() + PATIENCE
        while time.time() < until:
            for at, angles in list(self.heard):
                if at >= since and abs(angles[servo] - before) > MOVED:
                    return at
            time.sleep(0.002)
        return float("nan")


@contextlib.contextmanager
def node(name: str, *words: str):
    program = [sys.executable, "-m", f"{node_package(name)}.node", *words]
    process = subprocess.Popen(program, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(30)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--presses", type=int, default=100)
    presses = parser.parse_args().presses
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randint(1, 100))
    with node("sim", "scene:=tripod"), node("view", "port:=0") as view, sync_playwright() as driver:
        url = view.stdout.readline().split()[-1]
        joints = Joints()
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
        page = browser.new_page(viewport={"width": 1400, "height": 900}, device_scale_factor=0.25)
        page.goto(url, wait_until="commit")
        page.wait_for_function("() => document.body.classList.contains('has-known')", polling=100)
        page.keyboard.press("t")
        page.wait_for_function("() => !document.querySelector('.servo input').disabled", polling=100)
        found = {"key": [], "slider": []}
        for k in range(presses):
            for kind, taken in found.items():
                time.sleep(REST)
                joints.heard[:-1] = []
                before, sign = joints.heard[-1][1][0], 1 if k % 2 else -1
                since = press(page, kind, sign, before)
                taken.append(joints.moved(0, since, before) - since)
                page.keyboard.up("ArrowUp" if sign > 0 else "ArrowDown")
        browser.close()
    print(f"1000 x 1000 float64 product: {1e3 * calibration():.1f} ms")
    for kind, taken in found.items():
        ms = 1e3 * np.array(taken)
        p50, p99 = np.nanpercentile(ms, [50, 99])
        print(
            f"{kind}: {len(ms)} presses, p50 {p50:.0f} ms, p99 {p99:.0f} ms, lost {int(np.isnan(ms).sum())}"
        )


def press(page, kind: str, sign: int, angle: float) -> float:
    """Press and return when the browser says that it was [s since the epoch]."""
    if kind == "key":
        page.evaluate("addEventListener('keydown', (e) => (window.at = performance.timeOrigin + e.timeStamp), "
                      "{ capture: true, once: true })")  # fmt: skip
        page.keyboard.down("ArrowUp" if sign > 0 else "ArrowDown")
        return 1e-3 * page.evaluate("window.at")
    degrees = np.degrees(angle) + 3.0 * sign
    return 1e-3 * page.evaluate(
        """(v) => { const e = document.querySelector("[aria-label='servo 0 (degrees)']"); e.value = v;
            e.dispatchEvent(new Event("input")); return performance.timeOrigin + performance.now() }""",
        degrees,
    )


if __name__ == "__main__":
    main()
