"""Identification of a valve from measured records."""
