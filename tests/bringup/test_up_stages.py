"""What `tripod up` starts, in which order and with which parameters; and when it decides to stop."""

import errno
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.bringup.processes import wait_until
from tests.messages import assert_names, line_naming, lines_naming, raises_naming
from tests.record.bags import STRING, cdr_string
from tripod_bringup import up as up_module
from tripod_bringup import up_command
from tripod_bringup.demo_summary import Measurements
from tripod_bringup.node_values import RawYaml, node_package
from tripod_bringup.screen import Screen
from tripod_bringup.supervisor import Ending
from tripod_bringup.up import EXIT_CODES, Facts, Graph, UpOptions, _judged, _report, _show, _Until, stages
from tripod_graph import names
from tripod_ik import settings
from tripod_record.recorder import Recorder
from tripod_record.writer import BagWriter
from tripod_sim.tables.joints import Actuator


class FakeWatch:
    """What `stages` asks of the watch: which topics were heard or are offered, and which the recorder hears."""

    def __init__(self) -> None:
        self.topics: set[str] = set()
        self.recorded: set[str] = set()

    def heard(self, topic: str) -> bool:
        return topic in self.topics

    def is_published(self, topic: str) -> bool:
        return topic in self.topics

    def is_recorded(self, topic: str) -> bool:
        return topic in self.recorded


def started(options: UpOptions, facts: Facts | None = None, watch: FakeWatch | None = None) -> Any:
    return stages(options, facts or Facts(), watch or FakeWatch())  # type: ignore[arg-type]


def test_the_recorder_comes_first_and_the_driver_last() -> None:
    plan = started(UpOptions(record=Path("bags")))
    assert [[spec.name for spec in stage] for stage in plan] == [
        ["record"],
        ["sim", "ik", "view"],
        ["driver"],
    ]
    specs = [spec for stage in plan for spec in stage]
    assert {spec.name: spec.exit_code for spec in specs} == EXIT_CODES
    assert all(spec.module == f"{node_package(spec.name)}.node" for spec in specs)


def test_simulator_and_driver_wait_until_the_recorder_hears_them() -> None:
    watch = FakeWatch()
    watch.topics = {names.SIM_STATUS, names.ROBOT_STATUS}
    chosen = {"record": {"topics": "/tf"}}

    def ready(**options: Any) -> dict[str, bool]:
        plan = started(UpOptions(**options), watch=watch)
        return {spec.name: spec.ready() for stage in plan for spec in stage if spec.name in ("sim", "driver")}

    assert ready() == ready(record=Path("bags"), values=chosen) == {"sim": True, "driver": True}
    assert ready(record=Path("bags")) == {"sim": False, "driver": False}
    watch.recorded = {names.SIM_STATUS}
    assert ready(record=Path("bags")) == {"sim": True, "driver": False}
    watch.recorded |= watch.topics
    assert ready(record=Path("bags")) == {"sim": True, "driver": True}


def test_what_is_not_wanted_is_not_started() -> None:
    assert [[spec.name for spec in stage] for stage in started(UpOptions(view=False))] == [
        [],
        ["sim", "ik"],
        ["driver"],
    ]


def test_options_reach_their_nodes() -> None:
    options = UpOptions(
        record=Path("a b"),
        view_port=9000,
        subnet=True,
        values={"driver": {"port": "pty", "rate": RawYaml("25")}, "sim": {"scene": "2024"}},
    )
    arguments = {spec.name: spec.arguments for stage in started(options) for spec in stage}
    assert arguments == {
        "record": ['directory:="a b"', "--subnet"],
        "sim": ['scene:="2024"', "--subnet"],
        "ik": ["--subnet"],
        "view": ["port:=9000", "--subnet"],
        "driver": ['port:="pty"', "rate:=25", "--subnet"],
    }


