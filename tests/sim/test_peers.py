"""The comparison with other simulators: its own side, its table, and a peer where one is installed."""

import json
import math
from importlib.util import find_spec

import numpy as np
import pytest

from benchmarks import peers, peers_cases, peers_own, peers_report
from benchmarks.peers import Row
from tests.messages import assert_names, raises_naming

PACKAGE = "to install: pip install tripod[peers]"


def _quick(module, case):
    return next(s for s in module.SETTINGS[case] if s.quick)


def _stored(reference):
    return {
        "values": reference.values.tolist(),
        "scale": reference.scale,
        "uncertainty": 1.0,
        "source": "test",
    }


def test_our_bar_sags_as_beam_theory_says(monkeypatch):
    monkeypatch.setattr(peers_cases, "GRAVITY", 0.05)  # little weight: small displacements
    monkeypatch.setattr(peers_cases, "POISSON", 0.0)  # the held section does not hinder
    options = {"element": "h8_modes", "cells": (10, 2, 2)}
    sag = -peers_own.prepare("cantilever rest", options).run().item()
    load = peers_cases.MASS * peers_cases.GRAVITY / peers_cases.LENGTH
    bending = load * peers_cases.LENGTH**4 / (8 * peers_cases.YOUNG * peers_cases.SIDE**4 / 12)
    shear = load * peers_cases.LENGTH**2 / (2 * 5 / 6 * peers_cases.SIDE**2 * peers_cases.YOUNG / 2)
    assert sag == pytest.approx(bending + shear, rel=0.01)


def test_our_bar_swings_to_twice_its_sag_and_back_twice_alike():
    prepared = peers_own.prepare("cantilever swing", _quick(peers_own, "cantilever swing").options)
    first = prepared.run()
    assert first.shape == (25, 1, 1)
    assert -0.033 < first.min() < -0.025
    assert abs(first[18:21].max()) < 0.006  # after a period it is nearly up again
    np.testing.assert_array_equal(first, prepared.run())


def test_the_error_is_the_largest_over_the_samples_of_the_rms_over_the_points():
    reference = peers_cases.Reference(np.zeros((2, 4, 3)), 2.0, 0.0, "zero")
    values = np.zeros((2, 4, 3))
    values[0, 0, 0], values[1, 0] = 0.2, (0.0, 0.3, 0.4)
    assert reference.error(values) == pytest.approx(100 * 0.25 / 2)
    for lost in (np.nan, np.inf):
        values[0, 0, 0] = lost
        assert math.isnan(reference.error(values))


def test_a_limit_is_found_from_three_meshes_even_below_first_order():
    values = [3.0 + 0.5 * m**-0.65 for m in (1, 2, 3)]
    limit, off = peers_own.extrapolated(values, [1, 2, 3])
    assert limit == pytest.approx(3.0, abs=1e-9)
    assert off == pytest.approx(0.5 * 3**-0.65)
    assert peers_own.extrapolated([1.0, 2.0, 1.5], [1, 2, 3]) == (1.5, 0.5)  # no power of the edge


def test_every_setting_divides_the_samples_and_has_its_own_name():
    for case in peers.CASES:
        settings = peers_own.SETTINGS[case]
        assert len({s.name for s in settings}) == len(settings)
        assert any(s.quick for s in settings)
        for s in settings:
            if dt := s.options.get("dt"):
                steps = peers_cases.SAMPLE[case] / dt
                assert steps == pytest.approx(round(steps))
    assert peers.CASES == peers_cases.CASES


def test_a_missing_peer_gives_a_row_that_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(peers.PEERS, "Nowhere", ("benchmarks.peers_nowhere", "no_such_package"))
    found = {"references": {"y L1": _stored(peers_own.reference("y L1"))}, "rows": []}
    store = tmp_path / "peers.json"
    peers.compute(found, ["y L1"], ["Nowhere"], quick=True, store=store)
    assert [row.note for row in peers.read(store)["rows"]] == [peers.MISSING]
    assert_names("\n".join(peers_report.table(found["rows"], "y L1")), "pip install 'tripod[peers]'")


