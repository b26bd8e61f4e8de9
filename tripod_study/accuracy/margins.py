"""How much larger an error may be in other motions or poses than in those of a study."""

MARGIN = 3.0
"""Error in other cases over that in a study's own, where it was not measured."""

MEASURED = {"tripod_static": (1.7,), "tripod_dynamic": (1.8, 2.6), "pendulum": (4.0,), "cloth": (12.0,)}
"""The same by study, for each quantity that it promises, measured by benchmarks/accuracy_promise.py. A study that lets
a cloth fall is gentler than cloths that are thrown and fold."""


def margins(study: str, count: int) -> tuple[float, ...]:
    """Return by how much an error may be larger in other cases than in a study's own.

    Args:
        study: Name of the study.
        count: Of the quantities that it promises.

    Returns:
        A factor for each quantity.
    """
    return (*MEASURED.get(study, ()), *(MARGIN,) * count)[:count]
