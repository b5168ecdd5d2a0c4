"""Mixed elements for waves in a pipe: flow continuous, of degree N, pressure of degree N - 1 in each element.

The derivative of every flow is a pressure of the space, so there are no spurious modes, a flow without compression is
uniform as in a rigid column, and the two couplings are each other's transposes: energy is conserved (Joly 2003, in
Topics in Computational Wave Propagation). Flow is interpolated between Gauss-Lobatto points, pressure lives at the N
Gauss points. Eigenvalues err by the power 2 N of the length of an element.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

#: Degree N of the flow.
DEGREE = 4


class Element(NamedTuple):
    """An element on 0..1.

    Attributes
    ----------
    nodes : (N + 1,) array
        Where the flow's unknowns are.
    points, weights : (N,) arrays
        Gauss's, where those of the pressure are.
    value, slope : (N, N + 1) arrays
        Flow and its derivative at the points from its unknowns.
    mass : (N + 1, N + 1) array
        Integral of the product of two shapes.
    """

    nodes: np.ndarray
    points: np.ndarray
    weights: np.ndarray
    value: np.ndarray
    slope: np.ndarray
    mass: np.ndarray


@cache
def element(degree: int = DEGREE) -> Element:
    """The element of a degree, at least 2."""
    inner = legendre.legroots(legendre.legder(np.eye(degree + 1)[degree]))
    nodes = 0.5 * (1.0 + np.concatenate([[-1.0], inner, [1.0]]))
    shapes = np.linalg.inv(legendre.legvander(2.0 * nodes - 1.0, degree))  # columns: series of each shape

    def at(places, order=0):
        series = shapes if not order else legendre.legder(shapes, scl=2.0)
        return legendre.legvander(2.0 * places - 1.0, degree - order) @ series

    points, weights = (0.5 * x for x in legendre.leggauss(degree))
    points = points + 0.5
    finer, share = legendre.leggauss(degree + 1)
    exact = at(0.5 * (1.0 + finer))
    return Element(nodes, points, weights, at(points), at(points, 1), exact.T @ (0.5 * share[:, None] * exact))


def chain(count: int, degree: int = DEGREE) -> np.ndarray:
    """(count, N + 1) numbers of the nodes of elements in a row."""
    return degree * np.arange(count)[:, None] + np.arange(degree + 1)