def test_the_scene_of_the_simulator_is_that_of_the_models_of_inverse_kinematics() -> None:
    soft = ["material.young=3e5"]
    settled = {"sim": {"set": "mesh.level=3;material.young=3e5"}, "ik": {"max_step": 0.1}}
    values = up_command.chain_values(settled, "silicone", soft, "pty")
    assert values["sim"] == {"scene": "silicone", "set": "mesh.level=3;material.young=3e5"}
    assert values["ik"] == {"scene": "silicone", "set": "material.young=3e5", "max_step": 0.1}
    assert values["driver"] == {"port": "pty"}, "three servos are its own default"
    four = up_command.chain_values({"driver": {"port": "mock"}}, "cross", [], "pty")
    assert four["driver"] == {"port": "mock", "servos": 4} and four["ik"] == {"scene": "cross"}
    other = up_command.chain_values({"ik": {"scene": "2024"}}, "silicone", soft, "mock")
    assert other["ik"] == {"scene": "2024"}, (
        "what is explicit wins, and overrides of another scene are not its"
    )


def test_a_driver_of_another_number_of_servos_than_the_scene_has_is_refused() -> None:
    values = up_command.node_values(["driver.servos:=5"])
    with raises_naming(ValueError, "driver.servos", 5, "scene 'tripod'", "3 servos"):
        up_command.chain_values(values, "tripod", [], "mock")
    same = up_command.node_values(["driver.servos:=4"])
    assert up_command.chain_values(same, "cross", [], "mock")["driver"]["servos"] == RawYaml("4")


def test_the_chain_keeps_to_the_angles_that_the_servos_of_the_scene_allow() -> None:
    wide = ["servos.angle_max=1.5", "servos.angle_min=-3.0"]
    values = up_command.chain_values({"sim": {"set": ";".join(wide)}}, "tripod", wide, "mock")
    for node in ("sim", "ik", "driver"):
        assert (values[node]["angle_min"], values[node]["angle_max"]) == (-3.0, 1.5), node
    explicit = up_command.chain_values({"driver": {"angle_max": 0.3}}, "tripod", [], "mock")
    assert explicit["driver"] == {"port": "mock", "angle_max": 0.3}
    assert explicit["ik"] == {"scene": "tripod"}, "those of the Tripod are the nodes' own"


def test_inverse_kinematics_takes_overrides_of_its_scene(capsys: pytest.CaptureFixture[str]) -> None:
    table = {p.name: p.default for p in settings.PARAMETERS}
    soft = settings.scene_of({**table, "set": "material.young=3e5; mesh.level=3"})
    assert (soft.material.young, soft.mesh.level) == (3e5, 3)
    code = up_command.up_command(
        ["ik.set:=material.young=-1"], scene="", port="mock", record=None, view=False, view_port=None, demo=False,
        namespace="", duration=1.0, subnet=False, verbose=False,
    )  # fmt: skip
    assert code == 2
    said = capsys.readouterr().err
    assert_names(said, "tripod up: ", "ik", "material.young", "-1.0", "above 0 Pa", "1e+13 Pa")
    assert said.count("\n") == 1


def test_a_namespace_is_that_of_every_node() -> None:
    plan = started(UpOptions(record=Path("bags"), namespace="/left"))
    assert all(spec.arguments[0] == "__ns:=/left" for stage in plan for spec in stage)


def test_a_node_is_ready_when_it_does_its_work() -> None:
    facts, watch = Facts(), FakeWatch()
    ready = {
        spec.name: spec.ready
        for stage in started(UpOptions(record=Path("bags")), facts, watch)
        for spec in stage
    }
    assert not any(check() for check in ready.values())
    facts.recording, facts.page = "a.mcap", "http://127.0.0.1:1"
    assert [name for name, check in ready.items() if check()] == ["record", "view"]
    watch.topics = watch.recorded = {names.SIM_STATUS, names.IK_STATUS, names.ROBOT_STATUS}
    assert all(check() for check in ready.values())


