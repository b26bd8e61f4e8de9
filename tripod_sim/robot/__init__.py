"""Prefabs of the robot, built of the parts of mechanics."""
