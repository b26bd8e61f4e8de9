"""The film of a run that is still going on: what the page asks for, from the arrays as they are by then. Pure."""

import time
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tripod_view.player.camera import camera
from tripod_view.player.film import Colouring, Film
from tripod_view.player.html import player_page
from tripod_view.player.of_run import RATE, Fields, film_of
from tripod_view.player.packing import reel, stage

WAIT = 0.05
"""Between two looks whether there is a first step [s]."""


class GrowingFilm:
    """Asked by the threads of the server, while another one goes on with the run."""

    def __init__(
        self, arrays: Callable[[], Mapping[str, Any]], dt: float, fields: Fields | None = None,
        colouring: Colouring | None = None,
    ) -> None:  # fmt: skip
        """`arrays`: returns those of the steps made so far, `dt` [s] apart; `fields`, `colouring`: see `film_of`."""
        self._fields, self._colouring = fields, colouring
        self._arrays, self._stride, self._done = arrays, max(1, int(1 / (RATE * dt) + 1e-9)), False

    def finish(self) -> None:
        """Note that no steps will follow."""
        self._done = True

    def page(self) -> str:
        """Return the page, as soon as there is a step to show."""
        while not len((arrays := self._arrays())["time"]):
            time.sleep(WAIT)
        first = np.zeros(1, dtype=np.int64)
        return player_page(
            stage(film_of(arrays, first, fields=self._fields, colouring=self._colouring)), None
        )

    def reel(self, first: int) -> dict[str, Any]:
        """Return the pictures from `first` on, None for none yet; the camera for all so far; whether that is all."""
        done = self._done  # asked before the arrays: nothing that comes between is lost
        arrays = self._arrays()
        steps = self._shown(len(arrays["time"]), done)
        if first >= len(steps):
            return {"reel": None, "done": done}
        before = float(arrays["time"][steps[first - 1]]) if first else -np.inf
        found = film_of(arrays, steps[first:], after=before, fields=self._fields)
        return {"reel": reel(found), "camera": asdict(camera(self._sparse(arrays, steps))), "done": done}

    def _shown(self, count: int, done: bool) -> NDArray[np.int64]:
        steps = np.arange(0, count, self._stride)
        return np.append(steps, count - 1) if done and count and steps[-1] != count - 1 else steps

    def _sparse(self, arrays: Mapping[str, Any], steps: NDArray[np.int64]) -> Film:
        """Return few of the pictures: enough to see how far things went."""
        return film_of(arrays, np.unique(np.append(steps[:: max(1, len(steps) // 50)], steps[-1])))
