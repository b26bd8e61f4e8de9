"""Studies on this machine: points in processes, the store, what ends badly, kill -9, Ctrl-C, a cluster, the command."""

import csv
import errno
import importlib.util
import json
import os
import resource
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure
from typer.testing import CliRunner

from tests.bringup import toy_study
from tests.bringup.processes import DEADLINE, alive, wait_until
from tests.messages import assert_names, line_naming, lines_naming
from tripod_bringup import study_command
from tripod_bringup.cli import app
from tripod_bringup.study_plans import PLANS, plan
from tripod_bringup.study_plot import draw
from tripod_bringup.study_run import Job, local, outdated, run_plan
from tripod_bringup.study_store import Store
from tripod_bringup.study_worker import Worker, lost
from tripod_sim.errors import SceneError
from tripod_study.accuracy.choice import choose
from tripod_study.fingerprint import fingerprint
from tripod_study.result import assemble

ROOT = Path(__file__).parents[2]


def lines(path: Path) -> list[str]:
    return path.read_text().splitlines() if path.exists() else []


def test_a_store_keeps_what_was_added_and_cuts_a_torn_line_off(tmp_path: Path) -> None:
    path = tmp_path / "new" / "points.jsonl"
    with Store(path) as store:
        store.add("a", {"cpu": [0.1, 1e-300, 0.1 + 0.2]})
        store.add("b", {"status": "diverged"})
    with path.open("ab") as file:
        file.write(b'{"key": "c", "cpu": [0.')
    with Store(path) as store:
        assert store.records["a"]["cpu"] == [0.1, 1e-300, 0.1 + 0.2]
        assert list(store.records) == ["a", "b"]
        store.add("d", {"status": "ok"})
    assert [json.loads(line)["key"] for line in lines(path)] == ["a", "b", "d"]
    with path.open("ab") as file:
        file.write(b"\0\0\0\n[1]\n")
    with Store(path) as store:
        assert list(store.records) == ["a", "b", "d"]
    with Store(path, fresh=True) as store:
        assert not store.records


def test_a_full_disk_leaves_no_torn_line_and_the_store_goes_on_when_there_is_room(tmp_path: Path) -> None:
    path = tmp_path / "points.jsonl"
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    with Store(path) as store:
        store.add("a", {"cpu": [0.1]})
        whole = path.read_bytes()
        resource.setrlimit(resource.RLIMIT_FSIZE, (len(whole) + 10, limits[1]))  # room for ten bytes
        try:
            with pytest.raises(OSError, match=os.strerror(errno.EFBIG)) as told:
                store.add("b", {"cpu": [0.2] * 100})
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        assert (told.value.filename, path.read_bytes(), list(store.records)) == (str(path), whole, ["a"])
        store.add("c", {"cpu": [0.3]})
    assert [json.loads(line)["key"] for line in lines(path)] == ["a", "c"]


def test_every_bad_end_is_a_row_and_the_others_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = toy_study.make(ends=toy_study.ENDS, steps=(0.4,), limit=0.5)
    measure = Worker.measure

    def patient(worker: Worker, module: str, settings: Any, limit: float) -> dict[str, Any]:
        """Let the others take what a loaded machine needs to start a process."""
        return measure(worker, module, settings, limit if settings["end"] == "hang" else 5 * DEADLINE)

    monkeypatch.setattr(Worker, "measure", patient)
    with Store(tmp_path / "toy.jsonl") as store:
        records = run_plan(made, store, local(2))
    found = {p.settings["end"]: records[made.key(p.settings)] for p in made.points if p.settings["dt"] == 0.4}
    assert {end: record["status"] for end, record in found.items()} == {
        "ok": "ok",
        "diverge": "diverged",
        "refuse": "refused",
        "bug": "failed",
        "exit": "crashed",
        "kill": "crashed",
        "hang": "time limit",
    }
    assert_names(found["exit"]["message"], "process", "code 3")
    assert_names(found["kill"]["message"], "process", "code -9")
    assert_names(found["hang"]["message"], "stopped", "0.5 s")
    assert found["diverge"]["message"] == "element 7 is inverted", "in one line"
    assert found["ok"]["calibration"] > 0


