"""The fingerprint of the code that points are measured with."""

import shutil
from pathlib import Path

import pytest

import tripod_sim
from tripod_bringup.study_plans import PLANS
from tripod_sim.study import fingerprint as module
from tripod_sim.study.fingerprint import digest, fingerprint, simulating, sources

HERE = Path(str(tripod_sim.__file__)).parent


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Return a copy of tripod_sim."""
    return Path(shutil.copytree(HERE, tmp_path / "tripod_sim", ignore=shutil.ignore_patterns("__pycache__")))


@pytest.mark.parametrize(
    "path",
    [
        "springs/spring_system.py",
        "linear/ldl.py",
        "scenes/drape.toml",
        "scenes/sphere.obj",
        "maze/mazes/labyrinth.txt",
        *module.MEASURING,
    ],
)
def test_what_simulates_or_measures_counts(path: str, copy: Path) -> None:
    before = digest(simulating(copy))
    assert before == digest(simulating(HERE))
    changed = copy / path
    text = changed.read_bytes()
    changed.write_bytes(text + b"\n")
    assert digest(simulating(copy)) != before
    changed.write_bytes(text.replace(b"\n", b"\r\n"))
    assert digest(simulating(copy)) == before, "the ends of lines do not count"
    changed.rename(changed.with_name(f"other{changed.suffix}"))
    assert digest(simulating(copy)) != before


@pytest.mark.parametrize(
    "path",
    [
        "study/plans/cloth.py",
        "study/result.py",
        "studies/cloth.json",
        "accuracy/choice.py",
        *module.CARRYING,
    ],
)
def test_what_only_plans_or_reads_does_not_count(path: str, copy: Path) -> None:
    before = digest(simulating(copy))
    with (copy / path).open("ab") as file:
        file.write(b"\n")
    assert digest(simulating(copy)) == before


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
    found = {name: fingerprint(path) for name, path in PLANS.items()}
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
    assert not any("__pycache__" in name for name in sources(HERE))
