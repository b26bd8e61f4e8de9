"""Advancing a state: Newton, implicit Euler, quasi-static steps."""
