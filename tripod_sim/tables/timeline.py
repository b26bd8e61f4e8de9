"""Joint values over time, written on one line: `0:0,0,0; 1:-0.7854,-45deg,-45deg`."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tripod_host.arrays import FloatArray
from tripod_sim.errors import SceneError, shown
from tripod_sim.tables.fields import OTHER_UNITS, other_unit, units_of, with_unit

if TYPE_CHECKING:
    from tripod_sim.tables.joints import Joints


MOST_KEYS = 100_000


@dataclass(frozen=True, eq=False)
class Timeline:
    """Values at times, interpolated linearly, held before the first and after the last.

    Attributes:
        times: Rising [s], shape (k,).
        values: Shape (k, width).
    """

    times: FloatArray
    values: FloatArray

    def at(self, time: float) -> FloatArray:
        """Return the values at `time` [s], shape (width,)."""
        i = int(np.searchsorted(self.times, time, side="right"))
        if i in (0, len(self.times)):
            return self.values[min(i, len(self.times) - 1)].copy()
        t0, t1 = self.times[i - 1], self.times[i]
        w = (time - t0) / (t1 - t0)
        return np.asarray((1 - w) * self.values[i - 1] + w * self.values[i])


def parse_timeline(text: str, width: int, what: str, unit: str) -> Timeline:
    """Return the timeline that `text` writes, `time: value, value; ...`.

    Args:
        text: As above.
        width: Number of values at each time.
        what: Name of the option, for messages.
        unit: Of the values, rad or m; the text may say another (`-85deg`, `35mm`).

    Raises:
        SceneError: not of that form, not finite, or times that do not rise.
    """
    times, values = [], []
    parts = [p for p in text.split(";") if p.strip()]
    if not 0 < len(parts) <= MOST_KEYS:
        raise SceneError(
            f"{what} has {len(parts)} entries of the form 'time: value, ...'; allowed: 1 to {MOST_KEYS}"
        )
    for part in parts:
        time, colon, rest = part.partition(":")
        try:
            numbers = [with_unit(v, unit) for v in rest.split(",")]
            times.append(float(time))
        except ValueError:
            numbers = []
        if (
            not colon
            or len(numbers) != width
            or not np.isfinite([times[-1] if times else np.nan, *numbers]).all()
        ):
            raise SceneError(
                f"{what}: {shown(part.strip())} is not of the form 'time: value, ...' with {width} finite "
                f"{'value' if width == 1 else 'values'}{_time_missing(part, width, unit)}{_no_number(rest, unit)}"
            )
        values.append(numbers)
    t = np.array(times)
    if t[0] < 0 or (np.diff(t) <= 0).any():
        raise SceneError(
            f"{what}: times {', '.join(f'{x:g}' for x in t[:8])} s must increase, from 0 s or later"
        )
    return Timeline(t, np.array(values))


def _no_number(values: str, unit: str) -> str:
    """Return which of the values of an entry is no number, and what it could be; empty if all are."""
    for value in values.split(",") if values.strip() else []:
        try:
            with_unit(value, unit)
        except ValueError:
            return f"; {shown(value.strip())} is no number in {unit}, nor with its unit ({', '.join(units_of(unit))})"
    return ""


def joint_timelines(
    joints: "Joints", servo: str | None, slide: str | None, names: tuple[str, str] = ("--servo", "--slide")
) -> tuple[Timeline | None, Timeline | None]:
    """Return angles [rad] and slide [m] over time, None for what is not given.

    Args:
        joints: Whose limits they must keep.
        servo, slide: As `parse_timeline` and `parse_slide` read them.
        names: Of the two, for messages.

    Raises:
        SceneError: they cannot be read, or go beyond the limits.
    """
    s = len(joints.arms)
    angles = parse_timeline(servo, s, names[0], "rad") if servo is not None else None
    slides = parse_slide(slide, angles, names[1]) if slide is not None else None
    if angles and not ((angles.values >= joints.low[:s]) & (angles.values <= joints.high[:s])).all():
        beyond = np.maximum(joints.low[:s] - angles.values, angles.values - joints.high[:s]).max(axis=0)
        i = int(np.argmax(beyond))
        low, high, of = joints.low[i], joints.high[i], angles.values[:, i]
        raise SceneError(
            f"{names[0]}: angles of servo_{i} reach {of.min():g} to {of.max():g} rad; allowed: {low:g} to {high:g} "
            "rad" + _hint(servo, of, "rad", lambda a: low <= a <= high)
        )
    most = joints.slide_max
    if slides and not ((slides.values >= 0) & (slides.values <= most)).all():
        raise SceneError(
            f"{names[1]}: reaches {slides.values.min():g} to {slides.values.max():g} m; allowed: 0 to "
            f"{most:g} m" + _hint(slide, slides.values.ravel(), "m", lambda x: 0 <= x <= most)
        )
    return angles, slides


def actuator_timelines(joints: "Joints", words: Sequence[str], what: str) -> dict[int, Timeline]:
    """Return the values of actuators over time, by their numbers; of those that are not named nothing.

    Args:
        joints: Whose limits they must keep.
        words: Each `name=time: value; ...`.
        what: Name of the option, for messages.

    Raises:
        SceneError: there is no such actuator or one is named twice, a line cannot be read, or goes beyond a range.
    """
    known, found = {a.name: k for k, a in enumerate(joints.actuators)}, dict[int, Timeline]()
    for word in words:
        name, equals, text = (part.strip() for part in word.partition("="))
        if not equals or name not in known:
            raise SceneError(
                f"{what} {shown(word)}: it must be NAME=TIME:VALUE;..., with NAME one of: {', '.join(known)}"
            )
        k = known[name]
        if k in found:
            raise SceneError(f"{what}: {name} is given twice; give it once")
        a, said = joints.actuators[k], f"{what} {name}"
        line = found[k] = parse_timeline(text, 1, said, a.unit)
        if not ((line.values >= a.low) & (line.values <= a.high)).all():
            least, most = float(line.values.min()), float(line.values.max())
            raise SceneError(
                f"{said}: {a.quantity} reaches {least:g} to {most:g} {a.unit}; allowed: {a.low:g} to {a.high:g} "
                f"{a.unit}"
            )
    return found


def _hint(text: str | None, values: FloatArray, unit: str, fits: Callable[[float], bool]) -> str:
    """Return how to write the value that is furthest from zero, shape (k,), if it was meant in another unit."""
    sign = OTHER_UNITS[unit][1]
    if sign in (text or ""):
        return ""
    return other_unit(float(values[np.abs(values).argmax()]), unit, fits)


def parse_slide(text: str, servo: Timeline | None, what: str = "--slide") -> Timeline:
    """Return the slide over time: a timeline, or one number [m].

    One number is reached in proportion with the servo timeline, from 0 at its first to the number at its last time: to
    slide the servo bodies first would crush the flat piece. Without a servo timeline it holds from the start.

    Raises:
        SceneError: neither a number nor a timeline.
    """
    if ":" in text:
        return parse_timeline(text, 1, what, "m")
    try:
        value = with_unit(text, "m")
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        units = " or ".join(units_of("m"))
        raise SceneError(
            f"{what} {shown(text)} is neither a number in {units} nor of the form 'time: value; ...'"
        )
    if servo is not None and len(servo.times) > 1:
        ends = servo.times[[0, -1]]
        return Timeline(ends, np.array([[0.0], [value]]))
    return Timeline(np.zeros(1), np.array([[value]]))


def _time_missing(part: str, width: int, unit: str) -> str:
    """Return a hint for values without a time: one for all, or one each; empty for anything else."""
    words = [word.strip() for word in part.split(",")]
    if len(words) not in (1, width):
        return ""
    try:
        values = [with_unit(word, unit) for word in words]
    except ValueError:
        return ""
    if not np.isfinite(values).all():
        return ""
    _, sign, _, least = OTHER_UNITS.get(unit, (unit, unit, 1.0, np.inf))
    meant = [
        f"{word}{sign}" if abs(v) > least and word[-1].isdigit() else word
        for word, v in zip(words, values, strict=True)
    ]
    return f"; to hold from the start, write '0: {', '.join(meant * (width // len(words)))}'"
