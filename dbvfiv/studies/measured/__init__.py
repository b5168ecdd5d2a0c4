"""Measured data beside what studies compute: kept with a result, held against its states, drawn."""
