"""Figures of results, drawn without a display; one module for each family of figures."""

from .catalogue import figures_of, save_figures

__all__ = ["figures_of", "save_figures"]
