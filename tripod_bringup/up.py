"""`tripod up`: the whole chain as supervised processes, one status line, and an exit code that says why.

Exit codes: 0 stopped as asked; 1 this process itself failed; 2 bad arguments, or nothing could start;
3 another `tripod up` on the domain, in the same namespace; 10 sim, 11 ik, 12 driver, 13 view, 14 record
ended by itself, did not come up or could not stop in order (12 too: no robot answered in all of --duration, or in a
demo that has played; 14 too: the recording is not whole, or not where it began);
20 the demo ran but not the whole chain did; 130 killed by a second Ctrl-C.
"""

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from tripod_bringup.demo_report import report_demo
from tripod_bringup.doctor import ENOUGH_SPACE
from tripod_bringup.lock import DomainBusyError, DomainError, domain_id, only_one
from tripod_bringup.log_lines import Level, parse
from tripod_bringup.node_values import node_arguments, node_package, read
from tripod_bringup.process import ProcessSpec
from tripod_bringup.screen import Screen
from tripod_bringup.status_line import status_line
from tripod_bringup.supervisor import Ending, Supervisor
from tripod_graph import names
from tripod_graph.log_place import LogPlaceError, check_log_place
from tripod_graph.loopback import LoopbackError, check_loopback, keep_local
from tripod_host.locks import private_directory
from tripod_host.open_files import OpenFilesError, check_open_files
from tripod_host.priority import stand_back
from tripod_host.stop import taken
from tripod_record.errors import RecordError
from tripod_record.place import check_place

if TYPE_CHECKING:
    from rclpy.executors import Executor

    from tripod_bringup.demo import DemoNode
    from tripod_bringup.script_player import ScriptPlayer
    from tripod_bringup.watch import Watch
    from tripod_play.joint_path import JointPath

FAILED = 1
BAD_ARGUMENTS = 2
ALREADY_UP = 3
CHAIN_INCOMPLETE = 20
EXIT_CODES: Mapping[str, int] = {"sim": 10, "ik": 11, "driver": 12, "view": 13, "record": 14}
DEMO_TIME = 20.0
"""How long the demo's targets last where no terminal is attached [s]."""


@dataclass(frozen=True)
class UpOptions:
    """What `tripod up` shall do.

    Attributes:
        record: Directory of recordings, None for no recording.
        view: Whether to serve the page.
        view_port: Where, None for the default of the view.
        demo: Whether to play the scripted session.
        script: A motion to play once everything is up, None without.
        namespace: Of all nodes, with its leading slash: two robots in one domain have two.
        duration: How long the chain (or with `demo` the targets) shall run [s], None until told.
        subnet: Whether ROS discovery may leave this machine.
        values: Parameters, by node and name.
        verbose: Whether to show what the nodes log as information.
        undriven: Why no driver runs, empty if one does.
    """

    record: Path | None = None
    view: bool = True
    view_port: int | None = None
    demo: bool = False
    script: "JointPath | None" = None
    namespace: str = "/"
    duration: float | None = None
    subnet: bool = False
    values: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    verbose: bool = False
    undriven: str = ""


@dataclass
class Facts:
    """What the nodes told about themselves.

    Attributes:
        page: Address of the page.
        recording: Path of the recording.
        recorded: What the recorder said at its end: how much is kept, how much is lost and why.
        cut_short: Whether the recorder did not end in order.
        last: The newest line shown of each node.
    """

    page: str = ""
    recording: str = ""
    recorded: str = ""
    cut_short: bool = False
    last: dict[str, str] = field(default_factory=dict)


def up(options: UpOptions, screen: Screen) -> int:
    """Bring the chain up, keep it up, take it down; return the exit code. Call it in the main thread."""
    try:
        check_open_files()
        check_loopback()
        check_log_place(os.environ)
        domain = domain_id(os.environ)
        with taken(last=True), only_one(domain, options.namespace, private_directory(os.environ)):
            if options.record is not None:
                check_place(options.record, ENOUGH_SPACE)
            return _run(options, screen)
    except DomainBusyError as error:
        print(f"tripod up: {error}", file=sys.stderr)
        return ALREADY_UP
    except (DomainError, LogPlaceError, LoopbackError, OpenFilesError, RecordError) as error:
        print(f"tripod up: {error}", file=sys.stderr)
        return BAD_ARGUMENTS
    except OSError as error:
        if not error.filename:  # not of a file that is needed: this process failed
            raise
        print(f"tripod up: {error.filename}: {error.strerror}", file=sys.stderr)
        return BAD_ARGUMENTS


