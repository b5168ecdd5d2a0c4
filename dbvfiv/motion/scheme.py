"""One-step schemes of the generalised-alpha family: Chung & Hulbert (1993), Hilber, Hughes & Taylor (1977), Newmark
(1959).

Second-order unknowns (the wall) follow Newmark's formulas. First-order ones (inlet velocity, internal force) follow
Jansen, Whiting & Hulbert (2000): y_{n+1} = y_n + h ((1 - g) y'_n + g y'_{n+1}), the rate taken at t_n + am h with am =
g - 1/2 + 1 - af, which puts it at the instant 1 - af of everything else to second order for any g. Here g = 1: rates
are plain differences y_{n+1} - y_n over h, extrapolated to that instant. Their usual choice ties g to the spectral
radius; without numerical damping its rates then alternate in sign for ever, and stiff modes with stiffness damping grow
linearly.

Equations are met at t_{n+1-af}, accelerations are taken at t_{n+1-am}.
"""

from __future__ import annotations

from dataclasses import dataclass

SCHEMES = ("generalised-alpha", "hht", "newmark")


@dataclass(frozen=True)
class Scheme:
    """Parameters of one member."""

    #: alpha_m and alpha_f: how far accelerations and all else are taken before the end of the step.
    alpha_m: float
    alpha_f: float
    #: beta and gamma: newmark's parameters.
    beta: float
    gamma: float

    @property
    def now(self) -> float:
        """Weight of the new state in the equations, 1 - alpha_f."""
        return 1.0 - self.alpha_f

    @property
    def rate(self) -> float:
        """Weight of the new rate of first-order unknowns."""
        return 1.5 - self.alpha_f

    @property
    def error_constant(self) -> float:
        """Factor of h^2 (a_{n+1} - a_n) in the local error of the displacements (Zienkiewicz & Xie 1991)."""
        return abs(self.beta - 1.0 / 6.0)


def scheme(name: str, numerical_damping: float = 0.0) -> Scheme:
    """Member of the family for a "numerical damping" nd in the thesis's sense (Th. 5.3, 0 to 0.5). Raises ValueError if
    the name is unknown or the damping out of range.

    nd is the shift of gamma from 1/2. It sets the spectral radius at infinite frequency, r = (1 - nd)/(1 + nd), of
    generalised-alpha and HHT; Newmark takes gamma = 1/2 + nd, beta = (1/2 + gamma)^2 / 4 and is then of first order
    only.

    Parameters
    ----------
    name : "generalised-alpha", "hht" or "newmark"
    numerical_damping : float
        0 to 0.5; for "hht" at most 1/3.

    Examples
    --------
    >>> scheme("generalised-alpha").beta
    0.25
    """
    nd = float(numerical_damping)
    limit = 1.0 / 3.0 if name == "hht" else 0.5
    if not 0.0 <= nd <= limit + 1e-12:
        raise ValueError(f"The numerical damping is {nd:g}; for {name} it must be between 0 and {limit:.3g}.")
    if name == "newmark":
        return Scheme(0.0, 0.0, 0.25 * (1.0 + nd) ** 2, 0.5 + nd)
    if name == "hht":
        return Scheme(0.0, nd, 0.25 * (1.0 + nd) ** 2, 0.5 + nd)
    if name == "generalised-alpha":
        radius = (1.0 - nd) / (1.0 + nd)
        alpha_m, alpha_f = (2.0 * radius - 1.0) / (radius + 1.0), radius / (radius + 1.0)
        shift = alpha_f - alpha_m
        return Scheme(alpha_m, alpha_f, 0.25 * (1.0 + shift) ** 2, 0.5 + shift)
    raise ValueError(f"The scheme is {name!r}; it must be one of {', '.join(SCHEMES)}.")
