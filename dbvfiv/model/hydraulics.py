"""What an installer reads off a steady flow: heads, loss, coefficients."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from ..case.quantity import GRAVITY, WATER, head_of

#: Kv in m3/h at 1 bar over Cv in US gallons a minute at 1 psi (IEC 60534-1).
CV_OVER_KV = 1.156


@dataclass(frozen=True)
class Hydraulics:
    """A valve that discharges freely: the energy of its jet is lost, nothing is recovered behind it.

    Attributes
    ----------
    flange_velocity : float, m/s
    total_head : float, m
        At the flange, static and velocity head, of the fluid, over that of the surroundings.
    head_loss : float, m
        Total head that ends in the valve and its jet; of a free discharge all of it.
    loss_coefficient : float
        K, the loss over the velocity head at the flange; infinite without a flow.
    discharge_coefficient : float
        Flow over that of the flange's section at the jet velocity of the total head.
    kv : float, m3/h
        Flow of water at a static pressure of 1 bar at the flange (IEC 60534-1), at this opening.
    cv : float, US gallons a minute
        The same at 1 psi.
    line_loss : float, m
        Head lost by friction and fittings of a line in front; 0 without one.
    supply_head : float, m
        Total head at the far end of the line, or at the flange without one.
    """

    flange_velocity: float
    total_head: float
    head_loss: float
    loss_coefficient: float
    discharge_coefficient: float
    kv: float
    cv: float
    line_loss: float
    supply_head: float

    def summary(self) -> dict[str, float]:
        """Plain numbers, SI but for kv and cv."""
        return asdict(self)


def hydraulics_of(
    pressure: float, density: float, volume_flow: float, flange_velocity: float, line_loss: float = 0.0
) -> Hydraulics:
    """Hydraulics of a flow into free surroundings.

    Parameters
    ----------
    pressure : float, Pa
        Static, at the flange, over that of the surroundings.
    density : float, kg/m3
    volume_flow : float, m3/s
    flange_velocity : float, m/s
    line_loss : float, m

    Examples
    --------
    >>> found = hydraulics_of(1e5, 1000.0, 0.01, 1.0)
    >>> round(found.kv, 6), round(found.loss_coefficient, 6)
    (36.0, 201.0)
    """
    velocity_head = flange_velocity**2 / (2 * GRAVITY)
    total = head_of(pressure, density) + velocity_head
    flows = velocity_head > 0
    kv = 3600 * volume_flow * math.sqrt(density / WATER * 1e5 / pressure) if pressure > 0 else math.nan
    return Hydraulics(
        flange_velocity=flange_velocity,
        total_head=total,
        head_loss=total,
        loss_coefficient=total / velocity_head if flows else math.inf,
        discharge_coefficient=flange_velocity / math.sqrt(2 * GRAVITY * total) if flows else 0.0,
        kv=kv,
        cv=CV_OVER_KV * kv,
        line_loss=line_loss,
        supply_head=total + line_loss,
    )
