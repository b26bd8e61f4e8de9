"""Whether `tripod up --demo` keeps its word: rates of topics, time of a step, processor time of each process.

Plays the demo with a browser's share of the page, listens to every topic with a declared rate, and prints a table of
each: declared and found rate; CPU time of each process over wall time; median and 99th percentile of the simulator's
steps, each of a second, as `sim/status` tells them; what others took of the processors meanwhile. The exit code is 1 if
a rate is further than 5 % from the declared one. `--busy N` keeps N processors busy meanwhile, `--minutes` says how
long to look, `--write` puts the tables into docs/speed.md.
"""

import argparse
import contextlib
import os
import re
import signal
import statistics
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # run as a script, too

from benchmarks.calibration import busy
from benchmarks.doc_parts import write_part
from benchmarks.soak import PATIENCE, group, start, wait_for_all
from tripod_graph import names
from tripod_graph.loopback import keep_local
from tripod_graph.qos import RELIABLE, SENSOR

ALLOWED = 0.05
SETTLING = 10.0
"""Left out at the beginning, while the page is sent [s]."""


def declared() -> dict[str, tuple[type, float]]:
    """Return type and declared rate [Hz] of each topic that has one, with the parameters as they are by default."""
    from geometry_msgs.msg import PoseStamped  # noqa: PLC0415
    from sensor_msgs.msg import JointState  # noqa: PLC0415
    from tf2_msgs.msg import TFMessage  # noqa: PLC0415
    from trajectory_msgs.msg import JointTrajectory  # noqa: PLC0415
    from tripod_msgs.msg import BodyState, Compliance, IkStatus, RobotStatus, SimStatus  # noqa: PLC0415

    return {
        names.BODY_STATE: (BodyState, 30.0),
        names.TF: (TFMessage, 30.0),
        names.SIM_JOINT_STATES: (JointState, 100.0),
        names.EFFECTOR_POSE: (PoseStamped, 100.0),
        names.COMPLIANCE: (Compliance, 50.0),
        names.SIM_STATUS: (SimStatus, 10.0),
        names.TARGET_POSE: (PoseStamped, 50.0),
        names.JOINT_TRAJECTORY: (JointTrajectory, 50.0),
        names.IK_STATUS: (IkStatus, 50.0),
        names.ROBOT_JOINT_STATES: (JointState, 50.0),
        names.ROBOT_STATUS: (RobotStatus, 10.0),
    }


class Ear:
    """Counts messages; keeps what `sim/status` says of the steps."""

    def __init__(self) -> None:
        import rclpy  # noqa: PLC0415
        from rclpy.executors import SingleThreadedExecutor  # noqa: PLC0415
        from rclpy.serialization import deserialize_message  # noqa: PLC0415

        keep_local(subnet=False)
        rclpy.init(args=[])
        self._node = rclpy.create_node("rates")
        self.counts: Counter[str] = Counter()
        self.medians, self.p99s, self.missed = list[float](), list[float](), list[int]()
        for topic, (kind, _) in declared().items():

            def hear(data: bytes, topic: str = topic, kind: type = kind) -> None:
                self.counts[topic] += 1
                if topic == names.SIM_STATUS:
                    status = deserialize_message(data, kind)
                    self.medians.append(status.step_time_median)
                    self.p99s.append(status.step_time_p99)
                    self.missed.append(status.missed_periods)

            qos = SENSOR if topic == names.BODY_STATE else RELIABLE
            self._node.create_subscription(kind, topic, hear, qos, raw=True)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        while not self._over.is_set():
            self._executor.spin_once(timeout_sec=0.1)

    def close(self) -> None:
        """Leave the graph."""
        import rclpy  # noqa: PLC0415

        self._over.set()
        self._thread.join()
        rclpy.try_shutdown()

    def clear(self) -> None:
        """Begin to count."""
        self.counts.clear()
        for values in (self.medians, self.p99s, self.missed):
            values.clear()


