"""Plans as data: what the tables of a file become, and what is said of one that is wrong."""

from pathlib import Path

import numpy as np
import pytest

from tests.messages import raises_naming
from tripod_sim.errors import SceneError
from tripod_study import watch
from tripod_study.plan_file import read_plan

PLAN = """
title = "A swing"
scene = "pendulum"
version = 1

[motion]
duration = 0.02
interval = 0.01

[rows]
end = "mean 9"
moved = ["mean 9", "amplitude"]

[default]
"inertia.scheme" = "rk4"
dt = 0.01

[settings.implicit]
"inertia.scheme" = "bdf2"

[[points]]
from = "implicit"
dt = [0.01, 0.005]

[[points]]
label = "alone"
from = "nothing"
dt = 0.001

[[quantity]]
name = "end"
unit = "m"
what = "the free end"

[[quantity]]
name = "moved"
unit = "m"
what = "how far it goes"
scale = "largest"

[[reference]]
of_point = true
rungs = [{ dt = 0.002 }, { dt = 0.001 }]

[[quick.points]]
dt = 0.005
"""


def written(folder: Path, *changes: tuple[str, str]) -> Path:
    text = PLAN
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "swing.toml").write_text(text)
    return folder / "swing.toml"


def test_points_are_changes_of_the_settings_that_they_name(tmp_path: Path) -> None:
    made = read_plan(written(tmp_path), quick=False)
    assert made.name == "swing"
    assert [(p.label, dict(p.settings)) for p in made.points] == [
        ("the default", {"inertia.scheme": "rk4", "dt": 0.01}),
        ("", {"inertia.scheme": "bdf2", "dt": 0.01}),
        ("", {"inertia.scheme": "bdf2", "dt": 0.005}),
        ("alone", {"dt": 0.001}),
    ]
    rungs = made.references[0].rungs(made.points[2].settings)
    assert rungs == ({"inertia.scheme": "bdf2", "dt": 0.002}, {"inertia.scheme": "bdf2", "dt": 0.001})


def test_the_short_form_takes_the_place_of_tables_of_the_same_name(tmp_path: Path) -> None:
    made = read_plan(written(tmp_path), quick=True)
    assert [p.settings["dt"] for p in made.points] == [0.01, 0.005]
    assert made.quick
    assert len(made.quantities) == 2


def test_a_plan_of_a_scene_needs_no_code(tmp_path: Path) -> None:
    made = read_plan(written(tmp_path), quick=True)
    assert made.module == watch.__name__
    observed = watch.task(made.told(made.default)).observed
    rows = np.array(observed["end"])
    assert rows.shape == (2, 3)
    assert rows[1, 2] < rows[0, 2] < 0, "it falls"
    assert observed["moved"][0][0] == pytest.approx(0.5 * 9.81 * 0.02**2, rel=0.05)


@pytest.mark.parametrize("change", [("duration = 0.02", "duration = 0.03"), ("mean 9", "mean 8")])
def test_another_motion_is_another_point(change: tuple[str, str], tmp_path: Path) -> None:
    before = read_plan(written(tmp_path), quick=True)
    after = read_plan(written(tmp_path, change), quick=True)
    assert before.key(before.default) != after.key(after.default)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('"mean 9"', '"meen 9"', ("'meen'", "nodes", "marker")),
        ('"amplitude"', '"amplitud"', ("'amplitud'", "last")),
        ('from = "implicit"', 'from = "explicit"', ("'explicit'",)),
        ("[rows]", "[row]", ("'row'",)),
        ("[default]", "[defaults]", ("'defaults'",)),
        ("unit =", "units =", ("units",)),
        ("dt = 0.001\n", "dt = 0.001 0\n", ("line",)),
    ],
)
def test_a_plan_that_cannot_be_read_names_file_and_word(
    old: str, new: str, named: tuple[str, ...], tmp_path: Path
) -> None:
    path = written(tmp_path, (old, new))
    with raises_naming(SceneError, path, *named, "tripod_study.plan_file"):
        read_plan(path, quick=False)
