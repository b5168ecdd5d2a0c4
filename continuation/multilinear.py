"""Directional derivatives of a system at one state, for complex directions too."""

from __future__ import annotations

import numpy as np


def expand(function, *vectors):
    """Apply a real multilinear ``function`` to complex vectors by splitting them."""
    for i, vector in enumerate(vectors):
        if np.iscomplexobj(vector):
            head, tail = vectors[:i], vectors[i + 1 :]
            result = 0.0
            if np.any(vector.real):
                result = result + expand(function, *head, np.ascontiguousarray(vector.real), *tail)
            if np.any(vector.imag):
                result = result + 1j * expand(function, *head, np.ascontiguousarray(vector.imag), *tail)
            return np.zeros(vector.size, complex) if np.isscalar(result) else result
    return np.asarray(function(*vectors))


class Derivatives:
    """``F`` and ``B`` and their derivatives at ``(u, mu)``.

    Parameters
    ----------
    system : System
    u : ndarray, shape (n,)
    mu : mapping of str to float
    """

    def __init__(self, system, u, mu):
        self.system, self.u, self.mu = system, u, mu

    def d2(self, a, b):
        return expand(lambda x, y: self.system.d2(self.u, self.mu, x, y), a, b)

    def d3(self, a, b, c):
        return expand(lambda x, y, z: self.system.d3(self.u, self.mu, x, y, z), a, b, c)

    def d2_parameter(self, name, a):
        return expand(lambda x: self.system.d2_parameter(self.u, self.mu, name, x), a)

    def mass_d(self, c, a):
        return expand(lambda x, y: self.system.mass_d(self.u, self.mu, x, y), c, a)

    def mass_d2(self, c, a, b):
        return expand(lambda x, y, z: self.system.mass_d2(self.u, self.mu, x, y, z), c, a, b)

    def mass_parameter(self, name, c):
        return expand(lambda x: self.system.mass_parameter(self.u, self.mu, name, x), c)

    def jacobian_along(self, v, du, dmu):
        """``d(F_u v)`` for a change ``du`` of the state and ``dmu`` (dict) of the parameters."""
        result = self.d2(v, du) if np.any(du) else np.zeros(v.size, np.result_type(v, du))
        for name, change in dmu.items():
            if change != 0.0:
                result = result + change * self.d2_parameter(name, v)
        return result

    def mass_along(self, c, du, dmu):
        """``d(B c)`` for the same change."""
        result = self.mass_d(c, du) if np.any(du) else np.zeros(c.size, np.result_type(c, du))
        for name, change in dmu.items():
            if change != 0.0:
                result = result + change * self.mass_parameter(name, c)
        return result
