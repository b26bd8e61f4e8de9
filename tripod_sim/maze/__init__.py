"""Mazes: a text format, a generator, shipped mazes, and the plate with walls that they become."""
