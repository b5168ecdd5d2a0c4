"""Velocity heads between the inlet and each station, as pressure over density, m2/s2.

The two choices agree where all speeds are outward. Traceable; `dbvfiv.flow.reversed` holds the evaluators of a time
step.
"""

from __future__ import annotations

import jax.numpy as jnp


def outward_head(speed, velocity):
    """Bernoulli's head (m,) of speeds (m,) with the inlet velocity."""
    return 0.5 * (speed**2 - velocity**2)


def reversible_head(speed, velocity):
    """Head (m,) of a flow that may run backwards, as a whole or in a part of the passage.

    Drawn in through the lips, the fluid starts from rest outside, where the pressure vanishes, gains speed at the cost
    of pressure as far as sections get narrower, and wherever they widen it goes on as a jet whose velocity head is
    lost. Bernoulli's law would give that head back at the inlet, so that a reversed flow gained pressure where it
    should lose it, and ran away.
    """
    out, back = jnp.maximum(speed, 0.0), jnp.minimum(speed, 0.0)
    gained = jnp.maximum(jnp.diff(back * back), 0.0)
    lost = jnp.concatenate([jnp.cumsum(gained[::-1])[::-1], jnp.zeros(1)])
    outside = jnp.zeros_like(speed).at[0].set(back[0] ** 2)  # what stands for the outlet is the still water outside
    return 0.5 * (out * out - out[-1] ** 2 - lost - outside)
