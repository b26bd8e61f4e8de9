"""Timers whose period changes while they run."""

from rclpy.timer import Timer


def set_period(timer: Timer, period: float) -> None:
    """Let a timer go on with another period [s], at once; one that is cancelled stays so."""
    timer.timer_period_ns = round(1e9 * period)
    if not timer.is_canceled():
        timer.reset()  # else the one that was under way would be waited for
