"""Elastic wall of a channel with ideal unsteady one-dimensional flow, as a coupled pencil."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre, leggauss

from eigen import CoupledPencil

from .beam import beam, hermite
from .one_dimensional_flow import linearised_flow


def channel_wall(
    velocity: float, mass_ratio: float, inlet: str, *, damping: float = 0.0, modes: int = 18, inlet_length: float = 0.0
) -> CoupledPencil:
    """Polynomial Galerkin for the wall, spectral quadrature for the flow: converged digits.

    Parameters
    ----------
    velocity : float
        Mean flow U.
    mass_ratio : float
        mu.
    inlet : {"flux", "head"}
    damping : float
        Kelvin-Voigt: eta_xxxx (1 + damping d/dt).
    modes : int
        Polynomials x^2 P_k(2 x - 1).
    """
    x, weight = leggauss(modes + 10)
    x, weight = 0.5 * (x + 1), 0.5 * weight
    basis = [Polynomial([0, 0, 1]) * Legendre.basis(k, domain=[0, 1]).convert(kind=Polynomial) for k in range(modes)]
    value = np.array([f(x) for f in basis])
    turn = np.linalg.inv(np.linalg.cholesky((value * weight) @ value.T))
    curvature = turn @ np.array([f.deriv(2)(x) for f in basis])
    K = (curvature * weight) @ curvature.T
    # the flow needs the inlet and the outlet among its stations
    stations = np.concatenate([[0.0], x, [1.0]])
    flow = linearised_flow(
        stations,
        np.ones_like(stations),
        velocity,
        1.0,
        storage=True,
        inlet=inlet,
        inlet_length=inlet_length,
        integral=spectral_integral(x, stations),
    )
    J = (turn @ np.array([f(stations) for f in basis])).T
    G = np.zeros((modes, stations.size))
    G[:, 1:-1] = mass_ratio * (turn @ value) * weight
    return CoupledPencil(M=np.eye(modes), C=damping * K, K=K, G=G, J=J, **flow.keywords())


def spectral_integral(points: np.ndarray, stations: np.ndarray) -> np.ndarray:
    """Integrals from 0 to each station of the polynomial through the inner stations."""
    count = points.size
    functions = [Legendre.basis(k, domain=[0, 1]) for k in range(count)]
    fit = np.linalg.inv(np.array([f(points) for f in functions]).T)
    integrals = np.array([f.integ(lbnd=0)(stations) for f in functions]).T
    return np.hstack([np.zeros((stations.size, 1)), integrals @ fit, np.zeros((stations.size, 1))])


def channel_wall_elements(
    velocity: float, mass_ratio: float, inlet: str, *, elements: int = 100, damping: float = 0.0
) -> CoupledPencil:
    """Hermite elements for the wall, the trapezoidal rule for the flow; second order."""
    b = beam(elements)
    nodes, h = b.x.size, 1.0 / elements
    flow = linearised_flow(b.x, np.ones(nodes), velocity, 1.0, storage=True, inlet=inlet)
    J = np.zeros((nodes, 2 * nodes))
    J[np.arange(nodes), 2 * np.arange(nodes)] = 1.0
    points, weights = leggauss(4)
    xi, weights = 0.5 * (points + 1), 0.5 * h * weights
    shape = hermite(xi, h)[0]
    linear = np.array([1 - xi, xi])
    block = mass_ratio * np.einsum("ip,jp,p->ij", shape, linear, weights)
    G = np.zeros((2 * nodes, nodes))
    for e in range(elements):
        G[2 * e : 2 * e + 4, e : e + 2] += block
    return CoupledPencil(M=b.mass, C=damping * b.bending, K=b.bending, G=G[b.keep], J=J[:, b.keep], **flow.keywords())
