"""Meshes: generators, readers, checks."""
