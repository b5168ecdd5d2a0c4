"""Equilibria over a list of pressures."""
