"""Which effects a scene has, which it could have besides, and why not the others.

What they cost is not told here: it differs with mesh, settings and machine. `tripod explain` measures it.
"""

from dataclasses import dataclass

from tripod_sim.effects import EFFECTS, meaning, words
from tripod_sim.errors import SceneError
from tripod_sim.scene import Scene
from tripod_sim.scene.file import scene_from_toml, scene_to_toml
from tripod_study.explain.costs import NEEDS


@dataclass(frozen=True)
class EffectFigure:
    """An effect as a page offers it.

    Attributes:
        name: Of the effect.
        on: Whether the scene has it.
        meaning: What it is, in one sentence.
        why_not: Why it cannot be switched on with its defaults, in one sentence; empty where it can.
    """

    name: str
    on: bool
    meaning: str
    why_not: str = ""


def effect_summary(scene: Scene) -> list[EffectFigure]:
    """Return all effects, those that the scene has first."""
    text, found = scene_to_toml(scene), list[EffectFigure]()
    for name in EFFECTS:
        on = bool(getattr(scene, name))
        found.append(EffectFigure(name, on, meaning(name), "" if on else _why_not(text, name)))
    return sorted(found, key=lambda f: not f.on)


def _why_not(text: str, name: str) -> str:
    """Return why a scene, as text, cannot have an effect with its defaults; empty where its tables agree with it."""
    if name in NEEDS:
        return NEEDS[name]
    try:
        scene_from_toml(text, words(name))
    except SceneError as error:
        return " ".join(str(error).split())
    return ""
