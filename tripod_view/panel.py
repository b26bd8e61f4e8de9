"""What the panel of the page shows, as values by name; degrees and millimetres on the screen."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tripod_graph.command import CommandLimits
from tripod_graph.joint import SHOWN, Joint
from tripod_host.arrays import FloatArray
from tripod_view.channel import Channel
from tripod_view.picture import Picture
from tripod_view.player.colour_maps import MAPS
from tripod_view.recorder import Recorder
from tripod_view.robot import SERVO_COLOURS
from tripod_view.words import Line

DEGREES = 180.0 / math.pi


class Panel:
    """Shows what it is told; every method is called from the thread of ROS only."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._scales, self._answers, self._digits = np.zeros(0), np.zeros(0), 1
        channel.show("maps", MAPS)
        channel.show("colours", [f"rgb{colour}" for colour in SERVO_COLOURS])

    def show_scene(self, picture: Picture, *, has_joints: bool, has_target: bool, known: bool) -> None:
        """Show what there is: which controls the page has follows from it. `known`: whether a simulator has told it."""
        servos = picture.servos
        scene = {
            "known": known,
            "name": picture.name,
            "description": picture.description,
            "joints": has_joints,
            "target": has_target,
            "ball": picture.ball,
            "maze": picture.maze is not None,
            "stall_torque": servos.stall_torque if servos else None,
            "ideal": servos.ideal if servos else None,
            "slide_max": 1e3 * servos.slide_max if servos else 0.0,
            "note": picture.note,
            "changes": list(picture.changes),
        }
        self._channel.show("scene", scene)
        self._channel.show("accuracy", picture.accuracy)
        fields = [
            {"name": f.name, "label": f.label, "unit": f.unit, "signed": f.signed} for f in picture.fields
        ]
        self._channel.show("fields", fields)
        self._channel.show("effects", list(picture.effects))

    def show_range(self, limits: CommandLimits) -> None:
        """Show how far the joints may go, and what they are called in which units."""
        joints = limits.table[:-1]
        self._scales = np.array([_scale(joint) for joint in joints])
        self._answers = np.array([joint.answer[0] for joint in joints])
        self._digits = 3 if limits.others else 1
        low, high = self._scales * limits.lower[:-1], self._scales * limits.upper[:-1]
        self._channel.show("range", [[round(a, 2), round(b, 2)] for a, b in zip(low, high, strict=True)])
        self._channel.show("kinds", [_kind(i, joint) for i, joint in enumerate(joints)])

    def show_joints(
        self,
        asked: FloatArray,
        measured: FloatArray | None,
        slide: float | None,
        torques: FloatArray | None,
        *,
        enabled: bool,
    ) -> None:
        """Show what the sliders ask for, shape (n,) [rad, m, N, Pa], what is measured, (n + 1,), and torques [N m] or
        what else the joints give in return, (n,).

        None is what is not known; `slide` [m] is asked for, None: as measured. `enabled`: whether sliders command.
        """
        place = slide if slide is not None else None if measured is None else float(measured[-1])
        self._channel.show(
            "joints",
            {
                "enabled": enabled,
                "asked": _rounded(self._shown(asked), self._digits),
                "angles": None if measured is None else _rounded(self._shown(measured[:-1]), 2),
                "slide": None if place is None else round(1e3 * place, 2),
                "torques": None if torques is None else _rounded(self._returned(torques), 4),
            },
        )

    def _shown(self, values: FloatArray) -> FloatArray:
        return values * self._scales if len(values) == len(self._scales) else np.degrees(values)

    def _returned(self, values: FloatArray) -> FloatArray:
        return values * self._answers if len(values) == len(self._answers) else values

    def show_mode(self, line: Line, mode: str, *, own: bool) -> None:
        """Show who commands the robot, in which mode."""
        self._channel.show("mode", {**as_table(line), "mode": mode, "own": own})

    def show_lines(self, name: str, lines: Sequence[Line]) -> None:
        """Show lines: `notice`, what was refused or is under way; `target`; `status`, of the other nodes."""
        self._channel.show(name, [as_table(line) for line in lines])

    def show_run(self, run: Mapping[str, Any] | None) -> None:
        """Show how the simulation runs; None while it is not heard."""
        self._channel.show("run", None if run is None else dict(run))

    def show_figures(self, figures: Mapping[str, Any] | None) -> None:
        """Show the figures of its stability, as the simulator tells them; None while it does not."""
        self._channel.show("figures", None if figures is None else dict(figures))

    def show_replay(self, length: float, age: float | None, *, running: bool) -> None:
        """Show how long the past is that is kept [s], and how old what is shown is [s]; None: the present."""
        shown = None if age is None else round(age, 1)
        self._channel.show("replay", {"length": round(length, 1), "age": shown, "running": running})

    def show_recording(self, recorder: Recorder) -> None:
        """Show whether a recorder is there, whether it records, and what it said last."""
        shown = {"possible": recorder.there, "on": recorder.records, "text": recorder.text}
        self._channel.show("recording", shown)

    def flush(self) -> None:
        """Send what changed."""
        self._channel.flush()


def _scale(joint: Joint) -> float:
    """Return the factor from a command to what its slider shows."""
    return DEGREES if joint.unit == "rad" else SHOWN.get(joint.unit, (1.0, ""))[0]


def _kind(number: int, joint: Joint) -> dict[str, Any]:
    """Return how the slider of a joint is labelled: name, unit, step and digits, and the unit of what it gives back."""
    if joint.unit == "rad":
        return {
            "name": f"servo {number}",
            "unit": "°",
            "step": 0.5,
            "digits": 1,
            "back": "N m",
            "servo": True,
        }
    span = _scale(joint) * joint.span
    power = math.floor(math.log10(span / 50)) if span > 0 else -1
    return {
        "name": joint.name,
        "unit": SHOWN.get(joint.unit, (1.0, joint.unit))[1],
        "step": 10.0**power,
        "digits": max(0, -power),
        "back": joint.answer[1],
        "servo": False,
    }


def as_table(line: Line) -> dict[str, str]:
    """Return a line as the page has it."""
    return {"light": line.light.value, "who": line.who, "text": line.text}


def _rounded(values: FloatArray, digits: int) -> list[float]:
    return [round(float(v), digits) + 0.0 for v in values]