def test_a_finished_point_is_not_run_again_and_a_crashed_one_is(tmp_path: Path) -> None:
    log = tmp_path / "log"
    made = toy_study.make(ends=("ok", "exit"), steps=(0.4, 0.2), log=str(log))
    for expected in (4 + 2, 2):  # two rungs and two points, and two that crash; then these again
        before = len(lines(log))
        with Store(tmp_path / "toy.jsonl") as store:
            run_plan(made, store, local(1))
        assert len(lines(log)) - before == expected


def with_other_code(path: Path, keys: set[str], code: str | None) -> None:
    """Rewrite a store as if other code, or one that left no trace, had measured some points."""
    made = [json.loads(line) for line in lines(path)]
    for record in made:
        if record["key"] in keys:
            record.pop("code", None)
            if code:
                record["code"] = code
    path.write_text("".join(json.dumps(record) + "\n" for record in made))


@pytest.mark.parametrize("code", ["0123456789abcdef", None])
def test_points_of_other_code_are_measured_again(code: str | None, tmp_path: Path) -> None:
    path, log = tmp_path / "toy.jsonl", tmp_path / "log"
    made = toy_study.make(ends=("ok", "exit"), steps=(0.4, 0.2), log=str(log))
    with Store(path) as store:
        run_plan(made, store, local(1))
        assert {r["code"] for r in store.records.values() if r["status"] == "ok"} == {
            fingerprint(made.module)
        }
        assert outdated(made, store) == 0
    rungs, others = made.runs()
    ok = next(s for s in others if s["end"] == "ok")
    with_other_code(path, {made.key(rungs[0]), made.key(ok)}, code)
    before = len(lines(log))
    with Store(path) as store:
        assert outdated(made, store) == 2, "crashed points are run again anyway"
        records = run_plan(made, store, local(1))
        assert outdated(made, store) == 0
    assert len(lines(log)) - before == 4, "these two and the two that crash"
    assert records[made.key(ok)]["code"] == fingerprint(made.module)


@pytest.mark.parametrize(
    "damage",
    [
        {"status": None},
        {"status": ["ok"]},
        {"message": 3},
        {"cpu": []},
        {"cpu": None},
        {"cpu": ["1"]},
        {"cpu": [0.0]},
        {"unknowns": "5"},
        {"calibration": "fast"},
        {"amount": 0},
        {"amount": float("inf")},
        {"observed": None},
        {"observed": {}},
        {"observed": {"x": 1.0}},
        {"observed": {"x": []}},
        {"observed": {"x": [[1.0], [1.0, 2.0]]}},
        {"observed": {"x": [[1.0, "2"]]}},
        {"observed": {"x": [[float("nan"), 1.0]]}},
    ],
    ids=str,
)
def test_a_damaged_point_is_measured_again(damage: dict[str, Any], tmp_path: Path) -> None:
    made, path = toy_study.make(steps=(0.4, 0.2)), tmp_path / "toy.jsonl"
    whole = {"message": "", "status": "ok", "cpu": [1.0], "amount": 1.0, "observed": {"x": [[1.0, 0.1]]}}
    whole.update(code=fingerprint(made.module), unknowns=0, calibration=0.04)
    asked: list[str] = []

    def execute(work: Sequence[Job]) -> Iterator[tuple[str, dict[str, Any]]]:
        asked.extend(job[0] for job in work)
        yield from ((job[0], whole) for job in work)

    with Store(path) as store:
        keys = list(run_plan(made, store, execute))
        store.add(keys[1], {**whole, **damage})
    asked.clear()
    with Store(path) as store:
        assert outdated(made, store) == 0
        found = run_plan(made, store, execute)
    assert asked == [keys[1]]
    assert found[keys[1]]["observed"] == whole["observed"]


