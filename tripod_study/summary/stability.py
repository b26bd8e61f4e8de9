"""How stable a run is: what its steps leave unsolved, where its energy goes, how long its steps may be, how deep
bodies sink into each other."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from tripod_sim.integrators.report import StepReport
from tripod_sim.stability_margin import LOW_MARGIN, NEAR, REDUCED_MARGIN
from tripod_study.summary.energy import SWAY, TINY, Balance


@dataclass(frozen=True)
class Stability:
    """What a run tells of its stability.

    Attributes:
        residual: Unbalanced force at the end of the last step [N]; None for explicit steps, which balance nothing.
        halvings: Times that a step was taken back and halved, since the start.
        energy: See `Balance`.
        dt: Of the scene [s].
        dt_limit: Longest stable step of an explicit scheme [s]; None for the others: they have none.
        contacts, pressed: Pairs near each other, and those that carry a force; None without contact.
        smallest_gap: Beyond the contact distance [m]; None without contacts.
        penetration: How deep bodies sink in at most, beyond the contact distance [m]; None without contact.
        contact_error: Largest error of gap, complementarity or slip [m]; None without contact.
        stability_margin: Least stability margin that was seen (see `stability_margin`), and when [s]; None where it is
            not known.
        at_rest: Whether every step is an equilibrium.
        estimated: Whether the error of the mesh is told.
        unstable: What an unstable scheme does, in words; empty where it is stable.
    """

    residual: float | None
    halvings: int
    energy: dict[str, Any]
    dt: float
    dt_limit: float | None
    contacts: int | None = None
    pressed: int | None = None
    smallest_gap: float | None = None
    penetration: float | None = None
    contact_error: float | None = None
    stability_margin: list[float] | None = None
    at_rest: bool = False
    estimated: bool = False
    unstable: str = ""


def stability(
    report: StepReport,
    halvings: int,
    balance: Balance,
    dt: float,
    stability_margin: list[float] | None = None,
    *,
    at_rest: bool = False,
) -> Stability:
    """Return how stable a run is after a step.

    Args:
        report: Of that step.
        halvings: Since the start.
        balance: Of its energy.
        dt: Of the scene [s].
        stability_margin: Least that was seen, and when [s].
        at_rest: Whether every step is an equilibrium.
    """
    explicit = math.isfinite(report.dt_limit)
    found: dict[str, Any] = {}
    if contact := report.contact:
        gap = contact.smallest_gap if contact.contacts else None
        found = {
            "contacts": contact.contacts,
            "pressed": contact.pressed,
            "smallest_gap": gap,
            "penetration": 0.0 if gap is None else max(0.0, -gap),
            "contact_error": contact.residual,
        }
    return Stability(
        residual=None if explicit else report.residual,
        halvings=halvings,
        energy=asdict(balance),
        dt=dt,
        dt_limit=report.dt_limit if explicit else None,
        stability_margin=stability_margin,
        at_rest=at_rest,
        estimated=report.mesh_error is not None,
        unstable=report.instability,
        **found,
    )


def stability_lines(figures: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return `Stability` as names and texts for people; `figures` has its fields."""
    energy, rows = figures["energy"], []
    if figures["residual"] is not None:
        rows.append(("residual", f"{figures['residual']:.2g} N"))
    rows.append(("halvings", f"{figures['halvings']} steps taken back and halved"))
    if not figures["at_rest"]:  # what is in balance at each instant keeps no books
        rows.append(("energy balance", _balance(energy)))
    if figures["dt_limit"] is None:
        rows.append(("limit of dt", "none: implicit steps"))
    else:
        rows.append(
            ("limit of dt", f"{1e3 * figures['dt_limit']:.3g} ms; dt is {1e3 * figures['dt']:.3g} ms")
        )
    if figures["contacts"] is not None:
        rows.append(("contacts", f"{figures['contacts']}, {figures['pressed']} of them pressed"))
        rows.append(("penetration", f"{1e3 * figures['penetration']:.2g} mm beyond the contact distance"))
    if stability_margin := figures["stability_margin"]:
        words = snap_words(*stability_margin, at_rest=figures["at_rest"], estimated=figures["estimated"])
        rows += [("snap", words)] if words else []
    if figures["unstable"]:
        rows.append(("unstable", figures["unstable"]))
    return rows


def snap_words(
    stability_margin: float, time: float, *, at_rest: bool = False, estimated: bool = False
) -> str:
    """Return what is to say of a body's stability margin at a time [s], in motion or `at_rest`; empty where it is firm.

    `estimated`: whether the error of the mesh is told.
    """
    softest = f"the lowest stiffness is {stability_margin:.2f} of that of the undeformed body at {time:.4g} s"
    if stability_margin < NEAR:
        return f"near: {softest}; another equilibrium may be close"
    if at_rest and stability_margin < LOW_MARGIN:
        return f"{softest}; in so soft a pose the error is more often larger than stated, or another equilibrium exists"
    if estimated and not at_rest and stability_margin < REDUCED_MARGIN:
        return f"{softest}; so soft a body snaps differently on each mesh, and swings with a larger error than stated"
    return ""


def _balance(energy: Mapping[str, Any]) -> str:
    since = (
        f" since the slide or what is prescribed moved, at {energy['since']:.3g} s" if energy["since"] else ""
    )
    if energy["grew"]:
        return f"{joules(-energy['lost'])} more than was put in{since}: look at dt and the scheme"
    if max(TINY, SWAY * energy["moved"]) < -energy["lost"] <= energy["unsure"]:
        known = joules(energy["unsure"])
        return f"actuators put in {joules(energy['work'])}, as their efforts jump known to {known}{since}"
    if energy["lost"] < -TINY:
        return f"sways by {-energy['lost'] / energy['moved']:.2g} of what moves{since}, as stable schemes do"
    put_in = f"actuators put in {joules(energy['work'])}, " if energy["work"] else ""
    return f"{put_in}{joules(energy['lost'])} lost to damping, friction and the time steps{since}"


def joules(value: float) -> str:
    """Return an energy [J] for people."""
    if abs(value) < TINY:
        return "0 mJ"
    return f"{1e3 * value:.3g} mJ" if abs(value) < 1 else f"{value:.3g} J"
