"""Hot swap: builds a changed simulation, kernels compiled, beside the running one that it replaces. Without ROS."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tripod_host.priority import stand_back
from tripod_sim.errors import SceneError, StepError
from tripod_sim.scene import Scene
from tripod_sim.scene.file import load_scene
from tripod_sim.simulation import Simulation

PATIENCE = 0.5
"""How long the end waits for what is being built [s]."""


@dataclass(frozen=True)
class Replacement:
    """A simulation that is ready to replace the running one.

    Attributes:
        changes: Overrides that it was built with beside those that all have.
        simulation: In its start state.
    """

    changes: tuple[str, ...]
    simulation: Simulation


class HotSwap:
    """Builds the simulation that was requested last, in a thread.

    Attributes:
        ready: The simulation that was requested; None until it is built.
    """

    def __init__(self, refuse: Callable[[str], None]) -> None:
        """`refuse`: told why a wish cannot be built, in any thread; all goes on as it is."""
        self.ready: Replacement | None = None
        self._refuse, self._lock = refuse, threading.Lock()
        self._wished: tuple[tuple[str, ...], Scene] | None = None
        self._work: threading.Thread | None = None

    @property
    def changes(self) -> tuple[str, ...] | None:
        """Those of the newest wish that is being built; None without one."""
        wished = self._wished
        return wished[0] if wished else None

    @property
    def words(self) -> str:
        """What is being built, for people; empty while nothing is."""
        changes = self.changes
        if changes is None:
            return ""
        return f"building the scene {_named(changes)}; the simulation continues unchanged until it is ready"

    def wish(self, source: str, overrides: Sequence[str], changes: Sequence[str]) -> None:
        """Begin to build a scene with `overrides` and `changes`, in place of what is being built. Raises SceneError."""
        wished = tuple(changes), load_scene(source, [*overrides, *changes])
        with self._lock:
            idle, self._wished = self._wished is None, wished
            if idle:
                self._work = threading.Thread(target=self._build, name="hot swap", daemon=True)
                self._work.start()

    def close(self) -> None:
        """Build nothing more."""
        self._refuse = _ignore
        if self._work:
            self._work.join(PATIENCE)

    def _build(self) -> None:
        stand_back()
        while True:
            wished = self._wished
            assert wished
            simulation, why = None, ""
            try:
                simulation = Simulation(wished[1])
                simulation.rehearse()
            except Exception as error:  # noqa: BLE001 - a thread that just died would seem to build for ever
                told = isinstance(error, SceneError | StepError)
                why = str(error) if told else f"{type(error).__name__}: {error}"
                simulation, why = None, f"the simulation cannot continue {_named(wished[0])}: {why}"
            with self._lock:
                if self._wished is not wished:
                    continue
                self._wished = None
                self.ready = Replacement(wished[0], simulation) if simulation else None
            if why:
                self._refuse(why)
            return


def _named(changes: Sequence[str]) -> str:
    return f"with {'; '.join(changes)}" if changes else "as it was described"


def _ignore(_: str) -> None:
    pass
