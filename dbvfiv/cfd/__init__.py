"""Viscous flow in three dimensions through a computed shape: mesh, OpenFOAM case, run, and what it says beside ours."""
