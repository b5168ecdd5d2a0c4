"""System whose residual is written once in JAX; every derivative follows from it.

Sparse Jacobians are assembled from a few directional derivatives: columns that share no row have one colour and one
direction (Curtis, Powell & Reid, J. Inst. Math. Appl. 13 (1974) 117).
"""

from __future__ import annotations

from collections.abc import Callable

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
import scipy.sparse as sp  # noqa: E402

from continuation.checks import number_of, shown  # noqa: E402
from continuation.linear import MatrixLinearisation  # noqa: E402
from continuation.options import NotAParameter, require  # noqa: E402
from continuation.system import System  # noqa: E402


class JaxSystem(System):
    """``B(u, mu) u' = F(u, mu)`` with ``F`` (and ``B``) as JAX functions.

    Parameters
    ----------
    residual : callable
        ``residual(u, mu)`` of a JAX array (n,) and a dict of floats; returns shape (n,).
    size : int
        n.
    mass : None, array, sparse matrix or callable
        None is the identity; a matrix is a constant ``B``; a callable ``mass(u, mu, v)``
        returns ``B(u, mu) v`` (linear in ``v``) and is differentiated too.
    sparsity : None or sparse matrix, shape (n, n)
        Pattern of ``dF/du``, and of a callable mass; given, Jacobians are assembled sparse from a few
        coloured directional derivatives.  None assembles them dense.

    Examples
    --------
    >>> import jax.numpy as jnp, numpy as np
    >>> fold = JaxSystem(lambda u, mu: mu["r"] + u**2, size=1)
    >>> fold.linear(np.array([-2.0]), {"r": -4.0}).matvec(np.ones(1))
    array([-4.])
    """

    def __init__(self, residual: Callable, size: int, mass=None, sparsity: sp.spmatrix | None = None):
        if not callable(residual):
            raise TypeError(f"The residual is a function of the state and the parameters, not {shown(residual)}.")
        self.size = int(number_of(size, "size"))
        require(self.size == size and size >= 1, f"The size must be a whole number from 1, not {size}.")
        for name, matrix in (("mass", None if callable(mass) else mass), ("sparsity", sparsity)):
            shape = (self.size, self.size) if matrix is None else np.shape(matrix)
            require(shape == (self.size, self.size), f"The {name} has shape {shape}; the size is {self.size}.")
        self._constant_mass = None if callable(mass) else mass
        self.constant_mass, self.identity_mass = not callable(mass), mass is None
        whole = np.eye(self.size), np.transpose
        coloured = None if sparsity is None else ColouredJacobian(sparsity)
        seeds, self._assemble = whole if coloured is None else (coloured.seeds, coloured.assemble)
        seeds = jnp.asarray(seeds)

        def f(u, mu):
            return _evaluate(residual, "residual", u, mu)

        self._residual = jax.jit(f)
        self._along = _directional_derivatives(f)
        self._jacobian = jax.jit(lambda u, mu: jax.vmap(lambda s: jax.jvp(lambda x: f(x, mu), (u,), (s,))[1])(seeds))
        if callable(mass):
            # The direction multiplied by B rides along, frozen.
            def b(u, mu, c):
                return _evaluate(mass, "mass", u, mu, c)

            self._mass_along = _directional_derivatives(b)
            self._mass_matrix = jax.jit(lambda u, mu: jax.vmap(lambda s: b(u, mu, s))(seeds))

    # -- residual and first derivatives

    def residual(self, u, mu):
        return np.asarray(self._residual(np.asarray(u, float), _floats(mu)))

    def linear(self, u, mu):
        u, mu = np.asarray(u, float), _floats(mu)
        mass = self._constant_mass if self.constant_mass else self._assemble(np.asarray(self._mass_matrix(u, mu)))
        return MatrixLinearisation(self._assemble(np.asarray(self._jacobian(u, mu))), mass)

    def d_parameter(self, u, mu, name):
        return self._directional(u, mu, [(None, name)])

    # -- higher derivatives

    def d2(self, u, mu, a, b):
        return self._directional(u, mu, [(a, None), (b, None)])

    def d3(self, u, mu, a, b, c):
        return self._directional(u, mu, [(a, None), (b, None), (c, None)])

    def d2_parameter(self, u, mu, name, a):
        return self._directional(u, mu, [(a, None), (None, name)])

    def d_parameters2(self, u, mu, first, second):
        return self._directional(u, mu, [(None, first), (None, second)])

    def _directional(self, u, mu, directions, *frozen):
        """Derivative along directions, each of the state or a parameter: of B times a frozen vector where one is given,
        else of F.
        """
        if frozen and self.constant_mass:
            return np.zeros(self.size)
        mu = _floats(mu)
        tangents = []
        for vector, name in directions:
            if name is not None and name not in mu:
                raise NotAParameter.named(name, mu)
            step = np.zeros(self.size) if vector is None else np.asarray(vector, float)
            tangents.append((step, {key: float(key == name) for key in mu}))
        along = self._mass_along if frozen else self._along
        return np.asarray(along(np.asarray(u, float), mu, tangents, *frozen))

    # -- mass

    def mass_d(self, u, mu, c, a):
        return self._directional(u, mu, [(a, None)], c)

    def mass_d2(self, u, mu, c, a, b):
        return self._directional(u, mu, [(a, None), (b, None)], c)

    def mass_parameter(self, u, mu, name, c):
        return self._directional(u, mu, [(None, name)], c)


