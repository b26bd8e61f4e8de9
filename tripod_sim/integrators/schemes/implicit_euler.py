"""Implicit Euler: s = h. First order; takes w² h² / 2 of the amplitude of a mode of angular frequency w a step."""

from tripod_sim.integrators.scheme import ImplicitScheme

SCHEME = ImplicitScheme("implicit_euler", 1)
