"""What the real simulator tells of a shipped scene, told by the one that knows no mechanics."""

from dataclasses import asdict
from functools import cache
from typing import Any

import numpy as np

from tests.view.fake_simulator import FakeSimulator
from tripod_graph.joint import Joint
from tripod_sim import Simulation, load_scene
from tripod_study.summary.accuracy import accuracy_summary, as_table
from tripod_study.summary.effects import effect_summary
from tripod_study.summary.energy import EnergyBooks
from tripod_study.summary.errors import errors_line
from tripod_study.summary.picture import picture
from tripod_study.summary.stability import stability, stability_lines


@cache
def told(scene: str) -> tuple[dict[str, Any], dict[str, Any], np.ndarray, np.ndarray, tuple[Joint, ...]]:
    """Return picture, figures, nodes, triangles and joints that are no servos of a scene at its start."""
    simulation = Simulation(load_scene(scene))
    accuracy = as_table(accuracy_summary(scene, simulation.scene, 0.04))
    effects = [asdict(f) for f in effect_summary(simulation.scene)]
    table = {**picture(simulation), "changes": [], "accuracy": accuracy, "effects": effects}
    books = EnergyBooks(simulation.energies(), *simulation.joint_work())
    figures = asdict(stability(simulation.report, 0, books.balance, simulation.scene.dt))
    figures |= {
        "lines": stability_lines(figures),
        "errors": errors_line(simulation.report),
        "event": "",
        "notice": "",
        "notes": list(simulation.notes),
    }
    others = simulation.joints.others if simulation.joints else ()
    joints = tuple(Joint(a.name, a.unit, a.low, a.high, a.high - a.low) for a in others)
    skin = simulation.skin
    return table, figures, np.array(skin.nodes), np.array(skin.surface, dtype=np.uint32), joints


def show(
    sim: FakeSimulator,
    scene: str,
    *,
    name: str = "",
    event: str = "",
    notice: str = "",
    notes: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Let the page show a scene, by another name if one is given; return what is told of it."""
    table, figures, *body, others = told(scene)
    sim.have_joints(len(table["joints"]) - len(others), others)
    sim.body = tuple(body)
    sim.figures = {**figures, "event": event, "notice": notice, "notes": [*figures["notes"], *notes]}
    sim.publish_mesh()
    sim.wait_for_mesh(60.0)
    sim.publish_picture({**table, "name": name or scene})
    radius = (table["ball"]["radius"],) if table["ball"] else ()
    sim.publish_game(table["maze"] is not None, *radius)
    return table
