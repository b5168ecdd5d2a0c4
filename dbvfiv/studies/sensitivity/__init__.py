"""Sensitivity of the leading mode to every parameter of a valve."""