def spent(pid: int) -> float:
    """Return the CPU time of a process with all of its threads [s]; raises OSError if it is gone."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextlib.contextmanager
def page(log: Path) -> Iterator[None]:
    """Take in what a browser would, with the address that the demo prints."""
    from tests.view.fake_browser import FakeBrowser  # noqa: PLC0415 - what the tests speak to the page with

    found = re.search(r"http://\S+", log.read_text())
    if found is None:
        raise RuntimeError(f"the demo names no page:\n{log.read_text()}")
    with FakeBrowser(found[0]) as browser:
        over = threading.Event()

        def forget() -> None:
            while not over.wait(1.0):
                browser.messages.clear()

        thread = threading.Thread(target=forget)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()


@dataclass
class Found:
    """What was found.

    Attributes:
        rates: Of each topic [Hz].
        share: Of each process, of one processor.
        others: What was busy beside them, in processors.
        seconds: How long it was looked at [s].
    """

    rates: dict[str, float]
    share: dict[str, float]
    others: float
    seconds: float


def machine_busy() -> float:
    """Return the time that all processors were busy since the machine was started [s]."""
    fields = [int(word) for word in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:9]]
    return (sum(fields) - fields[3] - fields[4]) / os.sysconf("SC_CLK_TCK")  # but idle and waiting for disks


def watch(pid: int, ear: Ear, seconds: float) -> Found:
    """Look at a demo for so long [s]."""
    ear.clear()
    begun, busy_before = time.monotonic(), machine_busy()
    before = {name: spent(number) for name, number in group(pid).items()}
    time.sleep(seconds)
    taken = time.monotonic() - begun
    share = {name: (spent(number) - before[name]) / taken for name, number in group(pid).items()}
    rates = {topic: ear.counts[topic] / taken for topic in declared()}
    return Found(rates, share, (machine_busy() - busy_before) / taken - sum(share.values()), taken)


def far(found: Found) -> list[str]:
    """Return the topics whose rates are too far from the declared ones."""
    return [t for t, (_, rate) in declared().items() if not abs(found.rates[t] / rate - 1.0) <= ALLOWED]


def lines(found: Found, ear: Ear) -> Iterator[str]:
    """Tell it as tables."""
    yield "| topic | declared [Hz] | found [Hz] | off |\n|---|---|---|---|"
    for topic, (_, rate) in declared().items():
        off = found.rates[topic] / rate - 1.0
        yield f"| `{topic}` | {rate:g} | {found.rates[topic]:.1f} | {100 * off:+.1f} % |"
    yield "\n| process | share of a processor |\n|---|---|"
    for name, value in found.share.items():
        yield f"| {name} | {100 * value:.0f} % |"
    yield f"| all | {100 * sum(found.share.values()):.0f} % |"
    median, p99 = statistics.median(ear.medians), statistics.median(ear.p99s)
    tenth = statistics.quantiles(ear.p99s, n=10)[-1]
    yield (
        f"\nStep: median {1e3 * median:.2f} ms; 99th percentile of a second: {1e3 * p99:.2f} ms in the median second, "
        f"at most {1e3 * tenth:.2f} ms in nine of ten, {1e3 * max(ear.p99s):.2f} ms in the worst; periods missed: "
        f"{ear.missed[-1] - ear.missed[0]}."
    )
    yield (
        f"Looked at for {found.seconds / 60:.1f} minutes on {os.cpu_count()} processors, of which the demo took "
        f"{sum(found.share.values()):.2f} and others {found.others:.2f}, what listens and looks on here included."
    )


def main() -> int:
    """Run it; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0, help="how long to look")
    parser.add_argument("--busy", type=int, default=0, help="processors kept busy meanwhile")
    parser.add_argument("--write", action="store_true", help="write the tables to docs/speed.md, too")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place, busy(options.busy):
        log = Path(place) / "log"
        ear = Ear()
        process = start(Path(place) / "recordings", 60.0 * options.minutes + PATIENCE, log)
        try:
            wait_for_all(process, log)
            with page(log):
                time.sleep(SETTLING)
                found = watch(process.pid, ear, 60.0 * options.minutes)
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
            process.wait(PATIENCE)
            ear.close()
    body = "\n".join(lines(found, ear))
    print(body)
    if options.write:
        write_part("speed.md", "rates", body.splitlines())
    return 1 if far(found) else 0


if __name__ == "__main__":
    sys.exit(main())
