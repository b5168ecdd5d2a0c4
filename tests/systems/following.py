"""Branches of equilibria with all of their eigenvalues, and the Hopf points on them."""

from __future__ import annotations

from continuation import Branch, ContinuationOptions, HopfNormalForm, SpecialPoint, continue_branch, hopf_normal_form


def follow(system, start, mu, parameter: str, limits, **options) -> Branch:
    """Branch between limits of its parameter, with all eigenvalues at its points."""
    options = ContinuationOptions(**{"eigenvalues": system.size, "limits": {parameter: limits}, **options})
    return continue_branch(system, start, mu, parameter, options)


def hopf_of(system, start, mu, parameter: str, limits, **options) -> SpecialPoint:
    """First Hopf point of such a branch."""
    return follow(system, start, mu, parameter, limits, **options).of_kind("hopf")[0]


def normal_form_of(system, point: SpecialPoint, parameter: str | None = None) -> HopfNormalForm:
    """Normal form at a Hopf point."""
    return hopf_normal_form(system, point.u, point.mu, point.values["omega"], point.vectors["right"], parameter)
