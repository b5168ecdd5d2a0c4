"""Newton's method at fixed parameters: convergence, and reasons for failure."""

import jax.numpy as jnp
import numpy as np
import pytest

from continuation import NewtonOptions, NotConverged, Reason, equilibrium
from continuation.jax_system import JaxSystem


def scalar(f):
    return JaxSystem(lambda u, mu: f(u, mu), 1)


def test_convergence_is_quadratic():
    """The errors of exp(u) = 2 after each number of corrections."""
    system, errors = scalar(lambda u, mu: jnp.exp(u) - mu["c"]), []
    for count in range(1, 5):
        with pytest.raises(NotConverged) as error:
            equilibrium(system, [1.0], {"c": 2.0}, NewtonOptions(tolerance=1e-300, max_iterations=count))
        errors.append(abs(error.value.result.z[0] - np.log(2.0)))
    e = np.array([one for one in errors if one > 1e-9])
    assert len(e) >= 3 and np.all(e[1:] < e[:-1] ** 2)


@pytest.mark.parametrize(
    ("f", "start", "options", "reason"),
    [
        (lambda u, mu: u**2 + 1.0, 0.7, NewtonOptions(max_iterations=8), Reason.ITERATIONS),
        (lambda u, mu: jnp.log(u), 5.0, NewtonOptions(), Reason.NOT_FINITE),
        (lambda u, mu: 1.0 + u**4, 1e-4, NewtonOptions(), Reason.DIVERGED),
    ],
)
def test_failures_are_told_apart(f, start, options, reason):
    with pytest.raises(NotConverged, match="No equilibrium was found at c = 0") as error:
        equilibrium(scalar(f), [start], {"c": 0.0}, options)
    assert error.value.reason is reason and reason.value in str(error.value)


def test_own_norm_of_the_system_decides():
    system = scalar(lambda u, mu: u - 1.0)
    system.residual_norm = lambda r: 1e-20 * abs(r[0])
    assert equilibrium(system, [0.0], {"c": 0.0})[0] == 0.0
