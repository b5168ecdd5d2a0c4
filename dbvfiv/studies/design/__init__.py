"""Designs of a valve: variables within bounds, an aim, and constraints."""