def test_what_other_code_of_a_cluster_measures_is_refused(tmp_path: Path) -> None:
    made = toy_study.make(steps=(0.4,))

    def elsewhere(work: Sequence[Job]) -> Iterator[tuple[str, dict[str, Any]]]:
        for key, *_ in work:
            yield key, {**lost("ok", ""), "code": "0123456789abcdef"}

    with Store(tmp_path / "toy.jsonl") as store:
        records = run_plan(made, store, elsewhere)
        assert {r["status"] for r in records.values()} == {"crashed"}
        why = records[made.key(made.default)]["message"]
        assert_names(why, "other code", "0123456789abcdef", fingerprint(made.module))
        assert {r["status"] for r in run_plan(made, store, local(1)).values()} == {"ok"}


def test_the_seed_orders_the_points_and_changes_nothing_else(tmp_path: Path) -> None:
    found, orders = [], []
    for seed in (0, 5):
        log = tmp_path / "log"
        log.unlink(missing_ok=True)
        made = toy_study.make(steps=(0.4, 0.3, 0.2, 0.15, 0.1), log=str(log))
        with Store(tmp_path / "toy.jsonl", fresh=True) as store:
            records = run_plan(made, store, local(1), seed=seed)
        found.append({key: record["observed"] for key, record in records.items()})
        orders.append(lines(log))
    assert found[0] == found[1]
    assert orders[0] != orders[1]
    assert sorted(orders[0]) == sorted(orders[1])


KILLED = """
import sys
from pathlib import Path
from tests.bringup import toy_study
from tripod_bringup.study_run import local, run_plan
from tripod_bringup.study_store import Store
made = toy_study.make(steps=tuple(0.01 * k for k in range(3, 15)), gate=sys.argv[2], log=sys.argv[3])
with Store(Path(sys.argv[1])) as store:
    run_plan(made, store, local(2))
"""


def test_kill_9_loses_no_finished_point(tmp_path: Path) -> None:
    path, gate, log = tmp_path / "toy.jsonl", tmp_path / "gate", tmp_path / "log"
    child = subprocess.Popen([sys.executable, "-c", KILLED, str(path), str(gate), str(log)], cwd=ROOT)
    try:
        assert wait_until(
            lambda: (len(lines(path)), len(toy_study.waiting(gate))) == (toy_study.BEFORE_GATE, 2)
        )
    finally:
        child.kill()
        child.wait()
    kept = [json.loads(line) for line in path.read_bytes().splitlines(keepends=True) if line.endswith(b"\n")]
    assert len(kept) == toy_study.BEFORE_GATE
    assert wait_until(lambda: not any(map(alive, toy_study.waiting(gate)))), "its workers end with it"
    (gate / "open").touch()
    made = toy_study.make(steps=tuple(0.01 * k for k in range(3, 15)), gate=str(gate), log=str(log))
    before = len(lines(log))
    with Store(path) as store:
        assert len(store.records) == len(kept)
        records = run_plan(made, store, local(2))
    assert len(lines(log)) - before == 14 - len(kept)
    for record in kept:
        assert records[record["key"]] == record
    assert {record["status"] for record in records.values()} == {"ok"}


@pytest.mark.skipif(
    importlib.util.find_spec("distributed") is None,
    reason="no dask.distributed; to install: pip install tripod[cluster]",
)
def test_a_cluster_gives_the_same_bits(tmp_path: Path) -> None:
    from distributed import LocalCluster

    from tripod_bringup.study_cluster import cluster

    made = toy_study.make(ends=("ok", "diverge", "kill"), steps=(0.4, 0.3))
    with Store(tmp_path / "here.jsonl") as store:
        here = run_plan(made, store, local(1))
    with (
        LocalCluster(n_workers=1, threads_per_worker=2, host="127.0.0.1", dashboard_address=None) as machines,
        Store(tmp_path / "there.jsonl") as store,
    ):
        there = run_plan(made, store, cluster(machines.scheduler_address))
    for key, record in here.items():
        assert {k: there[key][k] for k in ("status", "message", "observed")} == {
            k: record[k] for k in ("status", "message", "observed")
        }