def stages(options: UpOptions, facts: Facts, watch: "Watch") -> list[list[ProcessSpec]]:
    """Return what to start, in order: the recorder sees all, the driver moves last."""
    place = [] if options.namespace == "/" else [f"__ns:={options.namespace}"]

    simulated = read(str(options.values.get("sim", {}).get("publish_clock", "false"))) is True

    def spec(name: str, values: Mapping[str, object], **more: object) -> ProcessSpec:
        asked = options.values.get(name, {})
        given = {**values, **({"use_sim_time": True} if name != "sim" and simulated else {}), **asked}
        arguments = [*place, *node_arguments(given), *(["--subnet"] if options.subnet else [])]
        return ProcessSpec(name, f"{node_package(name)}.node", arguments, EXIT_CODES[name], **more)  # type: ignore[arg-type]

    own = {"topics", "exclude"} & set(options.values.get("record", {}))
    waits = options.record is not None and not own  # else the recorder may be told not to listen

    def heard(topic: str) -> bool:
        return watch.heard(topic) and (not waits or watch.is_recorded(topic))

    record = spec(  # which gives up a disk that stands still by itself; the end of a long file takes long
        "record", {"directory": options.record}, ready=lambda: bool(facts.recording), stop_time=120.0
    )
    sim = spec("sim", {}, ready=lambda: heard(names.SIM_STATUS))
    ik = spec("ik", {}, ready=lambda: watch.is_published(names.IK_STATUS))
    view_values = {} if options.view_port is None else {"port": options.view_port}
    view = spec("view", view_values, ready=lambda: bool(facts.page))
    driver = spec("driver", {}, ready=lambda: heard(names.ROBOT_STATUS), stop_time=10.0)
    return [
        [record] if options.record is not None else [],
        [sim, ik, *([view] if options.view else [])],
        [] if options.undriven else [driver],
    ]


def _run(options: UpOptions, screen: Screen) -> int:
    facts = Facts()
    if options.undriven:
        screen.line(options.undriven)
    with _graph(options, screen.line) as graph:
        supervisor = Supervisor(
            stages(options, facts, graph.watch),
            on_line=lambda name, line: _show(name, line, facts, options, screen),
            on_tick=lambda phase: screen.status(phase or (lambda: status_line(graph.watch.status()))),
            before_stop=graph.say_stop,
        )
        graph.watch.describe_processes(
            lambda: {name: process.end for name, process in dict(supervisor.processes).items()}
        )
        until = _Until(options.duration, graph, lambda: screen.line(_next_step(options)))
        ending = _judged(supervisor.run(until), over=until.over, absence=graph.watch.absence)
    if graph.failure and not ending.code:
        ending = Ending(FAILED, graph.failure)
    recorder = supervisor.processes.get("record")
    facts.cut_short = recorder is not None and not recorder.left_in_order
    screen.close()
    return _report(ending, graph.demo, facts, options, screen)


@dataclass
class Graph:
    """The nodes of this process.

    Attributes:
        watch: Hears every status, says STOP.
        demo: Plays the demo, None without.
        failure: Why the thread that runs them ended, empty while it runs.
        player: Plays the script, None without.
    """

    watch: "Watch"
    demo: "DemoNode | None"
    failure: str = ""
    player: "ScriptPlayer | None" = None

    def say_stop(self) -> None:
        """End the demo and tell everybody to hold."""
        if self.demo is not None:
            self.demo.finish()
        self.watch.say_stop()


@contextmanager
def _graph(options: UpOptions, say: Callable[[str], None]) -> Iterator[Graph]:
    """Run the nodes of this process in a thread of their own."""
    keep_local(subnet=options.subnet)
    import rclpy  # noqa: PLC0415
    from rclpy.signals import SignalHandlerOptions  # noqa: PLC0415

    from tripod_bringup.watch import Watch  # noqa: PLC0415
    from tripod_graph.executor import NodeExecutor  # noqa: PLC0415

    place = ["--ros-args", "-r", f"__ns:={options.namespace}"]
    rclpy.init(args=place, signal_handler_options=SignalHandlerOptions.NO)
    executor = NodeExecutor()
    over = threading.Event()

    def spin() -> None:
        stand_back()
        try:
            while not over.is_set():
                executor.spin_once(timeout_sec=0.1)
                if graph.player:
                    graph.player.tend()
        except Exception as error:  # noqa: BLE001 - whatever failed in a callback, the chain is stopped in order
            graph.failure = f"{type(error).__name__} in a node of this process: {error}"

    thread = threading.Thread(target=spin, name="graph", daemon=True)
    try:
        graph = Graph(Watch(), _demo(options), player=_player(options, executor, say))
        for node in (graph.watch, graph.demo):
            if node is not None:
                executor.add_node(node)
        thread.start()
        yield graph
    finally:
        over.set()
        if thread.is_alive():
            thread.join(2.0)
        executor.shutdown()
        rclpy.try_shutdown()


