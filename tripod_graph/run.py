"""How every node runs: discovery on this machine only, one clean stop, exit codes that say which.

Exit codes: 0 stopped as asked, 1 failed while running, 2 refused its parameters or arguments.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Sequence
from typing import Protocol, cast

FAILED = 1
REFUSED = 2


class Closable(Protocol):
    """A node with something to leave in order: a port, a file, a terminal."""

    def close(self) -> None:
        """Park, flush and release; called once, also after a failure."""


def keep_local(*, subnet: bool = False) -> None:
    """Choose how far ROS discovery reaches; call it before the first `rclpy.init`.

    LOCALHOST unless `subnet`: then machines of the same subnet find each other.
    """
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SUBNET" if subnet else "LOCALHOST"


def ros_arguments(arguments: Sequence[str]) -> list[str]:
    """Turn `name:=value` words into ROS arguments; what follows `--ros-args` passes unchanged.

    A word sets a parameter, `__ns:=` and `__node:=` remap. ROS refuses lists that mix `1` with `0.5`: their
    numbers become floats here.

    Raises:
        ValueError: a word is neither; ROS itself would ignore it silently.

    >>> ros_arguments(["port:=mock", "park:=[0, -0.5]"])
    ['--ros-args', '-p', 'port:=mock', '-p', 'park:=[0.0, -0.5]']
    """
    own = list(arguments)
    cut = own.index("--ros-args") if "--ros-args" in own else len(own)
    own, ros = own[:cut], own[cut + 1 :]
    words: list[str] = []
    for word in own:
        name, assigns, value = word.partition(":=")
        if not (name and assigns):
            raise ValueError(f"argument {word!r} is not understood; NAME:=VALUE sets a parameter")
        words += ["-r" if name.startswith("__") else "-p", f"{name}:={_floats(value)}"]
    return ["--ros-args", *words, *ros] if words or ros else []


def _floats(value: str) -> str:
    """Return a list of numbers as floats unless all are integers; anything else as it is."""
    if not (value.startswith("[") and value.endswith("]")):
        return value
    items = value[1:-1].split(",")
    if all(item.strip().lstrip("+-").isdigit() for item in items):
        return value
    try:
        return str([float(item) for item in items])
    except ValueError:
        return value


def run_node(name: str, make: Callable[[], Closable], arguments: Sequence[str] | None = None) -> int:
    """Run one node until it is told to stop, and return its exit code.

    Args:
        name: For messages.
        make: Builds the node (after rclpy is ready); it may raise ValueError for bad parameters and OSError
            for a resource that is not there.
        arguments: Command line without the program; `name:=value` sets a parameter, `--subnet` opens
            discovery. None takes sys.argv.

    SIGINT, SIGTERM and SIGHUP (a closed terminal; not under nohup) end it in order.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    keep_local(subnet="--subnet" in words or os.environ.get("TRIPOD_SUBNET") == "1")
    stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number is not signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: stop.set())
    import rclpy  # noqa: PLC0415 - only after the range of discovery is set
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor  # noqa: PLC0415
    from rclpy.node import Node  # noqa: PLC0415
    from rclpy.signals import SignalHandlerOptions  # noqa: PLC0415

    try:
        rclpy.init(
            args=ros_arguments([w for w in words if w != "--subnet"]),
            signal_handler_options=SignalHandlerOptions.NO,
        )
    except Exception as error:  # noqa: BLE001 - rclpy raises several private kinds for bad arguments
        print(f"{name}: {error}", file=sys.stderr)
        return REFUSED
    executor = SingleThreadedExecutor()
    node: Closable | None = None
    code = 0
    try:
        try:
            node = make()
        except (ValueError, OSError) as error:
            print(f"{name}: {error}", file=sys.stderr)
            return REFUSED
        executor.add_node(cast(Node, node))
        while not stop.is_set():
            executor.spin_once(timeout_sec=0.1)
    except ExternalShutdownException:
        pass
    except Exception as error:  # noqa: BLE001 - whatever failed, the node is closed and the reason printed
        print(f"{name}: stopped by {type(error).__name__}: {error}", file=sys.stderr)
        code = FAILED
    finally:
        try:
            if node is not None:
                node.close()
        except Exception as error:  # noqa: BLE001 - nothing is left to undo, but the exit code tells
            print(f"{name}: closing failed, {type(error).__name__}: {error}", file=sys.stderr)
            code = FAILED
        finally:
            executor.shutdown()
            rclpy.try_shutdown()
    return code
