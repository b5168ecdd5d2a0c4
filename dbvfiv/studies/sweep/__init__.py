"""Modes tracked along one parameter."""
