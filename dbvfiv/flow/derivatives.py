"""Everything that follows from the definition of a flow law by differentiation, for any law.

Functions here take the law itself as their first argument. They are compiled once for each kind of law and number of
stations; areas, parameters and the law's own numbers may change freely.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp

#: Newton steps within which the steady flow must be found, and the relative size of the last one.
_STEPS, _TOLERANCE = 60, 1e-12


def along(function, *directions):
    """The function of one argument (a pytree) that is the derivative of `function` along all directions."""
    for direction in directions:
        function = partial(lambda inner, v, u: jax.jvp(inner, (u,), (v,))[1], function, direction)
    return function


@jax.jit
def equations(law, motion, parameters):
    """Pressures (m,) and residuals (l,)."""
    return law.equations(motion, parameters)


@jax.jit
def linearised(law, motion, parameters):
    """A0, A1, A2, B0, B1, R0, R1, R2, S0, S1 of `dbvfiv.flow.law.FluidOperators`."""
    pressure, residual = jax.jacfwd(lambda m: law.equations(m, parameters))(motion)
    return (*pressure, *residual)


@jax.jit
def steady_pressure(law, area, parameters):
    """Steady pressures (m,)."""
    return law.steady(area, parameters)[0]


@jax.jit
def steady_inner(law, area, parameters):
    """Steady inner unknowns (l,)."""
    return law.steady(area, parameters)[1]


@jax.jit
def steady_operator(law, area, parameters):
    """Steady pressures (m,) and their derivative (m, m) by the areas."""
    pressure = lambda x: law.steady(x, parameters)[0]  # noqa: E731
    return pressure(area), jax.jacfwd(pressure)(area)


@jax.jit
def steady_slope(law, area, parameters):
    """Derivative (m,) of the steady pressures by the inlet pressure."""
    inlet = parameters["inlet"]
    return jax.jacfwd(lambda p: law.steady(area, parameters | {"inlet": p})[0])(inlet)


def solve_steady(law, area, parameters):
    """Pressures (m,) and inner unknowns (l,) at which the law's equations are met in a passage at rest; traceable.

    Newton's method finds the unknowns. Two more steps, through which derivatives are traced, leave them where they are
    and make their derivatives by areas and parameters exact up to the third: each step doubles the order, as it does
    the digits. Not numbers where the search fails.
    """
    inner = jnp.zeros(0)
    if law.inner:
        inner = _root(*jax.lax.stop_gradient((law, area, parameters)))
        for _ in range(2):
            inner = inner + _newton_step(law, area, parameters, inner)
    return law.at_rest(area, inner, parameters)[0], inner


def _newton_step(law, area, parameters, inner):
    equations = lambda x: law.at_rest(area, x, parameters)[1]  # noqa: E731
    return -jnp.linalg.solve(jax.jacfwd(equations)(inner), equations(inner))


def _root(law, area, parameters):
    """Inner unknowns (l,) by Newton's method, a step halved as long as it makes the next one longer."""
    step_at = partial(_newton_step, law, area, parameters)

    def better(inner, step, fraction):
        return jnp.linalg.norm(step_at(inner + fraction * step)) <= jnp.linalg.norm(step)

    def advance(carried):
        inner, step, count = carried
        fraction = jax.lax.while_loop(lambda f: (f > 1e-3) & ~better(inner, step, f), lambda f: 0.5 * f, jnp.ones(()))
        inner = inner + fraction * step
        return inner, step_at(inner), count + 1

    def goes_on(carried):
        inner, step, count = carried
        return (count < _STEPS) & (jnp.linalg.norm(step) > _TOLERANCE * jnp.linalg.norm(inner))

    start = law.steady_start(area, parameters)
    inner, step, _ = jax.lax.while_loop(goes_on, advance, (start, step_at(start), 0))
    found = jnp.linalg.norm(step) <= _TOLERANCE * jnp.linalg.norm(inner)
    return jnp.where(found, inner, jnp.nan)