def fake_demo(*, finished: bool) -> Any:
    calls: list[str] = []
    return SimpleNamespace(
        go=lambda: calls.append("go"), calls=calls, session=SimpleNamespace(finished=finished)
    )


def graph(demo: Any = None, failure: str = "") -> Graph:
    return Graph(SimpleNamespace(), demo, failure)  # type: ignore[arg-type]


def test_without_duration_it_goes_on_and_with_one_it_ends() -> None:
    assert _Until(None, graph())() == ""
    assert _Until(60.0, graph())() == ""
    assert_names(_Until(0.0, graph())(), "0 s", "over")


def test_when_its_time_is_over_and_no_robot_has_answered_it_has_failed() -> None:
    until = _Until(0.0, graph())
    assert not until.over
    over, absent = Ending(0, until()), "/dev/nope does not exist"
    failed = _judged(over, over=until.over, absence=absent)
    assert failed.code == 12
    assert_names(failed.cause, "0 s", "no robot answered", absent)
    assert _judged(over, over=True, absence="") is over
    assert _judged(Ending(0, "Ctrl-C"), over=False, absence=absent).code == 0
    assert _judged(Ending(10, "sim died"), over=True, absence=absent).code == 10


def test_a_demo_begins_when_all_is_up_and_ends_when_it_is_over() -> None:
    demo = fake_demo(finished=False)
    assert _Until(0.0, graph(demo))() == "", "the duration is that of the targets"
    assert demo.calls == ["go"]
    until = _Until(None, graph(fake_demo(finished=True)))
    assert_names(until(), "demo", "over")
    assert until.over, "then it has failed, too, where no robot has answered"


def test_a_failure_in_a_node_of_this_process_ends_all() -> None:
    assert _Until(None, graph(fake_demo(finished=False), "KeyError in a node"))() == "KeyError in a node"