def _evaluate(function: Callable, name: str, u, mu, *more):
    """Value of a model's function, traced; what it does wrong is said in a sentence."""
    try:
        value = function(u, mu, *more)
        if value is None:
            raise TypeError(f"The {name} returns nothing.")
        value = jnp.asarray(value, dtype=jnp.float64)
    except jax.errors.JAXTypeError as error:
        raise TypeError(
            f"The {name} must be written with jax.numpy: numpy and Python's float, int and if cannot be differentiated."
        ) from error
    except KeyError as error:
        if error.args and error.args[0] not in mu:
            raise NotAParameter.named(error.args[0], mu) from error
        raise
    if value.shape != u.shape:
        raise ValueError(f"The {name} has shape {value.shape}; the state has {u.shape}.")
    return value


def _floats(mu) -> dict[str, float]:
    return {name: float(value) for name, value in mu.items()}


def _directional_derivatives(f) -> Callable:
    """Jitted derivatives of ``f(u, mu, *frozen)`` along as many joint directions as are given."""

    def nest(g, direction):
        return lambda u, mu: jax.jvp(g, (u, mu), direction)[1]

    def derivative(u, mu, directions, *frozen):
        def g(u, mu):
            return f(u, mu, *frozen)

        for direction in directions:
            g = nest(g, direction)
        return g(u, mu)

    return jax.jit(derivative)


def colour_columns(pattern: sp.spmatrix) -> np.ndarray:
    """Greedy distance-2 colouring: columns of one colour share no row.

    Parameters
    ----------
    pattern : sparse matrix, shape (m, n)
        Where entries may be non-zero.

    Returns
    -------
    ndarray of int, shape (n,)
        Colours 0, 1, ...; see Curtis, Powell & Reid, J. Inst. Math. Appl. 13 (1974) 117.
    """
    by_row, by_column = sp.csr_matrix(pattern), sp.csc_matrix(pattern)
    colours = np.full(pattern.shape[1], -1)
    for j in range(pattern.shape[1]):
        rows = by_column.indices[by_column.indptr[j] : by_column.indptr[j + 1]]
        taken = {colours[k] for r in rows for k in by_row.indices[by_row.indptr[r] : by_row.indptr[r + 1]]}
        colour = 0
        while colour in taken:
            colour += 1
        colours[j] = colour
    return colours


class ColouredJacobian:
    """Sparse matrix from products with the seeds of a colouring.

    Attributes
    ----------
    seeds : ndarray, shape (colours, n)
        Directions whose products with the Jacobian hold all its entries.
    """

    def __init__(self, pattern: sp.spmatrix):
        coo = sp.coo_matrix(pattern)
        coo.sum_duplicates()
        self.shape = coo.shape
        self._rows, self._columns = coo.row, coo.col
        colours = colour_columns(coo)
        self._colour_of_entry = colours[self._columns]
        self.seeds = np.zeros((colours.max(initial=0) + 1, self.shape[1]))
        self.seeds[colours, np.arange(self.shape[1])] = 1.0

    def assemble(self, products: np.ndarray) -> sp.csc_matrix:
        """Matrix whose products with the seeds are ``products``, shape (colours, m)."""
        data = products[self._colour_of_entry, self._rows]
        return sp.csc_matrix((data, (self._rows, self._columns)), shape=self.shape)
