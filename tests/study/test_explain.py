"""What a scene costs: the stopwatch, the parts found, the report's sums, and the command."""

import json
import re
from dataclasses import replace
from functools import partial
from importlib import import_module
from importlib.util import find_spec

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.messages import assert_names, line_naming, names, raises_naming
from tests.scenes import SHARP, held_bar
from tripod_bringup.cli import app
from tripod_bringup.explain_command import show
from tripod_sim import SceneError, Simulation, load_scene
from tripod_sim.effects import EFFECTS
from tripod_sim.linear import choice
from tripod_sim.linear.ldl import Ldl
from tripod_sim.scene.file import scene_from_toml, scene_names
from tripod_study.explain import sampling
from tripod_study.explain.costs import Cost, cost, from_itself, switched_on
from tripod_study.explain.linear import LinearUse, linear_use
from tripod_study.explain.memory import Size, memory, size
from tripod_study.explain.objects import owned, walk
from tripod_study.explain.report import Explanation, Stage, _in_place, explain
from tripod_study.explain.sampling import Sampler, StepTimes, estimate, swing
from tripod_study.explain.stages import OTHER, STAGES, time_stages
from tripod_study.explain.stopwatch import Stopwatch

TRIPOD = ["mesh.level=1"]


class Clock:
    """A time that passes only where it is told to."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


class Worker:
    def __init__(self, clock: Clock) -> None:
        self.clock = clock

    def outer(self) -> str:
        self.clock.now += 1.0
        self.inner()
        self.inner()
        self.clock.now += 2.0
        return "done"

    def inner(self) -> None:
        self.clock.now += 10.0

    def fails(self) -> None:
        self.clock.now += 5.0
        raise ValueError


def test_each_stage_counts_without_the_stages_below_it() -> None:
    clock = Clock()
    worker, watch = Worker(clock), Stopwatch("other", clock)
    watch.wrap(worker, "outer", "outer")
    watch.wrap(worker, "inner", "inner")
    watch.wrap(worker, "inner", "never: it is wrapped already")
    watch.clear()
    clock.now += 0.5
    assert worker.outer() == "done"
    assert watch.stages == ["other", "outer", "inner"]
    assert watch.times == [0.5, 3.0, 20.0]
    assert watch.calls == [0, 1, 2]
    watch.clear()
    watch.wrap(worker, "fails", "fails")
    with pytest.raises(ValueError):
        worker.fails()
    clock.now += 1.0
    worker.inner()
    assert watch.times == [1.0, 0.0, 10.0, 5.0], "after an error the time belongs to the caller again"
    watch.unwrap()
    assert "outer" not in vars(worker)
    worker.outer()
    assert watch.calls == [0, 0, 1, 1]


def test_what_timing_costs_is_counted_by_stage() -> None:
    watch, worker = Stopwatch("other"), Worker(Clock())
    watch.measure_itself()
    within, around = watch._within, watch._around
    assert within > 0
    watch.wrap(worker, "outer", "outer")
    watch.wrap(worker, "inner", "inner")
    watch.clear()
    for _ in range(5):
        worker.outer()
    assert watch.costs == pytest.approx([5 * around, 5 * within + 10 * around, 10 * within])


def test_timing_costs_more_among_others_but_not_without_bound() -> None:
    assert [_in_place(added, 2.0) for added in (3.0, 1.0, -1.0, 100.0)] == [1.5, 1.0, 1.0, 3.0]
    assert _in_place(1.0, 0.0) == 1.0


def test_every_stage_names_a_method_that_exists() -> None:
    for name, methods in STAGES.items():
        module, _, kind = name.rpartition(".")
        if module == "linear.cholmod" and not find_spec("cvxopt"):  # an optional extra
            continue
        found = getattr(import_module(f"tripod_sim.{module}"), kind)
        for method in methods:
            assert callable(getattr(found, method)), (name, method)


@pytest.mark.parametrize("name", scene_names())
def test_every_shipped_scene_has_stages(name: str) -> None:
    quick = ["mesh.level=5"] if "sofa" in name else TRIPOD if load_scene(name).mesh else []
    simulation = Simulation(load_scene(name, quick))
    watch = Stopwatch(OTHER)
    time_stages(simulation, watch)
    simulation.step()
    assert sum(watch.calls) > 0
    watch.unwrap()
    calls = list(watch.calls)
    simulation.step()
    assert watch.calls == calls, "nothing is timed afterwards"
    assert size(simulation).unknowns == simulation.unknowns


def test_timing_changes_no_bit() -> None:
    def end(*, timed: bool) -> bytes:
        simulation = Simulation(load_scene("maze", TRIPOD))
        watch = Stopwatch(OTHER)
        if timed:
            time_stages(simulation, watch)
        for k in range(8):
            simulation.step(swing(simulation, k))
        return simulation.state.positions.tobytes()

    assert end(timed=True) == end(timed=False)


def test_passes_repeat_the_same_steps() -> None:
    simulation = Simulation(load_scene(SHARP, TRIPOD))
    sampler = Sampler(simulation, 5)
    sampler.one_pass()
    first = simulation.state.positions.tobytes(), simulation.state.step
    sampler.one_pass()
    assert (simulation.state.positions.tobytes(), simulation.state.step) == first
    angles = np.array([swing(simulation, k) for k in range(400)])
    assert np.ptp(angles[:, :3], axis=0) == pytest.approx([sampling.SWING] * 3, rel=1e-3)
    assert (angles[:, 3] == 0).all()


def test_the_least_of_all_passes_counts() -> None:
    passes = [np.array([1.0, 5.0]), np.array([2.0, 2.0]), np.array([9.0, 3.0]), np.array([1.5, 9.0])]
    found = estimate(passes)
    assert found.mean == 1.5  # (1 + 2) / 2
    assert found.noise == pytest.approx(abs((1.0 + 3.0) / 2 - (1.5 + 2.0) / 2))


def test_arrays_are_found_once_and_by_their_owner() -> None:
    simulation = Simulation(load_scene(SHARP, TRIPOD))
    arrays = [(a, owner) for a, owner in walk(simulation) if isinstance(a, np.ndarray)]
    assert len({id(a) for a, _ in arrays}) == len(arrays)
    owners = {id(a): owner for a, owner in arrays}
    matrices = owned(simulation._system.elastic.terms[0].matrices)
    assert owners[id(matrices)] == "tripod_sim.forces.solid_arrays"
    parts = memory(simulation)
    assert parts["solid"] >= matrices.nbytes
    mine = {id(a): a.nbytes for a, _ in arrays}
    assert sum(parts.values()) == sum(mine.values())
    assert next(size for part, size in parts.items() if part.startswith("statics")) > 0


def test_memory_that_many_arrays_show_is_counted_once() -> None:
    whole = np.zeros((4, 3))
    views = [whole[1:], whole.T, whole.reshape(-1)[::2]]
    found = [a for a, _ in walk({"views": views, "again": (whole, partial(np.dot, whole))})]
    assert [a is whole for a in found] == [True]


def test_sizes_are_those_of_the_matrices() -> None:
    simulation = Simulation(load_scene(SHARP, TRIPOD))
    system, found = simulation._system, size(simulation)
    assert found.nonzeros == system.reduction.pattern.nnz
    assert found.factor_entries == system.linear.entries
    assert found.nodes == len(simulation.mesh.nodes)
    assert found.elements == len(simulation.mesh.elements)
    springs = Simulation(load_scene("cloth", ["springs.nodes=5"]))
    found = size(springs)
    assert found.elements == len(springs.mesh.ends)
    assert found.nonzeros == springs._system.reduction.pattern.nnz
    assert found.factor_entries > found.nonzeros / 2


def solved(*words: str) -> tuple[Simulation, LinearUse | None]:
    """Return a falling bar of tetrahedra after 12 steps, and how they solved their linear systems."""
    simulation, reports = Simulation(scene_from_toml(held_bar((14, 2, 2)), words)), []
    for _ in range(12):
        simulation.step()
        reports.append(simulation.report)
    return simulation, linear_use(simulation, reports)


def test_the_linear_solver_is_told_with_its_work() -> None:
    simulation, use = solved()
    assert use is not None
    system = simulation._system
    entries = Ldl(system.reduction.pattern).entries
    assert (use.solver, use.entries, use.iterations) == ("ldl", entries, 0.0)
    assert_names(use.reuse, "L-BFGS")
    assert 0 < use.hessians < 0.5 < use.solutions
    assert 8 * entries < use.memory < sum(memory(simulation).values())
    _, newton = solved("time_error={}")
    assert newton is not None
    assert use.hessians < newton.hessians
    assert not names(newton.reuse, "L-BFGS")


def test_iterations_are_told_of_conjugate_gradients_and_the_factor_that_they_spare(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, direct = solved()
    _, named = solved("solver.linear=cg")
    monkeypatch.setattr(choice, "SMALL", 100)
    monkeypatch.setattr(choice, "LARGE", 1000)
    _, large = solved()
    assert direct and named and large
    assert (named.solver, large.solver) == ("cg", "multigrid" if find_spec("pyamg") else "cg")
    assert named.iterations > 10 * named.solutions
    assert (large.iterations == named.iterations) == (large.solver == "cg")
    assert large.entries == named.entries == direct.entries
    assert large.memory < direct.memory
    assert_names(named.why, "solver.linear", "cg")
    assert_names(large.why, "auto", "0.001 million")
    assert_names(direct.why, "auto", "1 million")


def test_an_explicit_scheme_solves_no_linear_system() -> None:
    assert solved("inertia.scheme=semi_implicit_euler", "dt=1e-4", "mesh.cells=[4,1,1]")[1] is None


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few steps, so that tests are quick; what they find is the same."""
    monkeypatch.setattr(sampling, "AHEAD", 0.01)
    monkeypatch.setattr(sampling, "MOST", 4)
    monkeypatch.setattr(sampling, "FEWEST", 2)


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize(
    ("source", "words", "stages"),
    [
        (
            SHARP,
            TRIPOD,
            {"elastic forces", "reduction", "back-substitution", "inertia", "dampers", "servo arms"},
        ),
        ("maze", TRIPOD, {"ball", "gravity"}),
        (SHARP, [*TRIPOD, "inertia=off", "damping=off"], {"load increments", "factorisation"}),
        (
            "cloth",
            ["springs.nodes=6"],
            {"gradient", "factorisation", "back-substitution", "inertia"},
        ),
        ("cloth", ["springs.nodes=6", "solver.linear=cg"], {"conjugate gradients"}),
        ("pendulum", [], {"compiled loop", "compiled loop: its call"}),
        ("drape", ["springs.source=grid", "springs.nodes=5", "springs.size=0.3"], {"contact: near pairs"}),
        ("pendulum", ["inertia.scheme=bdf2", "strain_limit={}"], {"strain limit", "gradient"}),
        (
            "silicone_free",
            [*TRIPOD, "inertia.scheme=semi_implicit_euler"],
            {"stability limit", "explicit parts"},
        ),
    ],
)
def test_stages_make_up_the_step(source: str, words: list[str], stages: set[str]) -> None:
    found = explain(source, words, costs=False)
    for stage in stages:
        assert any(s.name.startswith(stage) for s in found.stages), stage
    assert found.stages[-1].name == OTHER
    assert sum(s.seconds for s in found.stages) == pytest.approx(found.step.mean)
    assert all(np.isfinite(s.seconds) for s in found.stages)
    assert found.step.mean > 0
    assert found.absent == ()