def test_without_ros_up_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def no_ros(*_: object) -> int:
        raise ModuleNotFoundError("No module named 'rclpy'")

    monkeypatch.setattr(up_command, "up", no_ros)
    code = up_command.up_command(
        [],
        scene="tripod",
        port="mock",
        record=None,
        view=True,
        view_port=None,
        demo=False,
        namespace="",
        duration=None,
        subnet=False,
        verbose=False,
    )
    assert code == 2
    error = capsys.readouterr().err
    assert_names(error, "tripod up: ", "rclpy", "make setup")
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ("[WARN] [1.5] [sim]: machine too slow", ""),
        ("[ERROR] [1.5] [sim]: no memory", "no memory"),
        ("sim: scene 'x' is unknown", "sim: scene 'x' is unknown"),
    ],
)
def test_why_a_node_ended_is_an_error_that_it_told_last_and_no_warning(
    said: str, why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    ending = Ending(10, "sim was ended by SIGKILL", ["recorded", said] if why else [said])
    assert _report(ending, None, Facts(), UpOptions(), Screen(terminal=False)) == 10
    told = capsys.readouterr().err
    assert_names(told, "tripod up: ", "sim", "SIGKILL")
    assert (told.count("\n"), told.strip().endswith(why or "SIGKILL")) == (1, True)


def test_a_recorder_that_did_not_end_in_order_is_told_with_its_recording(
    capsys: pytest.CaptureFixture[str],
) -> None:
    ending = Ending(14, "record was ended by SIGKILL", ["recording a.mcap"])
    facts = Facts(recording="a.mcap", cut_short=True)
    assert _report(ending, None, facts, UpOptions(), Screen(terminal=False)) == 14
    told = capsys.readouterr().err
    assert_names(told, "tripod up: ", "record", "SIGKILL", "incomplete", "a.mcap")
    assert told.count("\n") == 1


def test_of_a_recording_on_a_full_disk_recorder_demo_and_supervisor_say_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    recorder = Recorder(BagWriter(tmp_path / "bag", compression="none"), period=0.01)
    recorder.add_topic(STRING)
    for _ in range(5):
        recorder.offer("/chatter", cdr_string("kept"))
    assert wait_until(lambda: recorder.progress.messages == 5)
    write = os.pwrite

    def full(file: int, data: bytes, at: int) -> int:
        """Return what `os.pwrite` does on a disk without a free block: what is there can be overwritten."""
        if at + len(data) > os.fstat(file).st_size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(file, data, at)

    monkeypatch.setattr(os, "pwrite", full)
    for _ in range(20):
        recorder.offer("/chatter", cdr_string("lost"))
    failed = recorder.stop()
    facts, options = Facts(cut_short=True), UpOptions(record=tmp_path, demo=True)
    screen = Screen(terminal=False)
    said = [f"recording {failed.path}", f"[ERROR] [1.5] [record]: the recording ended: {failed.error}"]
    for line in said:
        _show("record", line, facts, options, screen)
    ending = Ending(14, "record exited with code 1 while stopping", said)
    demo = SimpleNamespace(measured=Measurements())
    assert _report(ending, demo, facts, options, screen) == 14  # type: ignore[arg-type]
    out, err = capsys.readouterr()
    line_naming(out, "recording ", failed.path, "5 messages", "not whole")
    told = lines_naming(out + err, failed.path, "No space left", "5 of 25 messages")
    assert len(told) == 3  # the recorder, the reason of the exit code, the demo
    assert not lines_naming(out + err, "not closed")
    assert not lines_naming(out + err, "incomplete")


def test_a_fault_of_this_process_is_not_told_as_one_of_a_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> int:
        raise OSError(errno.ENOMEM, "Cannot allocate memory")

    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setattr(up_module, "_run", fail)
    with pytest.raises(OSError, match="Cannot allocate memory"):
        up_module.up(UpOptions(), Screen(terminal=False))
    assert capsys.readouterr().err == ""


def test_who_has_started_everything_is_told_what_to_do_next() -> None:
    assert_names(up_module._next_step(UpOptions()), "page", "Move the robot", "Ctrl-C")
    assert_names(up_module._next_step(UpOptions(view=False)), "tripod teleop", "Ctrl-C")
    assert_names(up_module._next_step(UpOptions(demo=True)), "circle", "page")
    told: list[bool] = []
    until = _Until(None, SimpleNamespace(failure="", demo=None, player=None), lambda: told.append(True))  # type: ignore[arg-type]
    assert (until(), until(), told) == ("", "", [True])


@pytest.mark.parametrize(
    ("scene", "channels"),
    [
        ("finger_cable", "left m 0 0.03; right m 0 0.03"),
        ("finger_pneumatic", "air Pa 0 20000"),
    ],
)
def test_the_driver_knows_the_cables_and_chambers_of_the_scene(scene: str, channels: str) -> None:
    values = up_command.chain_values({}, scene, [], "mock")
    assert values["driver"] == {"port": "mock", "servos": 0, "channels": channels}
    assert "angle_min" not in values["sim"]


def test_what_no_board_drives_runs_without_a_driver() -> None:
    plan = started(UpOptions(undriven="push"))
    assert [[spec.name for spec in stage] for stage in plan] == [[], ["sim", "ik", "view"], []]
    tension = {"sim": {"set": "cable.0.command=tension"}}
    values = up_command.chain_values(tension, "examples/tendon_finger.toml", [], "mock")
    assert "channels" not in values["driver"]
    pulled = Actuator("tendon", "N", 0.0, 5.0, 0.0, is_effort=True)
    assert_names(up_command.why_undriven([pulled]), "tendon [N]")
    assert_names(up_command.why_undriven([Actuator("jaw", "m", 0.0, 1.0, 0.0)]), "jaw [m]")
    assert_names(
        up_command.why_undriven([Actuator(f"c{i}", "m", 0.0, 1.0, 0.0, pulls=True) for i in range(8)]),
        "7 channels",
        "8",
    )
