"""Scenes: what a user describes. Read, checked, written, and written out into a model."""

from tripod_sim.scene.file import load_scene, scene_from_toml, scene_names, scene_to_toml
from tripod_sim.scene.scene import Scene, at_rest

__all__ = ["Scene", "at_rest", "load_scene", "scene_from_toml", "scene_names", "scene_to_toml"]
