"""A script for the robot: what `tripod run` simulates with `--servo`, `--slide` and `--actuate`, `tripod up` plays."""

from collections.abc import Sequence

import numpy as np

from tripod_play.joint_path import JointPath

HELD = 0.1
"""How long a script of a single pose lasts [s]."""


def joint_path(
    scene: str, overrides: Sequence[str], servo: str | None, slide: str | None, actuate: Sequence[str] = ()
) -> JointPath | None:
    """Return the motion that `--servo`, `--slide` and `--actuate` ask for, None where they ask for none.

    Joints that none of them names stay where they are at the start of the scene.

    Raises:
        SceneError: they cannot be read, go beyond the limits of the scene, or it lacks such joints; it is a ValueError.
    """
    if servo is None and slide is None and not actuate:
        return None
    from tripod_sim.errors import SceneError  # noqa: PLC0415 - not needed for the help
    from tripod_sim.scene.file import load_scene  # noqa: PLC0415
    from tripod_sim.scene.script import script_of  # noqa: PLC0415
    from tripod_sim.tables.short_forms import joints_of  # noqa: PLC0415

    found = load_scene(scene, overrides)
    if slide is not None and servo is None:
        raise SceneError("--slide needs --servo: the robot is moved to both")
    script = script_of(found, servo, slide, actuate)
    joints = joints_of(found)
    assert joints
    lines = (script.angles, script.slides, *script.others.values())
    times = np.unique(np.concatenate([line.times for line in lines if line]))
    if len(times) == 1:
        times = np.append(times, times + HELD)
    width = joints.count + (script.slides is not None)
    places = [script.joints(joints.start, t)[:width] for t in times]
    return JointPath(times, np.array(places), len(joints.arms), tuple(a.name for a in joints.others))
