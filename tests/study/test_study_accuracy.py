"""The pure part of a study of accuracy: references, errors, front, orders, results, plans."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from tests.messages import assert_names, names, raises_naming
from tripod_bringup.study_plans import PLANS, plan
from tripod_sim.errors import SceneError
from tripod_sim.scene import Scene
from tripod_study.deviation import deviation, limit, standard
from tripod_study.front import cheapest, front, order
from tripod_study.motion import motion, scene_of
from tripod_study.plan import Plan, Point, Quantity, Reference, Settings
from tripod_study.result import assemble
from tripod_study.task import Measured, outcome, repeated


def test_the_front_is_what_nothing_beats_in_both() -> None:
    errors = [0.5, 0.2, 0.2, 0.3, None, 0.1, 0.1, 0.05]
    costs = [1.0, 2.0, 2.5, 3.0, 0.1, 4.0, 4.0, None]
    assert front(errors, costs) == [0, 1, 5]
    rng = np.random.default_rng(0)
    e, c = rng.random((2, 60))
    best = front(list(e), list(c))
    for i in range(60):
        beaten = any(e[j] <= e[i] and c[j] <= c[i] and j != i for j in range(60))
        assert (i in best) != beaten


def test_the_cheapest_is_within_for_sure() -> None:
    bounds, costs = [0.011, 0.0099, 0.002, None], [1.0, 2.0, 1.5, 0.1]
    assert cheapest(bounds, costs, 0.01) == 2
    assert cheapest(bounds, costs, 0.05) == 0
    assert cheapest(bounds, costs, 0.001) is None


@pytest.mark.parametrize("p", [1.0, 2.0, 3.7])
def test_the_order_is_fitted_to_the_three_smallest_steps(p: float) -> None:
    h = np.array([0.1, 0.4, 0.2, 0.8, 1.6])
    e = 3.0 * h**p
    e[h > 0.5] = 1.0  # where nothing converges yet
    assert order(h, e) == pytest.approx(p)
    assert order(h[:2], e[:2]) is None
    assert order(h[:3], [0.0, 1.0, 2.0]) is None


def test_richardsons_limit_is_exact_for_one_power_and_tells_what_it_is_worth() -> None:
    h = np.array([1.0, 0.5, 1 / 3])
    rows = [np.array([[2.0, -1.0, 0.0]]) + 0.3 * x**2 for x in h]
    assert limit(rows[1], rows[2], h[1] / h[2], 2.0) == pytest.approx(np.array([[2.0, -1.0, 0.0]]))
    quantity = Quantity("x", "m", "", scale="largest")
    extrapolated = Reference("r", lambda s: (), order=2.0, sizes=tuple(h))
    found = standard(quantity, extrapolated, rows)
    assert found.own == pytest.approx(0.0, abs=1e-14)
    assert found.scale == pytest.approx(math.sqrt(5))
    wrong = standard(quantity, replace(extrapolated, order=1.0), rows)
    assert wrong.own > deviation(wrong.rows, np.array([[2.0, -1.0, 0.0]]), "distance")
    two = standard(quantity, Reference("r", lambda s: (), order=2.0, sizes=(1.0, 0.5)), rows[:2])
    assert two.own == pytest.approx(0.3 * 0.25 * math.sqrt(3))  # the error of the finest
    plain = standard(quantity, Reference("r", lambda s: ()), rows)
    assert np.array_equal(plain.rows, rows[-1])
    assert plain.own == pytest.approx(0.3 * (1 / 4 - 1 / 9) * math.sqrt(3))


def test_errors_are_the_worst_row_and_relative_to_the_travel() -> None:
    rows = np.array([[0.0, 0, 0, 0, 0, 0], [3.0, 0, 0, 0, 4.0, 0]])
    off = rows + np.array([[0.0] * 6, [0, 0, 0, 0, 0, 2.0]])
    assert deviation(off, rows, "distance") == 2.0
    assert deviation(off, rows, "rms") == pytest.approx(2.0 / math.sqrt(2))
    reference = Reference("r", lambda s: ())
    assert standard(Quantity("x", "m", ""), reference, [rows, rows]).scale == 5.0
    assert standard(Quantity("x", "m", "", measure="rms"), reference, [rows, rows]).scale == pytest.approx(
        5.0 / math.sqrt(2)
    )
    with raises_naming(SceneError, "(2, 6)", "(1, 6)"):
        deviation(rows, rows[:1], "distance")


def toy() -> Plan:
    from tests.bringup import toy_study

    return toy_study.make(ends=("ok", "diverge"))


def record(settings: Settings) -> dict:
    from tests.bringup import toy_study

    return {**outcome(toy_study.task, settings), "calibration": 0.04}


def result_of(made: Plan, **changed: dict) -> dict:
    rungs, others = made.runs()
    records = {made.key(s): record(s) for s in [*rungs, *others]}
    for key, change in changed.items():
        records[key] = {**records[key], **change}
    return assemble(made, records, "0.0")


def test_a_result_has_errors_costs_front_order_and_rows_of_what_diverged() -> None:
    found = result_of(toy())
    json.dumps(found, allow_nan=False)
    ok, bad = found["points"][:3], found["points"][3:]
    size = math.hypot(1.0, 0.0)
    for p, h in zip(ok, (0.4, 0.2, 0.1), strict=True):
        assert p["error"] == pytest.approx(h**2 * math.hypot(1, 0.1) / size, rel=1e-6)
        assert p["cpu"] == pytest.approx(1e-3 / h / 2)
        assert p["cpu_median"] == pytest.approx(1.5e-3 / h / 2)
        assert p["bound"] == p["error"] + p["own_error"]
    assert [p["status"] for p in bad] == ["diverged"] * 3
    assert bad[0]["message"] == "element 7 is inverted"
    assert bad[0]["error"] is None
    assert bad[0]["cpu"] is None
    assert found["front"] == [0, 1, 2]
    assert found["cheapest"] == {"10%": 1, "5%": 1, "1%": None, "0.1%": None}
    assert found["orders"] == [
        {"settings": {"end": "ok", "gate": "", "log": ""}, "order": pytest.approx(2.0), "points": 3}
    ]
    assert found["reference"]["own_error"] == pytest.approx(1e-4 * math.hypot(1, 0.1), rel=1e-3)
    assert found["machine"]["calibration"] == 0.04
    assert found["versions"] == {"tripod": "0.0", "study": 1, "code": None}
    costs = "0.0025 CPU s per simulated second"
    assert_names(found["advice"][0], "10 and 5 %", "dt 0.2, ok", costs)
    assert_names(found["advice"][1], "1 %")
    assert_names(found["advice"][-1], "5 %", "dt 0.2", "0.4", "16.1 %")


def test_the_cheapest_is_within_in_all_that_is_promised() -> None:
    beside = Quantity("y", "m", "four times as far off", scale="largest", promised=True)
    made = replace(toy(), quantities=(*toy().quantities, beside))
    rungs, others = made.runs()
    records = {made.key(s): record(s) for s in [*rungs, *others]}
    for settings in [*rungs, *others]:
        records[made.key(settings)]["observed"]["y"] = [[1.0 + 4 * float(settings["dt"]) ** 2]]
    found = assemble(made, records, "0.0")
    assert [q["promised"] for q in found["quantities"]] == [False, True]
    assert found["points"][1]["errors"]["y"]["relative"] == pytest.approx(0.16)
    assert found["cheapest"] == {"10%": 2, "5%": 2, "1%": None, "0.1%": None}


def test_an_error_that_the_reference_cannot_tell_is_below() -> None:
    made = toy()
    made = replace(made, points=(*made.points, Point({**made.default, "dt": 0.012})))
    last = result_of(made)["points"][-1]
    assert last["below"]
    assert last["error"] < 2 * last["own_error"] < last["bound"] * 2
    assert not result_of(made)["points"][0]["below"]


def test_without_a_reference_there_are_costs_and_no_errors() -> None:
    made = toy()
    key = made.key(made.runs()[0][0])
    found = result_of(made, **{key: {"status": "time limit", "message": "given up", "observed": {}}})
    assert found["front"] == []
    assert found["points"][0]["cpu"] is not None
    assert found["points"][0]["error"] is None
    assert "given up" in found["points"][0]["message"]
    assert found["reference"]["own_error"] is None


def test_what_a_task_raises_is_its_record() -> None:
    settings = toy().default
    assert record({**settings, "end": "refuse"})["status"] == "refused"
    failed = record({**settings, "end": "bug"})
    assert (failed["status"], failed["message"]) == ("failed", "ZeroDivisionError: float division by zero")


def test_knobs_limit_a_study_and_unknown_ones_are_named() -> None:
    made = replace(
        toy(), points=(*toy().points, Point({**toy().default, "dt": 9.0, "end": "diverge"}, "known"))
    )
    kept = made.only(["dt"])
    assert {p.settings["end"] for p in kept if not p.label} == {"ok"}
    assert len(kept) == 4
    assert kept[-1].label == "known"
    with raises_naming(SceneError, "knob 'speed'", "unknown", "toy: dt, end"):
        made.only(["speed"])


def test_knobs_that_no_point_varies_alone_are_told_with_others() -> None:
    both = [Point({**toy().default, "dt": 9.0, "end": "diverge"})]
    with raises_naming(SceneError, "toy", "--knobs dt,end") as refused:
        replace(toy(), points=both).only(["end"])
    assert not names(refused.value, "--quick")
    dt_alone = [Point({**toy().default, "dt": 9.0})]
    with raises_naming(SceneError, "without --quick", "--knobs dt"):
        replace(toy(), points=dt_alone, quick=True).only(["end"])


def test_short_runs_are_repeated_and_long_ones_are_not() -> None:
    assert len(repeated(lambda: 0.01)) == 5
    assert len(repeated(lambda: 0.2)) == 3
    assert len(repeated(lambda: 2.0)) == 2
    assert len(repeated(lambda: 9.0)) == 1


@pytest.mark.parametrize("name", PLANS)
def test_every_setting_of_a_study_is_one_of_the_scene_and_keys_differ(name: str) -> None:
    for quick in (False, True):
        made = plan(name, quick=quick)
        assert made.name == name
        rungs, others = made.runs()
        keys = [made.key(s) for s in [*rungs, *others]]
        assert len(set(keys)) == len(keys)
        assert rungs
        fields = {k.field for k in made.knobs}
        for point in made.points:
            assert fields <= set(point.settings)
            assert made.group in point.settings
            full = {
                k: v
                for k, v in made.full(point.settings).items()
                if not k.startswith(("ik.", "robot.", "reference."))
            }
            assert isinstance(scene_of(made.scene, full), Scene)
        assert {r.name for r in made.references} == {q.reference for q in made.quantities}
        assert any(point.label for point in made.points), "the shipped setting is in the table"


def test_a_motion_is_refused_where_dt_does_not_meet_the_instants() -> None:
    scene = scene_of("pendulum", {"dt": 0.003})
    with raises_naming(SceneError, "dt is 0.003 s", "0.05 s", "multiple"):
        motion(scene, 0.1, 0.05, lambda s: lambda: {})


def test_a_motion_repeats_the_same_bits_and_an_unstable_one_is_an_error() -> None:
    made = plan("pendulum", quick=True)
    from tripod_study.exact_pendulum import task

    first, second = (task(made.told(made.default)) for _ in range(2))
    assert isinstance(first, Measured)
    assert first.observed == second.observed
    assert len(first.cpu) >= 3
    bad = outcome(task, {**made.told(made.default), "inertia.substeps": "off", "dt": 0.05})
    assert bad["status"] == "diverged"
    assert_names(bad["message"], "unstable")


def test_the_pendulums_reference_agrees_with_small_steps_of_rk4() -> None:
    from tripod_study.exact_pendulum import EXACT, task

    made = plan("pendulum", quick=True)
    exact = task(made.told({EXACT: 1e-10})).observed
    fine = task({**made.told(made.default), "inertia.scheme": "rk4", "dt": 2e-4}).observed
    for name, bound in (("nodes", 1e-7), ("end", 1e-6), ("amplitude", 1e-6), ("passage", 1e-6)):
        assert deviation(np.array(fine[name]), np.array(exact[name]), "distance") < bound