def test_a_worker_is_started_again_after_it_was_stopped() -> None:
    worker = Worker()
    settings = dict(toy_study.make().default)
    try:
        first = worker.measure("tests.bringup.toy_study", settings, DEADLINE)
        worker.stop()
        again = worker.measure("tests.bringup.toy_study", settings, DEADLINE)
        assert (again["status"], again["observed"]) == ("ok", first["observed"])
    finally:
        worker.stop()


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    from tripod_bringup import study_plans

    monkeypatch.setitem(study_plans.PLANS, "toy", toy_study.FILE)
    yield


@pytest.mark.usefixtures("toy")
def test_the_command_prints_a_table_and_writes_files(tmp_path: Path) -> None:
    words = ["study", "toy", "--out", str(tmp_path / "out"), "--jobs", "2"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.stderr
    line_naming(done.stdout, "order", "dt", "2.00")
    line_naming(done.stdout, "reference", "own error", "0.01 %")
    most_exact = lines_naming(done.stdout, "dt 0.1 ")[0]
    assert_names(most_exact, " 1 ", " 1.02 ")  # the error, and that with the reference's own
    table = list(csv.DictReader((tmp_path / "out" / "toy.csv").open(newline="")))
    result = json.loads((tmp_path / "out" / "toy.json").read_text())
    assert [float(row["error"]) for row in table] == [p["error"] for p in result["points"]]
    assert [row["fastest_within"] for row in table] == ["", "10%; 5%", ""]
    assert (tmp_path / "out" / "toy.png").read_bytes()[:4] == b"\x89PNG"
    assert result["versions"]["code"] == fingerprint("tests.bringup.toy_study")
    assert not lines_naming(done.stderr, "tripod study: "), "nothing of other code"
    again = CliRunner().invoke(app, [*words, "--json"])
    assert json.loads(again.stdout)["accuracy"]["toy"] == result
    points = tmp_path / "out" / "toy.jsonl"
    with_other_code(points, {json.loads(lines(points)[0])["key"]}, "0123456789abcdef")
    (told,) = CliRunner().invoke(app, [*words, "--quiet"]).stderr.splitlines()
    assert_names(told, "tripod study: ", "toy", tmp_path / "out", "other code", 1, "again")


def test_after_the_study_of_an_own_scene_the_command_that_uses_it_is_told(tmp_path: Path) -> None:
    text = (
        (ROOT / "tripod_sim/scenes/pendulum.toml")
        .read_text()
        .replace("duration = 5.0", "duration = 0.1")
        .replace('"pendulum"', '"swing"', 1)
    )
    scene = tmp_path / "my scene.toml"
    scene.write_text(text)
    words = ["study", str(scene), "--quick", "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, words)
    files, following = done.stderr.splitlines()[-2:]
    assert_names(files, tmp_path / "out" / "swing", ".json", ".csv", ".png", ".jsonl")
    assert_names(following, "tripod run")
    run = CliRunner().invoke(app, shlex.split(following.partition("tripod ")[2]))
    assert run.exit_code == 0, run.stderr
    assert lines_naming(run.stdout + run.stderr, "study swing")


def test_the_picture_names_the_fastest_and_what_none_reaches(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, drawn = toy_study.make(), list[Figure]()
    with Store(tmp_path / "toy.jsonl") as store:
        result = assemble(made, run_plan(made, store, local(2)), "0")
    result["points"][0]["label"] = "the default"
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: drawn.append(figure))
    draw(result, tmp_path / "toy.png")
    ok, front, fastest, none = (text.get_text() for text in drawn[0].legends[0].get_texts())
    assert (ok, front) == ("ok", "best settings")
    assert_names(fastest, "fastest", "10, 5 %", "dt 0.2")
    assert_names(none, "none", "1, 0.1 %")
    axes = drawn[0].axes[0]
    assert {text.get_text() for text in axes.texts} == {"10, 5 %", "the default"}
    ring = next(line for line in axes.lines if line.get_label() == fastest)
    best = result["points"][result["cheapest"]["5%"]]
    assert ring.get_xydata().tolist() == [[best["cpu"], pytest.approx(100 * best["error"])]]


@pytest.mark.usefixtures("toy")
@pytest.mark.parametrize("words", [[], ["--fresh"]])
def test_a_second_study_in_the_same_folder_is_refused(words: list[str], tmp_path: Path) -> None:
    path = tmp_path / "toy.jsonl"
    command = ["study", "toy", "--out", str(tmp_path), "--quiet", *words]
    with Store(path) as store:
        store.add("a", {"status": "ok"})
        done = CliRunner().invoke(app, command)
        store.add("b", {"status": "ok"})
    assert done.exit_code == 2
    (told,) = done.stderr.splitlines()
    assert_names(told, "tripod study: ", "another `tripod study`", f"'{path}'", "--out")
    assert [json.loads(line)["key"] for line in lines(path)] == ["a", "b"]
    assert CliRunner().invoke(app, command).exit_code == 0


@pytest.mark.usefixtures("toy")
def test_a_study_without_reference_ends_with_1(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tripod_bringup import study_plans

    file = tmp_path / "toy.toml"
    file.write_text(toy_study.FILE.read_text().replace('dt = 0.02, end = "ok"', 'dt = 0.02, end = "diverge"'))
    monkeypatch.setitem(study_plans.PLANS, "toy", file)
    done = CliRunner().invoke(app, ["study", "toy", "--out", str(tmp_path / "out")])
    assert done.exit_code == 1
    line_naming(done.stderr, "tripod study: ", "reference 'reference'", "diverged")


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["nonsense"], ("study 'nonsense'", "cloth, diamond")),
        ([], ("scene", "--all")),
        (["pendulum", "--all"], ("scene", "--all")),
        (["cloth", "--part", "report"], ("no report", "'cloth'", "pendulum, drape")),
        (["mine.toml", "--part", "report"], ("no report", "'mine.toml'", "pendulum, drape")),
        (["cloth", "--part", "some"], ("--part", "'some'", "both, accuracy, report")),
        (["drape", "--part", "report", "--knobs", "dt"], ("--knobs dt", "--part report")),
        (["cloth", "--quick", "--knobs", "dt,speed"], ("'speed'", "dt, linear")),
        (["cloth", "--quick", "--knobs", "tolerance"], ("--knobs tolerance", "--quick", "--knobs scheme")),
        (["cloth", "--scheduler", "here"], ("--scheduler", "'here'", "tcp://HOST:PORT")),
        (["cloth", "--out", "/proc/no/such"], ("--out", "'/proc/no'", "No such file")),
    ],
)
def test_bad_arguments_end_with_2_and_one_line(words: list[str], named: tuple[str, ...]) -> None:
    done = CliRunner().invoke(app, ["study", *words])
    assert done.exit_code == 2
    assert_names(done.stderr, "tripod study: ", *named)
    assert len(done.stderr.splitlines()) == 1