def _demo(options: UpOptions) -> "DemoNode | None":
    if not options.demo:
        return None
    from tripod_bringup.demo import DemoNode  # noqa: PLC0415

    return DemoNode(options.duration)


def _player(options: UpOptions, executor: "Executor", say: Callable[[str], None]) -> "ScriptPlayer | None":
    if options.script is None:
        return None
    from tripod_bringup.script_player import ScriptPlayer  # noqa: PLC0415

    return ScriptPlayer(options.script, executor, say)


@dataclass
class _Until:
    """Says when the chain shall stop; called once everything is up, and then again and again.

    Attributes:
        duration: How long it shall run [s], None until told.
        graph: The nodes of this process.
        on_start: Called once, when everything is up.
        over: Whether the time was up, or the demo had played.
    """

    duration: float | None
    graph: Graph
    on_start: Callable[[], None] = lambda: None
    over: bool = False
    _since: float | None = None

    def __call__(self) -> str:
        if self._since is None:
            self._since = time.monotonic()
            self.on_start()
        if self.graph.failure:
            return self.graph.failure
        if player := self.graph.player:
            player.wanted = True
        if demo := self.graph.demo:
            demo.go()
            self.over = demo.session.finished
            return "the demo is over" if self.over else ""
        self.over = self.duration is not None and time.monotonic() - self._since >= self.duration
        return f"{self.duration:g} s are over" if self.over else ""


def _next_step(options: UpOptions) -> str:
    """Return what the user can do now that everything runs."""
    if options.demo:
        does = "the robot follows a circle" + ("; see it on the page" if options.view else "")
    elif options.script:
        does = "the robot plays the script" + ("; see it on the page" if options.view else "")
    elif options.view:
        does = "everything runs; open the page and click Move the robot"
    else:
        does = "everything runs; steer it from another terminal: tripod teleop"
    return f"{does}; Ctrl-C ends everything"


def _judged(ending: Ending, *, over: bool, absence: str) -> Ending:
    """Return how the run ended: not well where its time is `over` and no robot has answered, which `absence` explains.

    Who waits until told, by Ctrl-C, may still plug the board in.
    """
    if ending.code or not over or not absence:
        return ending
    return Ending(EXIT_CODES["driver"], f"{ending.cause}, and no robot answered: {absence}")


def _show(name: str, line: str, facts: Facts, options: UpOptions, screen: Screen) -> None:
    parsed = parse(line)
    text = f"[{name}] {parsed.text}"
    if facts.last.get(name) == text:  # nodes both print and log what matters
        return
    facts.last[name] = text
    if parsed.fact == "page":
        facts.page = parsed.value
        screen.line(parsed.text)
    elif parsed.fact == "recording":
        facts.recording = parsed.value
        screen.line(parsed.text)
    else:
        if parsed.fact == "recorded":
            facts.recorded = parsed.value
        if parsed.level >= Level.WARN or options.verbose:
            screen.line(text)


def _report(ending: Ending, demo: "DemoNode | None", facts: Facts, options: UpOptions, screen: Screen) -> int:
    said = [parsed.text for parsed in map(parse, ending.output) if parsed.level >= Level.ERROR]
    stopped = ": ".join(["stopped", ending.cause, *said[-1:]])
    if facts.cut_short and facts.recording and not facts.recorded:
        stopped += f"; the recording may be incomplete: {facts.recording}"
    if ending.code:
        print(f"tripod up: {stopped}", file=sys.stderr)
    else:
        screen.line(stopped)
    if demo is None:
        return ending.code
    ran = report_demo(
        demo.measured,
        recording=facts.recording,
        lost=facts.recorded if facts.cut_short else "",
        expect_recording=options.record is not None,
        screen=screen,
    )
    return ending.code or (0 if ran else CHAIN_INCOMPLETE)
