"""Branches of limit cycles along one parameter: amplitude, frequency, stability."""
