"""Probability of flutter, and what decides it: uncertain inputs, sampling, verdicts on the samples."""
