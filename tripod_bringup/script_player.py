"""Plays a script once everything is up, tells how it ended, and leaves the graph."""

from collections.abc import Callable, Sequence

from rclpy.executors import Executor

from tripod_play.joint_path import JointPath
from tripod_play.replay_node import ReplayNode


class ScriptPlayer:
    """Lives in the thread that runs the nodes.

    Attributes:
        wanted: Whether the script shall play; may be set by another thread.
    """

    def __init__(
        self,
        path: JointPath,
        executor: Executor,
        say: Callable[[str], None],
        *,
        wanted: bool = False,
        simulated: Sequence[float] | None = None,
    ) -> None:
        """`simulated`: go by a simulator with these slew rates [rad/s, m/s, N/s, Pa/s] instead of by the driver."""
        self.wanted = wanted
        self._path, self._executor, self._say, self._simulated = path, executor, say, simulated
        self._node: ReplayNode | None = None
        self._over = False

    def tend(self) -> None:
        """Begin or end, if it is time; call it again and again."""
        if self._over or not self.wanted:
            return
        if self._node is None:
            self._node = ReplayNode(self._path, name="script", simulated=self._simulated)
            self._executor.add_node(self._node)
        elif self._node.done:
            self._say(f"script: {self._node.done}")
            self.close()

    def close(self) -> None:
        """Leave the graph, if it is there still; it does not come back."""
        self._over = True
        if self._node is not None:
            self._executor.remove_node(self._node)
            self._node.close()
            self._node = None
