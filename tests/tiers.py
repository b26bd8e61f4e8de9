"""Which cases of a test run in `make test`, and which in `make test-slow` alone."""

from collections.abc import Iterable

import pytest


def sampled(cases: Iterable[object], *fast: object) -> list[object]:
    """Return `cases` for `pytest.mark.parametrize`, those that are not in `fast` marked `slow`.

    Raises:
        ValueError: if one of `fast` is no case.
    """
    every = list(cases)
    if unknown := [case for case in fast if case not in every]:
        raise ValueError(f"{unknown} is not among {every}")
    return [case if case in fast else _slow(case) for case in every]


def _slow(case: object) -> object:
    values = case if isinstance(case, tuple) else (case,)
    return pytest.param(*values, marks=pytest.mark.slow)
