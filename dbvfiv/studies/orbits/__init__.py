"""Limit cycles of a valve: where a branch starts, how it is followed, what is read off a cycle."""
