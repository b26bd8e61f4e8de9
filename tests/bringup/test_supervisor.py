"""The supervisor with fake children: order, codes, signals, and that nothing is left behind."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests.bringup.processes import DEADLINE, alive, wait_until
from tests.messages import assert_names, names
from tripod_bringup.process import ProcessSpec
from tripod_bringup.supervisor import KILLED_BY_USER, Ending, Supervisor
from tripod_host.stop import Asked

HERE = Path(__file__).parent


@pytest.fixture(autouse=True)
def children_can_be_imported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(HERE))


class Log:
    """What the fake children noted."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def events(self) -> list[str]:
        """Return events and names without process ids, such as "started sim"."""
        return [" ".join(line.split()[:2]) for line in self._lines()]

    def pids(self) -> set[int]:
        return {int(line.split()[2]) for line in self._lines()}

    def has(self, event: str) -> bool:
        return event in self.events()

    def _lines(self) -> list[str]:
        return self.path.read_text().splitlines() if self.path.exists() else []


@pytest.fixture
def log(tmp_path: Path) -> Log:
    return Log(tmp_path / "events")


def spec(log: Log, name: str, *options: str, code: int = 1, **more: object) -> ProcessSpec:
    more.setdefault("ready", lambda: log.has(f"started {name}"))
    return ProcessSpec(name, "fake_child", [name, str(log.path), *options], code, **more)  # type: ignore[arg-type]


def interrupt_when(condition: Callable[[], bool], number: int = signal.SIGINT) -> threading.Thread:
    def wait() -> None:
        if wait_until(condition):
            os.kill(os.getpid(), number)

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    return thread


def never() -> str:
    return ""


def test_stages_start_in_order_and_stop_in_reverse(log: Log) -> None:
    stages = [
        [spec(log, "record")],
        [spec(log, "sim"), spec(log, "ik")],
        [spec(log, "driver", "--stop-time", "0.3")],
    ]
    stopped: list[list[str]] = []
    supervisor = Supervisor(stages, before_stop=lambda: stopped.append(log.events()))
    ending = supervisor.run(lambda: "enough" if supervisor.running else "")
    assert ending == Ending(0, "enough")
    events = log.events()
    assert events[0] == "started record"
    assert sorted(events[1:3]) == ["started ik", "started sim"]
    assert events[3] == "started driver"
    assert len(stopped) == 1 and stopped[0] == events[:4], "STOP is said before anybody is asked to stop"
    assert events[4:6] == ["asked driver", "ended driver"]
    assert sorted(events[6:10]) == ["asked ik", "asked sim", "ended ik", "ended sim"]
    assert events[10:] == ["asked record", "ended record"]


@pytest.mark.parametrize(("victim", "code"), [("record", 14), ("sim", 10), ("driver", 12)])
def test_death_of_a_child_stops_the_others_and_gives_its_code(log: Log, victim: str, code: int) -> None:
    codes = {"record": 14, "sim": 10, "driver": 12}
    options = {victim: ["--die-with", "driver", "--code", "3"]}
    stages = [[spec(log, name, *options.get(name, []), code=codes[name])] for name in codes]
    ending = Supervisor(stages).run(never)
    assert ending.code == code
    assert_names(ending.cause, victim, "code 3")
    assert ending.output == [f"{victim} breaks"]
    others = [name for name in ("driver", "sim", "record") if name != victim]
    assert [e for e in log.events() if e.startswith("ended")] == [f"ended {name}" for name in others]
    assert not any(map(alive, log.pids()))


def test_a_child_that_exits_with_0_unasked_counts_as_dead(log: Log) -> None:
    ending = Supervisor([[spec(log, "sim", "--die-after", "0.2", code=10)]]).run(never)
    assert ending.code == 10
    assert_names(ending.cause, "sim", "code 0")


