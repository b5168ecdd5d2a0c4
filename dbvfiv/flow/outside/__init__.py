"""Potential flow on the outer face of the wall; knows panels only."""
