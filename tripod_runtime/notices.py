"""What an operator should know of a snapshot, in words. Pure."""

import math

from tripod_runtime.realtime import Snapshot


def known(value: float | None) -> float:
    """Return `value` as messages tell it: -1 where it is not known."""
    return -1.0 if value is None or math.isnan(value) else value


def notices(snapshot: Snapshot) -> str:
    """Return what an operator should know of a snapshot, empty if nothing."""
    report = snapshot.report
    words = (stalls(snapshot), report.instability, snapshot.event, left_out(snapshot))
    return "; ".join(word for word in words if word)


def left_out(snapshot: Snapshot) -> str:
    """Return which rigid bodies the compliance leaves out, empty if it has all."""
    names = ", ".join(f"rigid.{k}" for k in snapshot.left_out)
    return f"the compliance is without {names}: nothing holds these in place" if names else ""


def stalls(snapshot: Snapshot) -> str:
    """Return which servos stand against their load, empty if none does."""
    return "; ".join(str(stall) for stall in snapshot.report.stalled)