def test_a_child_killed_by_a_signal_is_reported_by_its_name(log: Log) -> None:
    supervisor = Supervisor([[spec(log, "ik", code=11)]])

    def kill() -> str:
        os.kill(supervisor.processes["ik"].pid, signal.SIGKILL)
        return ""

    ending = supervisor.run(kill)
    assert ending.code == 11
    assert_names(ending.cause, "ik", "SIGKILL")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_stops_in_order_with_code_0_and_does_not_reach_the_children(log: Log, number: int) -> None:
    interrupt_when(lambda: log.has("started driver"), number)
    ending = Supervisor([[spec(log, "sim")], [spec(log, "driver")]]).run(never)
    assert ending.code == 0
    assert_names(ending.cause, "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name)
    assert log.events()[2:] == ["asked driver", "ended driver", "asked sim", "ended sim"]


def signals_are_one_within(seconds: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let signals that come `seconds` after each other still be one interruption."""
    monkeypatch.setattr("tripod_host.stop.Asked", partial(Asked, together=seconds))


def test_a_second_interruption_kills(log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    signals_are_one_within(0.0, monkeypatch)
    supervisor = Supervisor([[spec(log, "driver", "--deaf", stop_time=60.0)]])
    interrupt_when(lambda: log.has("started driver"))
    interrupt_when(lambda: log.has("asked driver"))
    ending = supervisor.run(never)
    assert ending.code == KILLED_BY_USER, "it did not wait for the 60 s, which give another code"
    assert not any(map(alive, log.pids()))


def test_two_signals_at_once_are_one_interruption(log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    signals_are_one_within(DEADLINE, monkeypatch)

    def both() -> bool:
        if log.has("started driver"):
            os.kill(os.getpid(), signal.SIGINT)
            return True
        return False

    interrupt_when(both, signal.SIGTERM)
    ending = Supervisor([[spec(log, "driver", "--stop-time", "0.3")]]).run(never)
    assert ending.code == 0
    assert log.has("ended driver")


def test_a_child_that_does_not_stop_is_killed_and_named(log: Log) -> None:
    stages = [[spec(log, "record")], [spec(log, "driver", "--deaf", code=12, stop_time=0.4)]]
    ending = Supervisor(stages).run(lambda: "enough")
    assert ending.code == 12
    assert_names(ending.cause, "driver", "stop", "0.4 s")
    assert log.events()[-1] == "ended record", "the rest stops in order all the same"


def test_a_child_that_is_frozen_is_given_up_soon_and_one_that_waits_is_not(
    log: Log, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tripod_bringup.supervisor.FROZEN", 0.6)
    frozen = spec(log, "record", code=14, stop_time=60.0)
    waits = spec(log, "driver", "--stop-time", "1.5", code=12, stop_time=60.0)
    supervisor = Supervisor([[frozen], [waits]])

    def freeze() -> str:
        os.kill(supervisor.processes["record"].pid, signal.SIGSTOP)
        return "enough"

    ending = supervisor.run(freeze)
    assert ending.code == 14
    assert_names(ending.cause, "record", "stopping", "0.6 s")  # not the 60 s that it might work to stop
    assert log.events()[-1] == "ended driver", "it was waited for, and the frozen one could not even hear"
    assert not any(map(alive, log.pids()))


def test_a_child_that_fails_while_stopping_is_named(log: Log) -> None:
    ending = Supervisor([[spec(log, "driver", "--stop-code", "1", code=12)]]).run(lambda: "enough")
    assert ending.code == 12
    assert_names(ending.cause, "driver", "code 1", "stopping")


def test_a_child_that_is_stopped_before_it_can_listen_is_not_blamed(log: Log) -> None:
    ending = Supervisor([[spec(log, "sim", "--starting", code=10)]]).run(lambda: "enough")
    assert ending == Ending(0, "enough")
    assert not any(map(alive, log.pids()))


def test_a_child_that_never_becomes_ready_ends_the_start(log: Log) -> None:
    slow = spec(log, "sim", code=10, ready=lambda: False, start_time=0.5)
    phases: set[str] = set()
    supervisor = Supervisor([[slow], [spec(log, "driver")]], on_tick=phases.add)
    ending = supervisor.run(never)
    assert ending.code == 10
    assert_names(ending.cause, "sim", "0.5 s")
    assert "started driver" not in log.events()
    assert any(names(phase, "waiting for sim") for phase in phases)


def test_a_start_that_works_is_waited_for_however_long_it_takes(log: Log) -> None:
    busy = spec(log, "sim", "--work", "1.5", start_time=0.5)
    assert Supervisor([[busy]]).run(lambda: "enough") == Ending(0, "enough")
    assert log.has("started sim")


def test_a_start_that_works_for_long_shows_it(log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tripod_bringup.supervisor.LONG_START", 0.3)
    phases: set[str] = set()

    def shown() -> bool:
        return any(names(phase, "waiting for sim", "1 s") for phase in phases)

    busy = spec(log, "sim", "--work", "20", ready=shown, start_time=1.0)
    ending = Supervisor([[busy]], on_tick=phases.add).run(lambda: "enough")
    assert ending == Ending(0, "enough"), phases


def test_lines_arrive_with_the_name_of_their_process(log: Log) -> None:
    heard: list[tuple[str, str]] = []
    child = spec(log, "view", "--say", "page http://127.0.0.1:8080", "--say", "ünï")
    Supervisor([[child]], on_line=lambda *pair: heard.append(pair)).run(lambda: "enough")
    assert heard == [("view", "page http://127.0.0.1:8080"), ("view", "ünï")]


def test_a_failing_callback_still_stops_the_children_in_order(log: Log) -> None:
    def fail(_phase: str) -> None:
        if log.has("started driver"):
            raise RuntimeError("broken screen")

    with pytest.raises(RuntimeError) as caught:
        Supervisor([[spec(log, "driver", ready=lambda: False)]], on_tick=fail).run(never)
    assert str(caught.value) == "broken screen"
    assert log.has("ended driver")
    assert not any(map(alive, log.pids()))


def test_only_the_main_thread_may_run_a_supervisor() -> None:
    caught: list[str] = []

    def run() -> None:
        try:
            Supervisor([]).run(lambda: "enough")
        except RuntimeError as error:
            caught.append(str(error))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    (why,) = caught
    assert_names(why, "supervisor", "main thread", "signals")


ORPHANS = """
import sys
from tripod_bringup.process import ProcessSpec
from tripod_bringup.supervisor import Supervisor
log = sys.argv[1]
polite = ProcessSpec("driver", "fake_child", ["driver", log])
deaf = ProcessSpec("sim", "fake_child", ["sim", log, "--deaf"])
Supervisor([[polite, deaf]]).run(lambda: "")
"""


def test_no_orphan_survives_the_death_of_the_supervisor(log: Log) -> None:
    root = str(HERE.parents[1])
    environment = dict(os.environ, PYTHONPATH=os.pathsep.join([str(HERE), root]), TRIPOD_GRACE="0.5")
    holder = subprocess.Popen([sys.executable, "-c", ORPHANS, str(log.path)], env=environment)
    try:
        assert wait_until(lambda: log.has("started driver") and log.has("started sim"))
        assert all(map(alive, log.pids()))
    finally:
        holder.kill()
        holder.wait()
    assert wait_until(lambda: not any(map(alive, log.pids())))
    assert log.has("ended driver"), "the polite child was asked and stopped in order"
    assert log.has("asked sim"), "the deaf child was asked before it was killed"
