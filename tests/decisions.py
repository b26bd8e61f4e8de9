"""What the operator of a test says: it is in charge of any mode, and leaves for as long as can be."""

from tripod_graph.mode import LONGEST_LEASE, NONE, Decision

SOURCE = "/ik#test"
"""Inverse kinematics by name, so that its commands are obeyed in mode IK as well as in those that it decided on."""


def said(mode: int, stamp: float) -> Decision:
    """Return a decision made at `stamp` [s]."""
    return Decision(mode, SOURCE, stamp, LONGEST_LEASE)


def keep(decisions: list, message) -> None:
    """Add a tripod_msgs/ControlMode to `decisions`, unless it repeats the last or withdraws one."""
    again = decisions and (message.mode, message.source, message.header.stamp) == (
        decisions[-1].mode,
        decisions[-1].source,
        decisions[-1].header.stamp,
    )
    if message.mode != NONE and not again:
        decisions.append(message)
