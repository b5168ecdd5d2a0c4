"""Contract of a model whose branches and bifurcations are computed, with what it may leave to this package.

Everything here asks for residuals, matrix-vector products, solves and directional derivatives; never for a dense matrix
of the full size.  Directional derivatives take real vectors; `Derivatives` extends them to complex ones.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from continuation.options import DerivativeMissing, NotAParameter
from continuation.spectra import Spectrum, compute_spectrum

Parameters = Mapping[str, float]


class System:
    """``B(u, mu) u' = F(u, mu)`` with a state ``u`` of ``size`` numbers and named parameters ``mu``.

    A model supplies `residual` and `linear`; `d2` and `d3` for normal forms and curves in two parameters.  By default
    the mass is constant, the spectrum comes from solves, and derivatives in parameters are differences; derivatives in
    the state never are: a missing one raises `DerivativeMissing`.  A model may have its own ``residual_norm(residual)``
    and ``state_weights``, shape (n,), of the arclength.

    `linear` returns a linearisation ``A = dF/du`` and ``B``, see `continuation.MatrixLinearisation`: ``size``;
    ``matvec``, ``rmatvec``, ``solve``, ``solve_transpose`` (plain transposes, no conjugates) of ``A``; ``mass_matvec``,
    ``mass_rmatvec``; and ``shifted(shift)``, the same four of ``A - shift B``.  Vectors have shape (n,), real or
    complex.  Optional are ``determinant_sign()`` and, for periodic orbits, the matrices ``jacobian`` and ``mass``.
    """

    size: int = 0
    #: True where ``mass_d`` vanishes, and where ``B`` is the identity; spares some work.
    constant_mass: bool = True
    identity_mass: bool = False
    #: Relative step for the central differences in parameters.
    parameter_step: float = 6e-6
    #: Sizes of parameters that are not of order one, by name: steps are a share of them where a value is small.
    parameter_sizes: Mapping[str, float] = {}

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.size} unknowns>"

    def residual(self, u: np.ndarray, mu: Parameters) -> np.ndarray:
        """``F(u, mu)``, shape (n,)."""
        raise NotImplementedError(f"{type(self).__name__} has no residual.")

    def linear(self, u: np.ndarray, mu: Parameters):
        """Linearisation at a state."""
        raise NotImplementedError(f"{type(self).__name__} has no linearisation.")

    def _slope(self, function, mu: Parameters, name: str, step: float = 0.0, least: float = 1e-3):
        """Central difference of a function of the parameters."""
        if name not in mu:
            raise NotAParameter.named(name, mu)
        h = (step or self.parameter_step) * max(least * self.parameter_sizes.get(name, 1.0), abs(mu[name]))
        up, down = mu[name] + h, mu[name] - h
        return (function({**mu, name: up}) - function({**mu, name: down})) / (up - down)

    def d_parameter(self, u, mu, name):
        """``dF/dmu_name``, shape (n,)."""
        return self._slope(lambda at: self.residual(u, at), mu, name)

    def d2(self, u, mu, a, b):
        """``F_uu[a, b]``."""
        raise DerivativeMissing(f"{type(self).__name__} has no second derivative d2.")

    def d3(self, u, mu, a, b, c):
        """``F_uuu[a, b, c]``."""
        raise DerivativeMissing(f"{type(self).__name__} has no third derivative d3.")

    def d2_parameter(self, u, mu, name, a):
        """``d(F_u a)/dmu_name``."""
        return self._slope(lambda at: self.linear(u, at).matvec(a), mu, name)

    def d_parameters2(self, u, mu, first, second):
        """``d2F/(dmu_first dmu_second)``; needed only at branch points."""
        if type(self).d_parameter is not System.d_parameter:
            return self._slope(lambda at: self.d_parameter(u, at, first), mu, second)
        wide = {"step": 1e-4, "least": 0.1}  # rounding of F is divided by two steps
        return self._slope(lambda at: self._slope(lambda x: self.residual(u, x), at, first, **wide), mu, second, **wide)

    def mass_d(self, u, mu, c, a):
        """``d(B(u) c)/du [a]``."""
        return np.zeros(self.size)

    def mass_d2(self, u, mu, c, a, b):
        """``d2(B(u) c)/du2 [a, b]``."""
        return np.zeros(self.size)

    def mass_parameter(self, u, mu, name, c):
        """``d(B c)/dmu_name``."""
        return np.zeros(self.size)

    def spectrum(self, u, mu, count: int, near: complex | None = None) -> Spectrum:
        """``count`` eigenvalues of ``A x = lambda B x``: nearest to ``near``, or leading."""
        return compute_spectrum(self.linear(u, mu), count, near)


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
