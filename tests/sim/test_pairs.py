"""Every pair of effects, elements, schemes, solvers and kinds of body works, or is refused as docs/effects.md says."""

import numpy as np
import pytest

from benchmarks import pairs
from benchmarks.doc_parts import DOCS
from tests.messages import assert_names
from tripod_sim.effects import EFFECTS

FEW = ("solid", "springs", "gravity", "damping", "contact", "h8", "bdf2", "statics")


@pytest.mark.slow
def test_every_pair_works_or_is_refused_as_the_page_says() -> None:
    assert {*EFFECTS} - {"inertia"} <= {*pairs.THINGS}
    found = pairs.look(quick=True)
    assert not found.broken, "neither works nor is refused by one line"
    unknown = {text for text in found.refusals.values() if text and pairs.reason(text) < 0}
    assert not unknown, "say in WHY of benchmarks/pairs.py whose they are"
    stale = "docs/effects.md is of other code: python benchmarks/pairs.py writes it"
    lines = "\n".join(pairs.document(found))
    assert f"<!-- {pairs.PART} -->\n\n{lines}\n\n<!-- end" in (DOCS / pairs.PAGE).read_text("utf-8"), stale


def test_few_scenes_find_what_one_for_each_pair_finds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pairs, "THINGS", {name: pairs.THINGS[name] for name in FEW})
    monkeypatch.setattr(pairs, "KINDS", ("solid", "springs"))
    few, all_ = pairs.look(quick=True), pairs.look(quick=False)
    assert few.refusals == all_.refusals
    assert few.builds < all_.builds / 2
    assert not all_.broken
    works = {pair for pair, why in few.refusals.items() if not why}
    assert ("solid", "damping", "h8") in works
    assert_names(few.refusals["springs", "damping", "statics"], "damping", "inertia")


def test_a_pair_is_seen_on_its_own_kind_of_body_and_in_one_scene_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scenes: list[set[str]] = []

    def tried(self: pairs.Checker, kind: str, names: tuple[str, ...]) -> tuple[str, str]:
        scenes.append({*pairs.closure((kind, *names))})
        return "", ""

    monkeypatch.setattr(pairs.Checker, "tried", tried)
    few = ("solid", "springs", "gravity", "damping", "h8")
    monkeypatch.setattr(pairs, "THINGS", {name: pairs.THINGS[name] for name in few})
    monkeypatch.setattr(pairs, "KINDS", ("solid", "springs"))
    pairs.look(quick=True)
    assert scenes == [{*few}, {"springs", "gravity", "damping"}]


@pytest.mark.parametrize("fault", ["raises", "is not a number"])
def test_a_pair_that_is_neither_refused_nor_works_is_told(
    fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Faulty(pairs.Simulation):
        def step(self, joints: np.ndarray | None = None):  # type: ignore[no-untyped-def]
            report = super().step(joints)
            if self.scene.gravity and self.scene.damping:
                if fault == "raises":
                    raise KeyError("both")
                self.state.velocities[0, 0] = np.nan
            return report

    monkeypatch.setattr(pairs, "Simulation", Faulty)
    monkeypatch.setattr(
        pairs, "THINGS", {name: pairs.THINGS[name] for name in ("solid", "gravity", "damping", "h8")}
    )
    monkeypatch.setattr(pairs, "KINDS", ("solid",))
    assert set(pairs.look(quick=True).broken) == {("solid", "gravity", "damping")}
