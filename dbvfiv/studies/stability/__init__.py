"""Shared parts of stability studies: parameter points, their steady states and spectra, crossings."""
