"""Commands that do not make a body swing: the way of those that are wanted, gone along more smoothly.

A body that hardly damps its swings keeps those that a sudden change of speed gives it. So the place along the way that
the commands took, its length s measured by the servo that turns most, is a mean over a time T,

    s(t) = 1/T integral of s_wanted from t - T to t,

which of a frequency f lets through the part |sin(pi f T) / (pi f T)|, and makes of a jump of speed by v an acceleration
of v/T: an input shaper [SingerSeering1990]. It leaves neither the way nor, as a mean does, the speed of the wanted one.

Pure: the caller gives the time.
"""

from collections import deque
from math import inf

import numpy as np

from tripod_host.arrays import FloatArray

CATCHING_UP = 2.0
"""How fast the beginning of the mean moves on where its time gets shorter, over the clock's speed: a mean that ends
at once would be a jump.
"""


class Smoothing:
    """The last commands, and how far along them the body has been sent."""

    def __init__(self) -> None:
        """Begin without a command."""
        self._known: deque[tuple[float, float, FloatArray]] = deque()  # time, length of the way, angles
        self._begin = -inf
        self._sent, self._place = 0.0, np.zeros(0)

    def reset(self) -> None:
        """Forget all commands."""
        self._known.clear()

    @property
    def place(self) -> FloatArray | None:
        """The last command that was returned [rad], shape (n,); None before the first."""
        return self._place if self._known else None

    def cut(self) -> FloatArray | None:
        """Forget the way that is not gone yet, as though the body had stood where that begins.

        Returns:
            Where it begins [rad], shape (n,); None before the first command.
        """
        if not self._known:
            return None
        self._stand(self._known[-1][0], self._place)
        return self._place

    def command(self, wanted: FloatArray, now: float, over: float, speed: float) -> FloatArray:
        """Return what to command [rad], shape (n,).

        Args:
            wanted: What is wanted since the last call [rad], shape (n,); the first is returned as it is.
            now: [s], not falling.
            over: Time of the mean [s]; it gets as long as time goes by, and shorter by `CATCHING_UP`.
            speed: Of a servo, at most [rad/s].
        """
        if not self._known:
            self._stand(now, wanted)
            return wanted
        before, length, last = self._known[-1]
        since = max(now - before, 0.0)
        self._known.append((now, length + float(np.abs(wanted - last).max()), wanted))
        end = now - over
        self._begin = (
            end if self._begin == -inf else max(self._begin, min(end, self._begin + CATCHING_UP * since))
        )
        while len(self._known) > 2 and self._known[1][0] <= self._begin and self._known[1][1] <= self._sent:
            self._known.popleft()
        times, lengths, angles = (np.array(column) for column in zip(*self._known, strict=True))
        times[0] = min(times[0], self._begin)
        held = np.diff(np.maximum(times, self._begin))
        total = float(held.sum())
        place = float(held @ lengths[1:]) / total if total > 0 else float(lengths[-1])
        self._sent = min(max(place, self._sent), self._sent + speed * since)
        self._place = np.array([np.interp(self._sent, lengths, column) for column in angles.T])
        return self._place

    def _stand(self, now: float, place: FloatArray) -> None:
        """Be at `place` [rad] as though that had been so for long."""
        self._known = deque([(now, 0.0, place), (now, 0.0, place)])
        self._begin, self._sent, self._place = -inf, 0.0, place