@pytest.mark.usefixtures("short")
def test_what_is_absent_is_measured_or_says_why_not() -> None:
    told: list[str] = []
    found = explain("silicone", TRIPOD, progress=lambda done, text: told.append(text))
    costs = {c.effect: c for c in found.absent}
    assert set(costs).isdisjoint(found.named)
    assert costs["effector"].seconds is not None
    assert costs["effector"].why_not == ""
    assert costs["clamp"].seconds is None
    assert_names(costs["clamp"].why_not, "clamp", "servos")
    assert_names(costs["strain_limit"].why_not, "strain_limit", "springs")
    assert "switching on effector" in told


@pytest.mark.usefixtures("short")
def test_what_typical_steps_do_not_show_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, words in ("gravity", "a tide each day"), ("effector", "a look each hour"):
        monkeypatch.setitem(EFFECTS, name, replace(EFFECTS[name], seldom=words))
    found = explain("silicone", TRIPOD)
    line_naming("\n".join(found.notes), "gravity", "a tide each day")
    assert {c.effect: c.besides for c in found.absent if c.besides} == {"effector": "a look each hour"}


def test_the_price_of_estimates_is_their_share() -> None:
    assert_names(EFFECTS["mesh_error"].seldom, "mesh_error.share", 0.12)


@pytest.mark.usefixtures("short")
def test_what_would_take_too_long_is_left_out_and_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tripod_study.explain.costs.PATIENCE", 1e-6)
    found = {c.effect: c for c in explain("silicone", TRIPOD).absent}
    assert found["effector"].seconds is None
    assert_names(found["effector"].why_not, "left out", "1e-06 s")
    assert_names(found["clamp"].why_not, "clamp", "servos")


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("rounds", [1, 2])
def test_an_effect_that_takes_too_long_is_told_from_fewer_passes_or_left_out(
    rounds: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    base = Sampler(Simulation(load_scene("silicone", TRIPOD)))
    clock = iter([0.0] * (1 + rounds) + [1e3])
    monkeypatch.setattr("tripod_study.explain.costs.thread_time", lambda: next(clock))
    found = cost("effector", "silicone", TRIPOD, base, 5, 0.0)
    assert (found.seconds is None) == (rounds == 1)
    assert found.why_not.startswith("left out") == (rounds == 1)
    assert next(clock, None) is None


@pytest.mark.usefixtures("short")
def test_what_is_less_than_the_scene_differs_from_itself_is_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    twins: list[tuple[Simulation, Simulation]] = []

    def differs(twin: Simulation, base: Sampler, steps: int) -> float:
        twins.append((twin, base.simulation))
        return from_itself(twin, base, steps) + 100.0

    monkeypatch.setattr("tripod_study.explain.report.from_itself", differs)
    measured = [c for c in explain("silicone", TRIPOD).absent if c.seconds is not None]
    assert measured and all(abs(c.seconds or 0.0) < c.noise > 100.0 for c in measured)
    ((twin, simulation),) = twins
    assert twin is not simulation and twin.scene == simulation.scene


def test_a_difference_within_its_noise_is_told_as_below_that_and_a_larger_one_as_itself(
    capsys: pytest.CaptureFixture[str],
) -> None:
    found = explain_scene()
    costs = (Cost("maze", "", ("maze={}",), -3e-6, 5e-6), Cost("sleep", "", ("sleep={}",), 4e-5, 5e-6))
    assert [cost.measured for cost in costs] == [False, True]
    show(replace(found, absent=costs))
    out = capsys.readouterr().out
    assert_names(line_naming(out, "maze={}"), "below 5.0")
    assert not names(line_naming(out, "maze={}"), "3.0")
    assert_names(line_naming(out, "sleep={}"), "40.0")


def explain_scene() -> Explanation:
    times, scene = StepTimes(1e-3, 1e-5), load_scene("silicone")
    size = Size(unknowns=3, nodes=3, elements=1, nonzeros=0, factor_entries=0)
    stages = (Stage("other", 1e-3),)
    return Explanation(scene, 1.0, 0.0, 4, times, stages, 1e-3, None, {}, size, None, (), (), ())


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("effect", ["fixed", "prescribed"])
def test_among_rigid_bodies_alone_there_are_no_nodes_to_hold(effect: str) -> None:
    base = Sampler(Simulation(load_scene("bounce")))
    assert_names(cost(effect, "bounce", [], base, 1, 0.0).why_not, effect, "soft body")


def test_a_fixed_box_holds_one_end_of_the_body() -> None:
    simulation = Simulation(load_scene("silicone_free", TRIPOD))
    (word,) = switched_on("fixed", simulation)
    fixed = Simulation(load_scene("silicone_free", [*TRIPOD, word]))
    held = fixed._system.groups.fixed
    assert 3 <= len(held) < len(simulation.mesh.nodes) / 2


@pytest.mark.parametrize(
    ("effect", "source", "words"),
    [
        (
            "prescribed",
            "silicone",
            ['set=[{name="end", low=[0.04, -1, -1]}]', 'load=[{set="end", mass=0.001}]'],
        ),
        ("prescribed", "silicone", ["fixed.0.low=[-1, -1, -1]", "fixed.0.high=[-0.02, 1, 1]"]),
        ("prescribed", "finger", []),
        ("fixed", "two_cloths", ['rigid=[{shape="ball", position=[-1, 0, 2]}]']),
    ],
)
def test_what_holds_nodes_is_added_to_what_the_scene_has(effect: str, source: str, words: list[str]) -> None:
    coarse = TRIPOD if source == "silicone" else []
    before = Simulation(load_scene(source, [*coarse, *words]))
    after = Simulation(load_scene(source, [*coarse, *words, *switched_on(effect, before)]))
    assert len(after.fixed) > len(before.fixed)
    assert after.scene.set[: len(before.scene.set)] == before.scene.set


def test_bad_input_is_named() -> None:
    with raises_naming(SceneError, "--at is -1 s", "0 to"):
        explain(SHARP, TRIPOD, at=-1.0)
    with raises_naming(SceneError, "--at is nan s"):
        explain(SHARP, TRIPOD, at=float("nan"))


@pytest.mark.usefixtures("short")
def test_the_command_prints_tables_or_json() -> None:
    words = ["explain", "tripod", "--set", "mesh.level=1", "--no-costs", "--at", "0.02"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.stderr
    assert_names(done.stdout, "elastic forces", "unknowns", "all arrays")
    line_naming(done.stdout, "linear solver", "ldl", "solutions", "MB")
    line_naming(done.stdout, "effects", "gravity", "inertia", "damping", "servos", "clamp", "effector")
    done = CliRunner().invoke(app, [*words, "--json"])
    table = json.loads(done.stdout)
    assert table["scene"] == "tripod"
    assert table["linear"]["solver"] == "ldl"
    assert table["linear"]["solutions"] > 0
    assert table["first"] == pytest.approx(0.02)
    assert sum(s["share"] for s in table["stages"]) == pytest.approx(1.0)
    assert table["memory"]["total"] == sum(table["memory"]["parts"].values())


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["trpod"], ("scene 'trpod'", "tripod")),
        (["tripod", "--set", "dt=-1"], ("dt is -1.0", "at least 1e-09 s", "at most 1 s")),
    ],
)
def test_bad_arguments_end_with_2_and_one_line(words: list[str], named: tuple[str, ...]) -> None:
    done = CliRunner().invoke(app, ["explain", *words])
    assert done.exit_code == 2
    assert_names(done.stderr, *named)
    assert len(done.stderr.splitlines()) == 1


def test_a_time_before_the_start_is_refused_with_its_range() -> None:
    done = CliRunner().invoke(app, ["explain", "tripod", "--at", "-1"])
    assert done.exit_code == 2
    assert_names(re.sub(r"[\s│]+", " ", done.stderr), "--at", "-1 s", 0, "1.5")
