"""Forced response of a steady state to the pressure at its inlet."""
