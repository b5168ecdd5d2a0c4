"""Small systems as systems of `continuation.cycles.CycleSolver`: residual(x, x', x'', phase, mu) in jax."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from continuation.periodic import PeriodicOperator, Term


class SmallPeriodic:
    """A system that is a dense matrix at every sample; its basis is all of it."""

    def __init__(self, residual, size: int, autonomous: bool = True):
        self.size, self.autonomous, self.scales = size, autonomous, np.ones(size)
        self._residual = jax.jit(jax.vmap(residual, in_axes=(0, 0, 0, 0, None)))
        slopes = jax.vmap(jax.jacfwd(residual, argnums=(0, 1, 2)), in_axes=(0, 0, 0, 0, None))
        self._slopes = jax.jit(slopes)

    def _at(self, motion):
        x, rates = motion.samples, motion.rates
        return x, rates.apply(1, x), rates.apply(2, x), motion.harmonics.phases

    def residual(self, motion, mu):
        return np.asarray(self._residual(*self._at(motion), mu))

    def linearise(self, motion, mu, rough=False):
        k, c, m = (np.asarray(part) for part in self._slopes(*self._at(motion), mu))
        return PeriodicOperator(motion, [Term([(0, k), (1, c), (2, m)])])

    def smoother(self, operator, mu):
        return None

    @property
    def basis(self):
        return np.eye(self.size)


def van_der_pol() -> SmallPeriodic:
    """x'' - mu (1 - x^2) x' + x = 0."""
    return SmallPeriodic(lambda x, v, a, t, mu: a - mu["mu"] * (1 - x**2) * v + x, 1)


def duffing() -> SmallPeriodic:
    """w^2 x'' + d w x' + x + e x^3 = f cos t, in the phase t of the forcing."""

    def residual(x, v, a, t, mu):
        w = mu["w"]
        return w**2 * a + mu["d"] * w * v + x + mu["e"] * x**3 - mu["f"] * jnp.cos(t)

    return SmallPeriodic(residual, 1, autonomous=False)


def of_first_order(rate, size: int) -> SmallPeriodic:
    """u' = rate(u, mu)."""
    return SmallPeriodic(lambda u, v, a, t, mu: v - rate(u, mu), size)
