"""Separation of the flow behind the narrowest section of the passage.

    head_k = s integral_in^k max(-dU^2/ds, 0)/2 ds

Bernoulli's law gives the velocity head back wherever the passage widens downstream. A flow that leaves a nearly shut
throat separates there and goes on as a jet (Idelchik, diffusers of more than some 15 degrees): the share s of what it
would give back is lost. With s = 1 the pressure falls all the way, and behind the throat it is that around the jet.
Without it a throat of no area has a suction without bound, and a valve that is about to shut sucks itself shut.

The corner of the maximum is rounded, over what a share of the velocity head per length of the valve would take.
Equation (T.33) of docs/theory.md.
"""

from __future__ import annotations

import jax.numpy as jnp

from ..term import FlowTerm


class Separation(FlowTerm):
    """Loss of the velocity head that a widening passage would give back.

    Parameters
    ----------
    share : float
        0 (Bernoulli) to 1 (a jet that recovers nothing).
    """

    DATA = ("share",)
    behind_throat = True

    def __init__(self, share: float):
        self.share = float(share)

    def head(self, stream, parameters):
        out = jnp.maximum(stream.speed, 0.0)
        square = out * out
        gain = jnp.diff(square)
        corner = 0.5 * (square[1:] + square[:-1]) * stream.step / jnp.sum(stream.step)
        lost = 0.5 * (gain + jnp.sqrt(gain**2 + corner**2 + 1e-300))  # no slope where nothing flows
        return 0.5 * self.share * jnp.concatenate([jnp.cumsum(lost[::-1])[::-1], jnp.zeros(1)])


def from_case(case) -> Separation | None:
    """The separation of a case, or None where its flow follows the wall."""
    return Separation(case.separation) if case.separation else None
