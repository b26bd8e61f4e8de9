"""The tables of a scene, each frozen and checked once."""
