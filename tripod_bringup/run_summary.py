"""The result of `tripod run` as people read it: millimetres and degrees, one row a matter. Pure."""

import json
import math
import shlex
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

REST = 1e-6
"""Kinetic energy below this share of the other energies is that of a body at rest."""

BEYOND = "time_error.accuracy"
"""A note that begins so says that the error of the steps is no longer known."""

SMALL = 1e-3
"""Displacement that is not told from none [mm]."""

Row = tuple[str, str]


def summary_rows(result: Mapping[str, Any], again: Sequence[str], *, view: bool = False) -> list[Row]:
    """Return name and text of the rows that end a run, at most six: result, time, error, cost, files, next step.

    Args:
        result: Of `tripod_study.run.run`.
        again: The words of the command that makes the same run without pictures and files.
        view: Whether it is shown on a page already.
    """
    median, dt = result["step_ms"]["median"], result["dt"] * 1e3
    time = f"{result['time']:.4g} s in {result['steps']} steps of {dt:.4g} ms"
    second = f"{_digits(median / dt)} s" if dt > 0 else "unknown time"
    cost = f"{_digits(median)} ms a step (median): one simulated second takes {second} of computing"
    files = ", ".join(f"{f['file']} ({_digits(f['bytes'] / 1e6)} MB)" for f in result.get("written", ()))
    return [
        ("result", _outcome(result)),
        ("time", time),
        ("error", _error(result, own_motion=bool({"--servo", "--slide", "--actuate"} & set(again)))),
        ("cost", cost),
        *([("files", files)] if files else []),
        ("next", _next(result, again, view=view)),
    ]


def _outcome(result: Mapping[str, Any]) -> str:
    """Return where things are at the end, and whether they rest."""
    parts = []
    if effector := result["effector"]:
        turned = _turned(effector["quaternion"])
        words = f", turned by {turned:.1f} degrees" if turned >= 0.05 else ""
        parts.append(f"effector at {_scaled(effector['position'], 1e3)} mm{words}")
    if len(result["torques"]):
        parts.append(f"servo torques {_scaled(result['torques'], 1)} N m")
    for a in result.get("actuators", ()):
        parts.append(
            f"{a['name']} {a['position']:.4g} {a['position_unit']}, {a['effort']:.4g} {a['effort_unit']}"
        )
    if ball := result.get("ball"):
        parts.append(
            f"ball at {_scaled(ball['position'], 1e3)} mm{', ' if ball['event'] else ''}{ball['event']}"
        )
    parts += [f"set {m['set']} moved by {_scaled(m['moved'], 1e3)} mm" for m in result.get("markers", ())[:2]]
    if not parts:
        moved = 1e3 * result["displacement"]["largest"]
        size = f"{moved:.3g} mm" if moved < 1e3 else f"{1e-3 * moved:.3g} m"
        parts.append(f"at the end largest displacement {size if moved >= SMALL else f'below {SMALL:g} mm'}")
    energies = result["energies"]
    others = max((abs(value) for name, value in energies.items() if name != "kinetic"), default=0.0)
    return "; ".join([*parts, "at rest" if energies.get("kinetic", 0.0) <= REST * others else "still moving"])


def _error(result: Mapping[str, Any], *, own_motion: bool) -> str:
    """Return what is known of the error: as the accuracy study measured it, as this run estimated it, or why not.

    `own_motion`: whether the servos move otherwise than in the study.
    """
    figures, steps, words = result.get("figures") or {}, result.get("time_error") or {}, []
    measured = figures.get("error", {}).get("measured")
    if measured is not None:
        file = result.get("study") or "the accuracy study of this scene"
        yours = "; your motion is another one" if own_motion else ""
        quantity = str(figures.get("quantity") or "").replace("; ", ", and ")
        of = f", of: {quantity}" if quantity else ""
        size = f" of {1e3 * figures['size']:.3g} mm" if figures.get("size") else ""
        words.append(f"about {_digits(100 * measured)} %{size} (measured in {file}{of}{yours})")
    if error := result.get("mesh_error"):
        words.append(_effector_error(error, steps))
    elif steps:
        words.append(
            "of the time steps in this run, until its end: " + _time_error(steps) + _too_large(steps, result)
        )
    if words:
        return "; ".join(words)
    if figures.get("quantity"):
        return "not known: the accuracy study of this scene had other settings"
    return "not known: no accuracy study has measured this scene"


def _is_known(result: Mapping[str, Any]) -> bool:
    """Return whether anything is known of the error."""
    measured = (result.get("figures") or {}).get("error", {}).get("measured")
    return measured is not None or any(result.get(name) for name in ("mesh_error", "time_error"))