def test_what_is_measured_is_stored_and_not_measured_again(tmp_path, monkeypatch):
    found = {"references": {"y L1": _stored(peers_own.reference("y L1"))}, "rows": []}
    store, asked = tmp_path / "peers.json", []

    def measured(peer, case, settings, reference, limit):
        asked.extend(settings)
        for name in settings:
            yield next(peers.work(peer, case, [name], reference))

    monkeypatch.setattr(peers, "measure", measured)
    for _ in range(2):
        peers.compute(found, ["y L1"], ["tripod"], quick=True, store=store)
        found = peers.read(store)
    assert asked == [_quick(peers_own, "y L1").name]
    (row,) = found["rows"]
    assert row.error == pytest.approx(8.1, abs=0.3)  # as docs/accuracy.md has it for level 1
    assert row.cpu is not None
    assert row.calibration > 0


def test_a_setting_that_crashes_or_hangs_costs_its_own_row_alone(monkeypatch):
    reference = json.dumps(_stored(peers_own.reference("y L1")))
    rows = list(peers.measure("tripod", "y L1", ["no such setting"], json.loads(reference)))
    assert [(r.setting, r.error) for r in rows] == [("no such setting", None)]
    assert rows[0].note.startswith("crashed")
    name = _quick(peers_own, "y L1").name
    rows = list(peers.measure("tripod", "y L1", [name], json.loads(reference), limit=0.01))
    assert_names(rows[0].note, "over 0.01 s")


def test_a_store_that_is_damaged_is_named(tmp_path):
    store = tmp_path / "peers.json"
    store.write_text("{")
    with raises_naming(SystemExit, store, "--fresh"):
        peers.read(store)


def test_the_front_has_no_row_that_another_beats():
    rows = [
        Row("cloth", "tripod", error=e, cpu=c, simulated=1.0)
        for e, c in ((10.0, 0.1), (1.0, 1.0), (2.0, 2.0), (0.1, 5.0))
    ]
    assert [r.error for r in peers_report.pareto([*rows, Row("cloth", "MuJoCo", note="diverged")])] == [
        10,
        1,
        0.1,
    ]


def test_a_peer_that_is_better_is_named():
    rows = [
        Row("cloth", "tripod", setting="a", error=1.0, cpu=2.0, simulated=1.0),
        Row("cloth", "MuJoCo", setting="b", error=0.5, cpu=1.0, simulated=1.0),
    ]
    told = peers_report.losses(rows, "cloth", 0.0)
    assert_names(told, "MuJoCo (b)", "0.5 %", "none of our settings", "time: a.")
    assert_names(peers_report.losses(rows, "cloth", 1.0), "0.5 %", "MuJoCo", "2 times as fast")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "case", "most"), [
    ("MuJoCo", "cantilever rest", 3.0), ("MuJoCo", "cloth", 6.0), ("PyBullet", "cantilever swing", 40.0),
    ("Newton", "cloth", 40.0),
])  # fmt: skip
def test_a_peer_that_is_installed_runs(name, case, most):
    module, package = peers.PEERS[name]
    if find_spec(package) is None:
        pytest.skip(f"{name} is not installed; {PACKAGE}")
    if case == "cloth":
        right = peers_own.prepare("cloth", _quick(peers_own, "cloth").options).run()
        reference = peers_cases.Reference(right, 1.0, 0.0, "ours")
    elif case == "cantilever swing":
        right = peers_own.prepare(case, peers_own.SETTINGS[case][4].options).run()
        reference = peers_cases.Reference(right, float(np.abs(right).max()), 0.0, "ours")
    else:
        right = peers_own.prepare(case, peers_own.SETTINGS[case][1].options).run()
        reference = peers_cases.Reference(right, float(abs(right.item())), 0.0, "ours")
    names = [_quick(peers.import_module(module), case).name]
    (row,) = peers.measure(name, case, names, _stored(reference))
    assert row.error is not None, row.note
    assert row.error < most
