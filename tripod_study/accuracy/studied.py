"""What of a scene a study has seen, so that who picks a setting from it is told when the scene is another by then."""

import hashlib
from collections.abc import Collection
from dataclasses import fields, is_dataclass
from pathlib import Path

from tripod_sim.scene import Scene
from tripod_sim.tables.fields import tables_in

INSIDE = ("servos.angles", "servos.slide", "duration", "name", "description", "motion.servo", "motion.slide")
"""Fields that are free: what is promised is promised for any start and any motion; where a study names the time that
it saw, of a longer run only for that."""

FREE = ("motion", "mesh_error")
"""Tables that are free: the motion, and an estimate that leaves it as it is."""


def studied(scene: Scene, varied: Collection[str]) -> str:
    """Return a digest of what a scene and the files that it names say, 16 hexadecimal digits.

    What is free, what has its default value and the names of files are left out, and so are the fields of `varied`.
    """
    made = hashlib.sha256()
    for path, table in tables_in(scene):
        if path.partition(".")[0] in FREE:
            continue
        made.update(f"[{path}]\n".encode())
        for f in fields(table):
            value, where = getattr(table, f.name), f"{path}.{f.name}" if path else f.name
            nested = value and is_dataclass(value[0] if isinstance(value, tuple) else value)
            if nested or value == f.default or where in INSIDE or where in varied:
                continue
            if f.name == "source" and (file := Path(value)).is_file():
                value = hashlib.sha256(file.read_bytes()).hexdigest()
            made.update(f"{f.name} = {value!r}\n".encode())
    return made.hexdigest()[:16]