def _next(result: Mapping[str, Any], again: Sequence[str], *, view: bool) -> str:
    """Return the commands to try next."""
    figures, command = result.get("figures") or {}, shlex.join(again)
    if result.get("instability"):
        first = f"smaller steps: {command} --set dt={0.5 * result['dt']:.3g}"
    elif not _is_known(result):
        first = f"measure the error: {shlex.join(['tripod', 'study', *_studied(again[2:])])} --quick"
    elif figures.get("finer") and not result.get("accuracy"):
        own = f" --study {shlex.quote(result['study'])}" if result.get("study") else ""
        first = f"a smaller error: {command} --accuracy {figures['finer']}{own}"
    else:
        sets = [word for pair in pairwise(again[3:]) if pair[0] == "--set" for word in pair]
        first = f"what a step costs: {shlex.join(['tripod', 'explain', again[2], *sets])}"
    return "; ".join([first, *([] if view else ["see it move: add --view"]), "all values: add --verbose"])


def _studied(words: Sequence[str]) -> list[str]:
    """Return the words of a run as a study takes them: with `--actuate` as the motion of the scene."""
    found, actuate, rest = list[str](), list[str](), iter(words)
    for word in rest:
        if word == "--actuate":
            actuate.append(next(rest))
        else:
            found.append(word)
    return [*found, "--set", f"motion={{actuate={json.dumps(actuate)}}}"] if actuate else found


def _digits(value: float) -> str:
    """Return a number rounded to two digits, without an exponent where it is not tiny."""
    return f"{float(f'{value:.2g}'):.6g}"


def _scaled(values: Sequence[float], scale: float) -> str:
    """Return numbers with as many decimals as give the largest three digits."""
    numbers = [value * scale for value in values]
    largest = max(map(abs, numbers), default=0.0)
    decimals = 0 if largest == 0 else max(0, 2 - math.floor(math.log10(largest)))
    return ", ".join(f"{_no_negative_zero(round(number, decimals)):.{decimals}f}" for number in numbers)


HELD = 5e-5
"""Force or moment below which a set is not held [N, N m]: its last digit shown."""


