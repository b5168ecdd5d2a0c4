"""Stability over two parameters."""