def test_without_dask_a_scheduler_is_refused_in_one_line(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    words = ["study", "cloth", "--quick", "--scheduler", "tcp://127.0.0.1:1", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 2
    (told,) = done.stderr.splitlines()
    assert_names(told, "tripod study: ", "--scheduler", "Dask", "pip install 'tripod[cluster]'")


INTERRUPTED = """
import sys
from tests.bringup import toy_study
from tripod_bringup import study_command, study_plans
study_plans.PLANS["toy"] = toy_study.FILE
_, out, gate = sys.argv
study_command.plan = lambda name, quick: toy_study.make(steps=tuple(0.01 * k for k in range(3, 15)), gate=gate)
from tripod_bringup.cli import main
sys.argv = ["tripod", "study", "toy", "--jobs", "2", "--out", out]
main()
"""


def test_ctrl_c_ends_with_130_and_one_line(tmp_path: Path) -> None:
    out, gate = tmp_path / "out", tmp_path / "gate"
    words = [sys.executable, "-c", INTERRUPTED, str(out), str(gate)]
    with subprocess.Popen(words, cwd=ROOT, stderr=subprocess.PIPE, text=True) as child:
        try:
            assert wait_until(lambda: len(toy_study.waiting(gate)) == 2)
            assert wait_until(lambda: len(lines(out / "toy.jsonl")) == toy_study.BEFORE_GATE)
            child.send_signal(signal.SIGINT)
            _, said = child.communicate(timeout=DEADLINE)
        finally:
            child.kill()
    assert child.returncode == 130
    (told,) = said.splitlines()
    assert_names(told, "tripod study: ", "interrupted", out, "same command")
    assert len(lines(out / "toy.jsonl")) == toy_study.BEFORE_GATE
    assert wait_until(lambda: not any(map(alive, toy_study.waiting(gate)))), "its workers end with it"


@pytest.mark.usefixtures("toy")
def test_the_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "toy.jsonl").mkdir()
    done = CliRunner().invoke(app, ["study", "toy", "--out", str(tmp_path)])
    assert done.exit_code == 2
    path = tmp_path / "toy.jsonl"
    (told,) = done.stderr.splitlines()
    assert_names(told, "tripod study: ", "--out", f"'{path}'", "Is a directory")


LEFT = """
import sys
from tests.bringup import toy_study
from tripod_bringup import study_plans
study_plans.PLANS["toy"] = toy_study.FILE
from tripod_bringup.cli import main
sys.argv = ["tripod", "study", "toy", "--quiet", "--jobs", "2", "--out", sys.argv[1]]
main()
"""


def test_a_reader_that_leaves_is_not_blamed_on_the_folder(tmp_path: Path) -> None:
    child = subprocess.Popen(
        [sys.executable, "-u", "-c", LEFT, str(tmp_path)], cwd=ROOT,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert child.stdout and child.stderr
    child.stdout.close()
    said = child.stderr.read()
    assert child.wait(timeout=DEADLINE) == 141
    assert said == ""
    assert (tmp_path / "toy.json").exists()


def test_the_report_and_the_accuracy_of_one_scene_come_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(
        study_command, "print_report", lambda name, *_, **__: asked.append(name) or {"rows": []}
    )
    monkeypatch.setattr(
        study_command, "accuracy", lambda made, *_, **__: asked.append(made.name) or ({"front": [0]}, [])
    )
    for words, expected in (
        (["pendulum"], ["pendulum", "pendulum"]),
        (["pendulum", "--part", "report"], ["pendulum"]),
        (["pendulum", "--quick"], ["pendulum"]),
        (["tripod"], ["tripod_static", "tripod_dynamic"]),
        (["--all"], list(study_command.PLANS)),
        (["--all", "--part", "report"], ["pendulum", "drape"]),
    ):
        asked.clear()
        done = CliRunner().invoke(app, ["study", *words, "--json", "--out", str(tmp_path)])
        assert done.exit_code == 0, done.stderr
        assert asked == expected


@pytest.mark.parametrize("name", PLANS)
def test_a_study_ends_with_a_command_for_the_best_accuracy_that_it_offers(name: str) -> None:
    """Those of bodies at rest must say `inertia=off`; one of inverse kinematics chooses nothing for `tripod run`."""
    made, studies = plan(name, quick=True), ROOT / "tripod_study" / "studies"
    words = study_command.next_command(made.scene, made, study_command.Changes(), studies)
    assert words[:3] == ["tripod", "run", made.scene]
    pairs = list(pairwise(words))
    given, overrides = dict(pairs), [value for option, value in pairs if option == "--set"]
    taken = given.get("--accuracy")
    assert (taken is None) == (name == "ik")
    for wish in study_command.WISHES:
        if wish == taken:
            choice = choose(made.scene, wish, overrides, study=Path(given["--study"]), speed=lambda: None)
            assert choice.study == name
            assert not choice.outside
            return
        with pytest.raises(SceneError):
            choose(made.scene, wish, overrides, study=studies / f"{name}.json", speed=lambda: None)


def test_the_command_after_a_study_repeats_the_options_that_changed_the_scene() -> None:
    changes = study_command.Changes(["dt=0.01"], servo="0:0; 1:-1,-1,-1", duration=2.0, accuracy="5%")
    made = study_command.plan_of_scene("tripod", study_command.Changes(), quick=True)
    words = study_command.next_command("tripod", made, changes, Path("nowhere"))
    options = ["--set", "dt=0.01", "--servo=0:0; 1:-1,-1,-1", "--duration=2.0", "--accuracy=5%"]
    assert words == ["tripod", "run", "tripod", *options]
