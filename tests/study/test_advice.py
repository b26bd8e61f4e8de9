"""Sentences about a study: each names a command that works, and shipped studies have those of today."""

import json
from pathlib import Path

import pytest

import tripod_study
from tripod_study.advice import advice

STUDIES = sorted((Path(tripod_study.__file__).parent / "studies").glob("*.json"))


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_stored_sentences_are_those_that_the_numbers_give_now(path: Path) -> None:
    result = json.loads(path.read_text(encoding="utf-8"))
    assert result["advice"] == advice(result)
    command = "ik" if path.stem == "ik" else "run"
    offers = any(f"`tripod {command} --accuracy`" in sentence for sentence in result["advice"])
    assert offers == any(point is not None for point in result["cheapest"].values())
