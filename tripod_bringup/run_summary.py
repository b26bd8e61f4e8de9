"""The result of `tripod run` as people read it: millimetres and degrees, one row a matter. Pure."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

HELD = 5e-5
"""Force or moment below which a set is not held [N, N m]: its last digit shown."""


def result_rows(result: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return name and text of each row of a result of `tripod_sim.run.run`."""
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
    from tripod_sim.figures.stability import stability_lines  # noqa: PLC0415 - not needed for the help

    told = ("energy balance", "penetration", "snap")
    shown = [row for row in stability_lines(figures["stability"]) if row[0] in told]
    effects = ", ".join(figures["effects"]) or "none"
    return [*shown, ("accuracy", figures["accuracy"]), ("effects", effects)]


def _effector_error(error: Mapping[str, Any], steps: Mapping[str, Any]) -> str:
    """Return the largest estimated error of mesh and time steps at the effector."""
    if math.isnan(error["largest"]):
        from tripod_sim.figures.errors import error_words  # noqa: PLC0415 - not needed for the help

        return error_words(math.nan)
    shares = {"mesh": error["largest"], "step": steps.get("effector", math.nan)}
    words = ", ".join(f"{name} {1e3 * value:.2g}" for name, value in shares.items() if not math.isnan(value))
    return f"effector at most {1e3 * error['largest_with_steps']:.2g} mm ({words}; estimated)"


def _time_error(error: Mapping[str, Any]) -> str:
    """Return the largest estimated error of the time steps."""
    if error["node"] < 0:
        most = error["added"] * 1e3
        return f"a part of a step added at most {most:.3g} mm; that of the whole motion is not estimated"
    places = {"effector": "effector", "largest": f"node {error['node']}", "ball": "ball"}
    words = [
        f"{place} at most {error[name] * 1e3:.2g} mm"
        for name, place in places.items()
        if not math.isnan(error.get(name, math.nan))
    ]
    return "; ".join(words) + " (estimated)"


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
