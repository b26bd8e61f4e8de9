"""How every node runs: discovery on this machine only, one clean stop, exit codes that say which.

Exit codes: 0 stopped as asked, 1 failed while running, 2 refused its parameters or arguments.
"""

import gc
import itertools
import os
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

from tripod_graph.log_place import check_log_place
from tripod_graph.loopback import check_loopback, keep_local
from tripod_graph.namespace import full_namespace
from tripod_host.failures import failure_words
from tripod_host.open_files import OpenFilesError, check_open_files
from tripod_host.stop import Asked, end_at_once, first, taken

if TYPE_CHECKING:
    from rclpy.executors import Executor
    from rclpy.node import Node

FAILED = 1
REFUSED = 2
LAST_TURNS = 2
"""Turns of the executor that a node has after its `leave`: one for the result of a goal, one for its answer."""


class Closable(Protocol):
    """A node with something to leave in order: a port, a file, a terminal.

    One that has `leave()` is asked to tell its clients first, while they can be answered.
    """

    def close(self) -> None:
        """Park, flush and release; called once, also after a failure."""


class Companion(Protocol):
    """What runs beside a node, in its thread."""

    def tend(self) -> None:
        """Do what is due; called at least every 0.1 s."""

    def close(self) -> None:
        """Leave the graph, if it is there still."""


