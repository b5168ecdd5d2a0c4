"""Branches of equilibria with all of their eigenvalues, the Hopf points on them, and runs that are interrupted."""

from __future__ import annotations

from continuation import (
    Branch,
    ContinuationOptions,
    HopfNormalForm,
    Observer,
    SpecialPoint,
    continue_branch,
    hopf_normal_form,
)


class Stop(Observer):
    """Interrupt a run at a number of points, or without one at a special point, and keep what was told."""

    def __init__(self, after: int = 0):
        self.after, self.refusals, self.finds, self.end = after, [], [], 0

    def accepted(self, branch):
        if len(branch) == self.after:
            raise KeyboardInterrupt

    def refused(self, branch, reason, step):
        self.refusals.append((reason, step))

    def found(self, branch, special):
        self.finds.append(special.kind)
        if not self.after:
            raise KeyboardInterrupt

    def ended(self, branch):
        self.end += 1


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
