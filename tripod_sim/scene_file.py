"""The former place of `tripod_sim.scene`, for programs that import from here."""

from tripod_sim.scene import load_scene, scene_from_toml, scene_names, scene_to_toml

__all__ = ["load_scene", "scene_from_toml", "scene_names", "scene_to_toml"]
