"""Other kinds of arithmetic: what they change, which are run, and what is kept of a run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.messages import assert_names, line_naming, names
from tools import arithmetic

PASSES, FAILS = "def test_it():\n    pass\n", "def test_it():\n    assert False\n"


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a checkout of its own that holds one test, which passes; no plugins, no second process."""
    for words in (["init", "-q"], ["config", "user.email", "a@b.c"], ["config", "user.name", "a"]):
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    (tmp_path / ".gitignore").write_text("build\n__pycache__\n")
    (tmp_path / "pytest.ini").write_text("[pytest]\naddopts = -q --disable-plugin-autoload -p xdist\n")
    (tmp_path / "test_it.py").write_text(PASSES)
    commit(tmp_path)
    monkeypatch.setattr(arithmetic, "ROOT", tmp_path)
    monkeypatch.setattr(arithmetic, "RESULTS", tmp_path / "build")
    return tmp_path


def commit(checkout: Path) -> None:
    subprocess.run(["git", "add", "-A"], cwd=checkout, check=True)
    subprocess.run(["git", "commit", "-qm", "one"], cwd=checkout, check=True)


@pytest.mark.parametrize("name", arithmetic.KINDS)
def test_a_kind_sets_its_own_variables_and_no_others(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in arithmetic.VARIABLES:
        monkeypatch.setenv(variable, "of this machine")
    found = arithmetic.environment(name)
    assert {k: v for k, v in found.items() if k in arithmetic.VARIABLES} == dict(
        arithmetic.KINDS[name].environment
    )
    assert found["PATH"] == os.environ["PATH"]


@pytest.mark.parametrize(("cpu", "features"), [("generic", ""), ("haswell", arithmetic.HASWELL)])
def test_numba_compiles_for_the_processor_that_is_named(cpu: str, features: str) -> None:
    """Of `haswell` not with what this machine can do besides."""
    kind = next(name for name, k in arithmetic.KINDS.items() if k.environment.get("NUMBA_CPU_NAME") == cpu)
    code = (
        "from numba.core.registry import cpu_target\n"
        "print(*cpu_target.target_context.codegen().magic_tuple()[1:], sep='|')"
    )
    out = subprocess.run(
        [sys.executable, "-c", code],
        env=arithmetic.environment(kind),
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert out.strip() == f"{cpu}|{features}"


def test_a_kind_that_passed_is_run_again_only_after_a_change(
    checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert arithmetic.main(["native"]) == 0
    assert_names(capsys.readouterr().out, "native", "1 passed")
    assert arithmetic.main(["native"]) == 0
    assert not names(capsys.readouterr().out, "1 passed")
    (checkout / "test_it.py").write_text(FAILS)
    for _ in range(2):  # what failed is never taken for passed
        assert arithmetic.main(["native"]) == 1
        assert line_naming(capsys.readouterr().out, "native", "FAILED", "test_it.py::test_it")
    commit(checkout)
    (checkout / "test_it.py").write_text(PASSES)
    assert arithmetic.main(["native"]) == 0


def test_arguments_behind_two_hyphens_go_to_pytest(
    checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert arithmetic.main(["native", "--", "-k", "nothing"]) == 1
    assert_names(capsys.readouterr().out, "no tests ran")


def test_a_kind_that_this_processor_cannot_run_is_left_out(
    checkout: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(arithmetic, "processor_flags", lambda: {"avx2"})
    assert arithmetic.main(["native-skylakex"]) == 0
    assert_names(capsys.readouterr().out, "native-skylakex", "avx512f")
    assert not (checkout / "build").exists()


def test_an_unknown_kind_is_named_with_those_that_exist(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        arithmetic.main(["vax"])
    assert ended.value.code == 2
    assert_names(capsys.readouterr().err, "vax", *arithmetic.KINDS)


def test_an_interrupted_run_says_so(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> bool:
        raise KeyboardInterrupt

    monkeypatch.setattr(arithmetic, "passes", interrupt)
    assert arithmetic.main(["native"]) == 130
