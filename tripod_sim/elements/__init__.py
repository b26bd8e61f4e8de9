"""Finite elements: shape functions and quadrature."""
