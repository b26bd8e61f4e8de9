"""Studies: the verdicts of the pendulum's table, and `tripod study`."""

import csv
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from tripod_bringup.cli import app
from tripod_bringup.study_plans import REPORTS, report
from tripod_study.report import one_by_one
from tripod_study.variations import pendulum


@pytest.mark.parametrize(
    ("change", "scheme", "substeps", "stable"),
    [
        ({"dt": 0.4}, "semi_implicit_euler", "off", False),
        ({"dt": 0.4}, "semi_implicit_euler", "auto", True),
        ({"dt": 0.4}, "implicit_euler", "", True),
        ({"m": 0.001}, "semi_implicit_euler", "off", False),
        ({"m": 0.001}, "rk4", "auto", True),
        ({"dt": 0.01, "k": 5000.0, "m": 0.1}, "rk4", "off", False),
        ({"k": 5000.0}, "explicit_euler", "off", False),
    ],
)
def test_the_verdicts_on_the_pendulum(change: dict, scheme: str, substeps: str, stable: bool) -> None:
    row = pendulum.measure(scheme, substeps, **{**pendulum.BASE, **change})
    assert row["stable"] == stable
    assert (abs(row["drift"]) < 1.0) == stable
    assert (row["amplitude"] < 2.5) == stable
    assert (row["parts"] > 1) == (substeps == "auto")
    assert row["wall"] > 0


def test_every_value_of_the_report_is_varied() -> None:
    made = report("pendulum", full=False)
    assert len(made.cases) == 9 * len(pendulum.REPORTED)
    assert len(report("pendulum", full=True).cases) == 72 * len(pendulum.REPORTED)
    cases = one_by_one(pendulum.BASE, pendulum.VARIED)
    for name, values in pendulum.VARIED.items():
        assert {c[name] for c in cases} == set(values)
    first = made.row(made.cases[0])
    assert set(first) == {c.key for c in made.columns}


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pendulum, "VARIED", {"dt": (0.005, 0.4)})
    monkeypatch.setattr(pendulum, "REPORTED", (("semi_implicit_euler", "off"), ("implicit_euler", "")))


@pytest.mark.usefixtures("short")
def test_the_command_prints_one_table_and_writes_it(tmp_path: Path) -> None:
    words = ["study", "pendulum", "--part", "report", "--out", str(tmp_path)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0
    lines = done.stdout.splitlines()
    assert lines[1].split()[:4] == ["scheme", "substeps", "dt", "[s]"]
    assert len(lines) == 2 + 4 + 1
    assert [" NO " in line for line in lines[2:6]] == [False, False, True, False]
    with (tmp_path / "pendulum_report.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["stable"] for row in rows] == ["True", "True", "False", "True"]
    done = CliRunner().invoke(app, [*words, "--json"])
    rows = json.loads(done.stdout)["report"]["rows"]
    assert [row["stable"] for row in rows] == [True, True, False, True]


@pytest.mark.usefixtures("short")
def test_rows_that_are_done_are_kept_and_taken_up_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The report that was stopped in its third row makes the last two when it is asked for again.

    What it says when a signal stops it is held in tests/bringup/test_study_run.py.
    """
    made, measured, words = pendulum.measure, list[str](), ["study", "pendulum", "--part", "report"]

    def measure(stop_at: int) -> None:
        def one(**case: object) -> dict:
            if len(measured) == stop_at:
                raise KeyboardInterrupt
            measured.append(str(case["scheme"]))
            return made(**case)

        monkeypatch.setattr(pendulum, "measure", one)

    measure(2)
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path)])
    assert done.exit_code == 130
    measure(-1)
    done = CliRunner().invoke(app, [*words, "--out", str(tmp_path)])
    assert done.exit_code == 0
    assert measured == ["semi_implicit_euler", "implicit_euler"] * 2
    assert len(done.stdout.splitlines()) == 2 + 4 + 1
    again = CliRunner().invoke(app, [*words, "--out", str(tmp_path)])
    assert again.stdout == done.stdout
    assert len(measured) == 4
    rows = tmp_path / "pendulum_report.jsonl"
    kept = [json.loads(line) for line in rows.read_text().splitlines()]
    del kept[0]["row"], kept[1]["row"]["stable"]
    rows.write_text("".join(json.dumps(record) + "\n" for record in kept))
    assert CliRunner().invoke(app, [*words, "--out", str(tmp_path)]).exit_code == 0
    assert measured[4:] == measured[:2], "the damaged rows"
    CliRunner().invoke(app, [*words, "--fresh", "--out", str(tmp_path)])
    assert len(measured) == 10
    monkeypatch.setattr("tripod_study.fingerprint.fingerprint", lambda _: "physics that changed")
    CliRunner().invoke(app, [*words, "--out", str(tmp_path)])
    assert len(measured) == 14


def test_every_study_can_be_made() -> None:
    for name in REPORTS:
        made = report(name, full=False)
        assert made.cases
        assert len({made.key(case) for case in made.cases}) == len(made.cases)
        assert made.columns