def split_ros(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the program's own words, and those between `--ros-args` and `--` or the end.

    >>> split_ros(["port:=mock", "--ros-args", "-r", "__ns:=/left", "--", "rate:=25", "--ros-args"])
    (['port:=mock', 'rate:=25'], ['-r', '__ns:=/left'])
    """
    own: list[str] = []
    ros: list[str] = []
    words = own
    for word in arguments:
        if word == "--ros-args":
            words = ros
        elif word == "--" and words is ros:
            words = own
        else:
            words.append(word)
    return own, ros


def ros_arguments(arguments: Sequence[str]) -> list[str]:
    """Turn `name:=value` words into ROS arguments; what stands between `--ros-args` and `--` passes unchanged.

    A word sets a parameter, `__ns:=` and `__node:=` remap. ROS refuses lists that mix `1` with `0.5`: their
    numbers become floats here.

    Raises:
        ValueError: a word is neither; ROS itself would ignore it silently.

    >>> ros_arguments(["port:=mock", "park:=[0, -0.5]"])
    ['--ros-args', '-p', 'port:=mock', '-p', 'park:=[0.0, -0.5]']
    """
    own, ros = split_ros(arguments)
    words: list[str] = []
    for word in own:
        name, assigns, value = word.partition(":=")
        if not (name and assigns):
            raise ValueError(f"argument {word!r} is not understood; set a parameter with NAME:=VALUE")
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


def run_node(
    name: str,
    make: Callable[[], Closable],
    arguments: Sequence[str] | None = None,
    *,
    until: Callable[[], bool] | None = None,
    again: Callable[[], bool] | None = None,
    beside: "Callable[[Executor], Companion] | None" = None,
) -> int:
    """Run one node until it is told to stop, and return its exit code.

    Args:
        name: For messages.
        make: Builds the node (after rclpy is ready); it may raise ValueError for bad parameters and OSError
            for a resource that is not there.
        arguments: Command line without the program; `name:=value` sets a parameter, `--subnet` opens
            discovery. None takes sys.argv.
        until: Says when it shall stop by itself; None: never.
        again: Says, when it has stopped by itself, whether `make` shall build another in its place; None: never.
        beside: Makes what runs beside the node in the same executor, once the node is there; it leaves before that.

    SIGINT, SIGTERM and SIGHUP (a closed terminal; not under nohup) end it in order. While the node is being built there
    is no order yet: what has been built by then is closed, and the process ends at once.
    """
    try:
        check_open_files()
    except OpenFilesError as error:
        return _refused(name, error)
    while True:
        code, stopped = _run_one(name, make, arguments, until, beside)
        if code or stopped or again is None or not again():
            return code


def _run_one(
    name: str,
    make: Callable[[], Closable],
    arguments: Sequence[str] | None,
    until: Callable[[], bool] | None,
    beside: "Callable[[Executor], Companion] | None",
) -> tuple[int, bool]:
    """Run one node; return its exit code, and whether a signal stopped it."""
    end_at_once()
    words = list(sys.argv[1:] if arguments is None else arguments)
    keep_local(subnet="--subnet" in words or os.environ.get("TRIPOD_SUBNET") == "1")
    import rclpy  # noqa: PLC0415 - only after the range of discovery is set
    from rclpy.exceptions import NameValidationException, ParameterException  # noqa: PLC0415
    from rclpy.executors import ExternalShutdownException  # noqa: PLC0415

    from tripod_graph.executor import NodeExecutor  # noqa: PLC0415
    from tripod_graph.parameter_files import strangers  # noqa: PLC0415

    try:
        check_loopback()
        check_log_place(os.environ)
        files = _init([w for w in words if w != "--subnet"])
    except Exception as error:  # noqa: BLE001 - rclpy raises several private kinds for bad arguments
        return _refused(name, error), False
    _keep_bad_times_off()
    executor = NodeExecutor()
    node: Closable | None = None
    companion: Companion | None = None
    asked: Asked | None = None
    code, stopped = 0, False
    signals = ExitStack()
    try:
        try:
            with first(lambda: _close_nodes(name)):
                node = make()
                asked = signals.enter_context(taken(last=True))
        except (ValueError, OSError, NameValidationException, ParameterException) as error:
            return _refused(name, error), False
        executor.add_node(cast("Node", node))
        for line in strangers(files, cast("Node", node).get_fully_qualified_name()):
            cast("Node", node).get_logger().warning(line)
        if beside is not None:
            companion = beside(executor)
        while not (asked.count or (until is not None and until())):
            executor.spin_once(timeout_sec=0.1)
            if companion is not None:
                companion.tend()
        _take_leave(executor, node)
    except ExternalShutdownException:
        pass
    except Exception as error:  # noqa: BLE001 - whatever failed, the node is closed and the reason printed
        print(f"{name}: stopped by {type(error).__name__}: {failure_words(error)}", file=sys.stderr)
        code = FAILED
    finally:
        _leave(executor, companion)
        code = _close(name, node) or code
        rclpy.try_shutdown()
        stopped = bool(asked and asked.count)
        signals.close()
    return code, stopped


def _keep_bad_times_off() -> None:
    """Let nodes ignore times below 0 on /clock: rclpy raises an error, which would end them."""
    from rclpy.time_source import TimeSource  # noqa: PLC0415 - only after the range of discovery is set

    if TimeSource.clock_callback is not _hear_clock:
        TimeSource.clock_callback, TimeSource.hear_sound_clock = _hear_clock, TimeSource.clock_callback


def _hear_clock(source: Any, message: Any) -> None:
    if message.clock.sec >= 0:
        source.hear_sound_clock(message)


def _take_leave(executor: "Executor", node: Closable) -> None:
    """Do what has come by now, and let the node answer whom it would leave without."""
    executor.spin_once(timeout_sec=0.0)
    if leave := getattr(node, "leave", None):
        leave()
        for _ in range(LAST_TURNS):
            executor.spin_once(timeout_sec=0.0)


def _leave(executor: "Executor", companion: Companion | None) -> None:
    """End the companion and the executor: first, since it holds what the node destroys."""
    with suppress(Exception):
        if companion is not None:
            companion.close()
    with suppress(Exception):
        executor.shutdown()


def _close(name: str, node: Closable | None) -> int:
    """Close the node, if there is one, and return what that adds to the exit code."""
    try:
        if node is not None:
            node.close()
            if failure := getattr(node, "failure", ""):
                print(f"{name}: {failure}", file=sys.stderr)
                return FAILED
    except Exception as error:  # noqa: BLE001 - nothing is left to undo, but the exit code tells
        return _closing_failed(name, error)
    return 0


def _refused(name: str, error: Exception) -> int:
    print(f"{name}: {_one_line(error)}", file=sys.stderr)
    return REFUSED


def _init(words: Sequence[str]) -> list[Path]:
    """Make rclpy ready and return the parameter files that it has read; raises what is wrong with the words."""
    import rclpy  # noqa: PLC0415
    from rclpy.signals import SignalHandlerOptions  # noqa: PLC0415

    from tripod_graph.parameter_files import parameter_files, shared_names  # noqa: PLC0415
    from tripod_graph.parameters import SHARED  # noqa: PLC0415

    ros = ros_arguments(words)
    _check_namespaces(ros)
    files = parameter_files(ros)
    try:
        rclpy.init(args=ros, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        if str(error).startswith("["):  # UnknownROSArgsError, which rclpy does not export
            raise ValueError(f"ROS does not know the argument {str(error)[1:-1]}") from None
        raise
    SHARED.set(shared_names(files))
    return files


def _check_namespaces(ros: Sequence[str]) -> None:
    """Raise ValueError for a namespace that ROS would refuse in several lines, or only when the node is made."""
    for option, rule in itertools.pairwise(ros):
        name, assigns, value = rule.partition(":=")
        if option in ("-r", "--remap") and assigns and name.rpartition(":")[2] in ("__ns", "rosnamespace"):
            full = full_namespace(value)
            if value != full:
                raise ValueError(f"namespace {value!r} must begin with /; write {name}:={full}")


def _close_nodes(name: str) -> int:
    """Close the nodes that there are, however far they are built, so that others see them leave; return exit code."""
    from rclpy.node import Node  # noqa: PLC0415 - it is there: a node is being made

    code = 0
    for node in [thing for thing in gc.get_objects() if issubclass(type(thing), Node)]:
        try:
            cast(Closable, node).close()
        except AttributeError:
            pass  # it has not yet what there would be to close
        except Exception as error:  # noqa: BLE001 - nothing is left to undo, but the exit code tells
            code = _closing_failed(name, error)
        with suppress(Exception):
            node.destroy_node()
    return code


def _closing_failed(name: str, error: Exception) -> int:
    print(f"{name}: closing failed, {type(error).__name__}: {error}", file=sys.stderr)
    return FAILED


def _one_line(error: Exception) -> str:
    """Return what `error` says in one line, without places in the source of ROS or its parser, or pointers."""
    lines = [re.sub(r", at \S+:\d+|\. Error: .*", "", line.strip()) for line in str(error).splitlines()]
    return " ".join(line for line in lines if line.strip("^"))
