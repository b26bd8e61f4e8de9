"""What `tripod up --demo` sends, and listens to, beyond this machine: a capture in a namespace with a second interface.

Makes a network namespace with a loopback and a second interface that leads to nobody, runs the demo in it, counts the
packets on the second interface and the sockets by their address; then the same without multicast on loopback, with
`--subnet` (so that the capture is seen to see something), and with loopback down. Exit code 1 if anything without
`--subnet` left the machine, or could be reached from outside. Needs root,
iproute2 and tcpdump: `sudo .venv/bin/python benchmarks/loopback.py`.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

NAME = "tripod-capture"
HERE, THERE = "tripod0", "tripod1"
TRIPOD = Path(sys.executable).with_name("tripod")


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)


@contextmanager
def namespace() -> Iterator[list[str]]:
    """Make the namespace; yield the words that run a command in it."""
    ip("netns", "add", NAME)
    try:
        ip("-n", NAME, "link", "set", "lo", "up")
        ip("link", "add", HERE, "type", "veth", "peer", "name", THERE, "netns", NAME)
        ip("-n", NAME, "addr", "add", "10.99.0.2/24", "dev", THERE)
        ip("-n", NAME, "link", "set", THERE, "up")
        ip("link", "set", HERE, "up")
        ip("-n", NAME, "route", "add", "default", "via", "10.99.0.1")
        yield ["ip", "netns", "exec", NAME]
    finally:
        subprocess.run(["ip", "netns", "del", NAME], check=False)
        subprocess.run(["ip", "link", "del", HERE], check=False, stderr=subprocess.DEVNULL)


def sockets(inside: list[str]) -> Counter[str]:
    """Return how many sockets listen in the namespace, by protocol and address."""
    lines = subprocess.run(
        [*inside, "ss", "-Hlntu"], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    return Counter(f"{line.split()[0]} {line.split()[4].rpartition(':')[0].split('%')[0]}" for line in lines)


def packets(capture: Path) -> Counter[str]:
    """Return the IPv4 packets of a capture, by their destination."""
    read = ["tcpdump", "-n", "-r", str(capture), "ip"]
    lines = subprocess.run(read, capture_output=True, text=True, check=True).stdout.splitlines()
    return Counter(line.split(" > ")[1].split(":")[0].rpartition(".")[0] for line in lines)


def demo(
    seconds: float, *words: str, before: tuple[str, ...] = ()
) -> tuple[Counter[str], Counter[str], str, int]:
    """Run the demo in a new namespace; return sockets, packets, its last line, and its exit code."""
    with tempfile.TemporaryDirectory() as place, namespace() as inside:
        capture = Path(place) / "capture"
        if before:
            ip("-n", NAME, "link", "set", "lo", *before)
        watch = [*inside, "tcpdump", "-Z", "root", "-U", "-i", THERE, "-w", str(capture)]
        watching = subprocess.Popen(watch, stderr=subprocess.DEVNULL)
        time.sleep(1.0)
        command = [
            *inside,
            str(TRIPOD),
            "up",
            "--demo",
            "--duration",
            f"{seconds:g}",
            "--record",
            place,
            *words,
        ]
        environment = {**os.environ, "ROS_DOMAIN_ID": "97"}
        running = subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        most: Counter[str] = Counter()
        while running.poll() is None:
            time.sleep(1.0)
            most |= sockets(inside)
        said = running.communicate()[0].splitlines()
        time.sleep(1.0)
        watching.terminate()
        watching.wait()
        return most, packets(capture), said[-1] if said else "", running.returncode


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=15.0, help="of each demo (default: %(default)s)")
    options = parser.parse_args()
    left = 0
    for title, words, before in (
        ("as it is", (), ()),
        ("no multicast on loopback", (), ("multicast", "off")),
        ("--subnet", ("--subnet",), ()),
        ("loopback down", (), ("down",)),
    ):
        most, sent, last, code = demo(options.seconds, *words, before=before)
        print(f"{title}: exit code {code}")
        print("  sockets:", ", ".join(f"{n} {name}" for name, n in sorted(most.items())) or "none")
        print(
            "  packets on the second interface:",
            ", ".join(f"{n} to {a}" for a, n in sorted(sent.items())) or "none",
        )
        if code:
            print("  said:", last)
        if "--subnet" not in words:
            left += sum(sent.values()) + sum(n for name, n in most.items() if "127.0.0.1" not in name)
    return 1 if left else 0


if __name__ == "__main__":
    sys.exit(main())
