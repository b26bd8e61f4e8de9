"""Elastic laws: energy, stress, tangent."""