def result_rows(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return name and text of each row of a result of `tripod_study.run.run`."""
    rows = [
        ("scene", str(result["scene"])),
        ("time", f"{result['time']:.6g} s, {result['steps']} steps of {result['dt'] * 1e3:.6g} ms"),
    ]
    if effector := result["effector"]:
        rows.append(("effector", f"{_numbers(effector['position'], 1e3, 3)} mm"))
        rows.append(("effector turned", f"{_turned(effector['quaternion']):.2f} degrees"))
    if ball := result.get("ball"):
        event = f"; {ball['event']}" if ball["event"] else ""
        rows.append(("ball", f"{_numbers(ball['position'], 1e3, 3)} mm{event}"))
    rows += _marker_rows(result)
    rows += _contact_rows(result)
    if len(result["angles"]):
        rows.append(("angles", f"{_numbers(result['angles'], math.degrees(1), 2)} degrees"))
        rows.append(("slide", f"{result['slide'] * 1e3:.2f} mm"))
        rows.append(("torques", f"{_numbers(result['torques'], 1, 4)} N m"))
    energies = ", ".join(f"{name} {_millijoules(value)}" for name, value in result["energies"].items())
    rows.append(("energies", f"{energies} mJ"))
    if result.get("dt_limit") is not None:
        rows.append(("stable up to", f"{result['dt_limit'] * 1e3:.4g} ms, {result['parts']} parts of steps"))
    else:
        rows.append(("residual", f"{result['residual']:.2g} N"))
    if error := result.get("time_error"):
        rows.append(("time error", _time_error(error)))
    if error := result.get("mesh_error"):
        rows.append(("error", _effector_error(error, result.get("time_error") or {})))
    work = f"{result['newton_iterations']} Newton iterations"
    if result.get("time_error") and (result["rejected"] or result["parts"] > result["steps"]):
        work += f", {result['parts']} parts of steps, {result['rejected']} taken back"
    if result.get("increments"):
        work += f", load in {result['increments']} increments"
    if result["halvings"]:
        work += f", {result['halvings']} steps halved"
    if result["newton_iterations"] or result.get("dt_limit") is None:
        rows.append(("solved by", work))
    for file in result.get("written", ()):
        rows.append(("written", f"{file['file']}, {file['bytes'] / 1e6:.2f} MB"))
    rows += _figure_rows(result.get("figures"))
    times = result["step_ms"]
    factor = result["dt"] * 1e3 / times["median"] if times["median"] > 0 else math.inf
    rows.append(
        (
            "step took",
            f"{times['median']:.3f} ms median, {times['p99']:.3f} ms p99; {factor:.3g} times real time",
        )
    )
    return rows


def _marker_rows(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return how far markers have moved, and what holds those that are held."""
    rows = []
    for marker in result.get("markers", ()):
        rows.append((f"set {marker['set']}", f"moved by {_numbers(marker['moved'], 1e3, 4)} mm"))
        if max(map(abs, (*marker.get("force", ()), *marker.get("moment", ()))), default=0.0) > HELD:
            held = f"{_numbers(marker['force'], 1, 4)} N, {_numbers(marker['moment'], 1, 4)} N m about the origin"
            rows.append((f"set {marker['set']} held by", held))
    return rows


def _figure_rows(figures: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    """Return the rows of what the page shows, too: energy, penetration, accuracy, effects; none without figures."""
    if not figures:
        return []
    from tripod_study.summary.stability import stability_lines  # noqa: PLC0415 - not needed for the help

    told = ("energy balance", "penetration", "snap")
    shown = [row for row in stability_lines(figures["stability"]) if row[0] in told]
    effects = ", ".join(figures["effects"]) or "none"
    return [*shown, ("accuracy", figures["accuracy"]), ("effects", effects)]


def _effector_error(error: Mapping[str, Any], steps: Mapping[str, Any]) -> str:
    """Return the largest estimated error of mesh and time steps at the effector."""
    if math.isnan(error["largest"]):
        from tripod_study.summary.errors import error_words  # noqa: PLC0415 - not needed for the help

        return error_words(math.nan)
    shares = {"mesh": error["largest"], "step": steps.get("effector", math.nan)}
    words = ", ".join(f"{name} {1e3 * value:.2g}" for name, value in shares.items() if not math.isnan(value))
    return f"effector about {1e3 * error['largest_with_steps']:.2g} mm ({words}; estimated)"


def _time_error(error: Mapping[str, Any]) -> str:
    """Return the largest estimated error of the time steps."""
    if error["node"] < 0:
        most = error["added"] * 1e3
        return (
            f"each step adds about {_digits(most)} mm (estimated); that of the whole motion is not estimated"
        )
    places = {"effector": "effector", "largest": f"node {error['node']}", "ball": "ball"}
    words = [
        f"{place} about {error[name] * 1e3:.2g} mm"
        for name, place in places.items()
        if not math.isnan(error.get(name, math.nan))
    ]
    return "; ".join(words) + " (estimated)"


def _too_large(error: Mapping[str, Any], result: Mapping[str, Any]) -> str:
    """Return what is wrong with an estimated error, such as that it is larger than the motion; empty: nothing."""
    least = max(result["displacement"]["largest"], 1e-3 * SMALL)
    if any(str(note).startswith(BEYOND) for note in result.get("notes", ())):
        return ", which may be far too small here: see the note"
    if error["node"] < 0 or not error["largest"] > least:
        return ""
    return ", which is more than the whole motion: dt is too large, or the estimate fails here; compare with half of dt"


def _millijoules(value: float) -> str:
    return f"{value * 1e3:.3f}" if abs(value) < 1e6 else f"{value * 1e3:.3g}"


def _contact_rows(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the rows of rigid bodies and contacts; none in a scene without contact."""
    rows = []
    for k, body in enumerate(result.get("rigid", ())):
        where, turned = _numbers(body["position"], 1e3, 3), _turned(body["quaternion"])
        rows.append((f"rigid.{k}", f"{where} mm, turned {turned:.2f} degrees"))
    if contact := result.get("contact"):
        pressed = f"{contact['pressed']} of {contact['contacts']} pressed"
        rows.append(("contacts", f"{pressed}, normal forces {contact['force']:.4g} N in sum"))
        if contact["smallest_gap"] is not None:
            gap = f"smallest {contact['smallest_gap'] * 1e3:.2g} mm beyond the contact distance"
            rows.append(
                ("gaps", f"{gap}; error {contact['residual'] * 1e3:.2g} mm after {contact['rounds']} rounds")
            )
    return rows


def _turned(quaternion: Sequence[float]) -> float:
    """Return by how much a quaternion turns [degrees]."""
    from tripod_host.rotations import quaternion_angle  # noqa: PLC0415 - not needed for the help

    return math.degrees(quaternion_angle(quaternion))


def _numbers(values: Sequence[float], scale: float, digits: int) -> str:
    return ", ".join(f"{_no_negative_zero(round(value * scale, digits)):.{digits}f}" for value in values)


def _no_negative_zero(value: float) -> float:
    return value + 0.0
