"""The fingerprint of the code that points are measured with."""

import shutil
from pathlib import Path

import pytest

import tripod_sim
import tripod_study
from tripod_bringup.study_plans import PLANS, plan
from tripod_study import fingerprint as module
from tripod_study.fingerprint import digest, fingerprint, simulating, sources

HERE = [Path(str(package.__file__)).parent for package in (tripod_sim, tripod_study)]


@pytest.fixture
def copies(tmp_path: Path) -> list[Path]:
    """Return copies of tripod_sim and tripod_study."""
    ignore = shutil.ignore_patterns("__pycache__")
    return [Path(shutil.copytree(folder, tmp_path / folder.name, ignore=ignore)) for folder in HERE]


@pytest.mark.parametrize(
    "path",
    [
        "tripod_sim/springs/loop.py",
        "tripod_sim/linear/ldl.py",
        "tripod_sim/scenes/drape.toml",
        "tripod_sim/scenes/sphere.obj",
        "tripod_sim/maze/mazes/labyrinth.txt",
        *(f"tripod_study/{name}" for name in module.MEASURING),
    ],
)
def test_what_simulates_or_measures_counts(path: str, copies: list[Path]) -> None:
    before = digest(simulating(*copies))
    assert before == digest(simulating(*HERE))
    changed = copies[0].parent / path
    text = changed.read_bytes()
    changed.write_bytes(text + b"\n")
    assert digest(simulating(*copies)) != before
    changed.write_bytes(text.replace(b"\n", b"\r\n"))
    assert digest(simulating(*copies)) == before, "the ends of lines do not count"
    changed.rename(changed.with_name(f"other{changed.suffix}"))
    assert digest(simulating(*copies)) != before


@pytest.mark.parametrize(
    "path",
    [
        "tripod_study/plans/cloth.toml",
        "tripod_study/result.py",
        "tripod_study/studies/cloth.json",
        "tripod_study/accuracy/choice.py",
        *(f"tripod_sim/{name}" for name in module.CARRYING),
    ],
)
def test_what_only_plans_or_reads_does_not_count(path: str, copies: list[Path]) -> None:
    before = digest(simulating(*copies))
    with (copies[0].parent / path).open("ab") as file:
        file.write(b"\n")
    assert digest(simulating(*copies)) == before


@pytest.mark.parametrize("ending", ["", "\n[gravity]\nacceleration = [0.0, 0.0, -1.0]\n"])
def test_the_motion_that_is_shown_does_not_count(ending: str, tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    digests = []
    for motion in ("", '\n# about it\n[motion]\nservo = """\n0: 0,0,0;\n1: 0,0,1"""\n'):
        scene.write_text(f"dt = 0.1\n\n# disc\n[effector]\n{motion}{ending}")
        digests.append(digest({"scenes/scene.toml": scene}))
    assert digests[0] == digests[1]
    scene.write_text(scene.read_text().replace("0.1", "0.2"))
    assert digest({"scenes/scene.toml": scene}) != digests[0]


def test_a_study_of_another_package_counts_that_package_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = {name: fingerprint(plan(name, quick=True).module) for name in PLANS}
    assert len({found[name] for name in PLANS if name != "ik"}) == 1
    assert found["ik"] != found["cloth"]
    folder = tmp_path / "some_package"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "solver.py").write_text("A = 1\n")
    (folder / "plan.py").write_text("B = 1\n")
    monkeypatch.syspath_prepend(tmp_path)

    def again() -> str:
        fingerprint.cache_clear()
        return fingerprint("some_package.plan")

    before = again()
    (folder / "plan.py").write_text("B = 2\n")
    assert again() == before, "the plan has a version"
    (folder / "solver.py").write_text("A = 2\n")
    assert again() != before


def test_compiled_files_do_not_count() -> None:
    assert not any("__pycache__" in name for folder in HERE for name in sources(folder))
