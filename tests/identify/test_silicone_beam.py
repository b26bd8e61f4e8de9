"""The scene of the silicone beam, against the theory of beams; the data themselves are not here."""

from pathlib import Path

import pytest

from benchmarks.silicone_beam import POINTS, SCENE, told_rest
from tripod_sim import load_scene

WIDTH, LENGTH, G = 0.03, 0.1, 9.81


def test_the_scene_is_short() -> None:
    assert len(Path(SCENE).read_text().splitlines()) < 40
    assert len(POINTS) == 3


@pytest.mark.parametrize(("words", "force"), [(["load=off"], 0.0), ([], 0.052 * G)])
def test_a_stiff_beam_sinks_as_a_beam_with_shear(words: list[str], force: float) -> None:
    """w L^4 / 8 E I + P L³ / 3 E I, and (w L / 2 + P) L / k G A with k = 5/6.

    With E ten times as large it bends little, and without Poisson's ratio the clamp does not stiffen it.
    """
    young, poisson = 2.6e6, 0.0
    weight, second = 1070 * WIDTH**2 * G, WIDTH**4 / 12
    bent = (weight * LENGTH**4 / 8 + force * LENGTH**3 / 3) / (young * second)
    sheared = (weight * LENGTH / 2 + force) * LENGTH / (5 / 6 * young / (2 * (1 + poisson)) * WIDTH**2)
    fine = ["mesh.element=h20", f"material.young={young}", f"material.poisson={poisson}"]
    assert told_rest(load_scene(SCENE, [*words, *fine])) == pytest.approx(bent + sheared, rel=0.04)
