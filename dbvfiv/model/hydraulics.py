"""Hydraulic results of a steady flow: heads, head loss, loss and flow coefficients (K, Kv, Cv)."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from ..case.quantity import GRAVITY, WATER, head_of

#: Kv in m3/h at 1 bar over Cv in US gallons a minute at 1 psi (IEC 60534-1).
CV_OVER_KV = 1.156


@dataclass(frozen=True)
class Behind:
    """Flow downstream of the valve; the defaults are those of a free discharge.

    Attributes
    ----------
    pressure : float, Pa
        Static pressure around the jet, over that of the surroundings.
    jet_velocity : float, m/s
        NaN where it is not known.
    recovered : float, Pa
        Pressure rise where the jet has widened to a pipe; 0 where its energy is lost.
    velocity : float, m/s
        Velocity in that pipe; 0 without one.
    loss : float, m
        Head lost in that pipe up to its far end.
    """

    pressure: float = 0.0
    jet_velocity: float = math.nan
    recovered: float = 0.0
    velocity: float = 0.0
    loss: float = 0.0


@dataclass(frozen=True)
class Hydraulics:
    """Heads, head loss and coefficients of the valve in a steady flow.

    The whole head of a valve that discharges freely ends in its jet. In a downstream pipe the jet gives back a part.

    Attributes
    ----------
    flange_velocity : float, m/s
    total_head : float, m
        Total head at the flange, static and velocity head, of the fluid, over that of the surroundings.
    head_loss : float, m
        Total head that ends in the valve and its jet: from the flange to the fluid at rest around a free discharge, or
        to the downstream pipe where the jet has widened.
    loss_coefficient : float
        K, the loss over the velocity head at the flange; infinite without a flow.
    discharge_coefficient : float
        Flow over that of the flange's section at the jet velocity of the head that is lost; 1/sqrt(K).
    kv : float, m3/h
        Flow of water at a static pressure of 1 bar between flange and fluid behind (IEC 60534-1), at this opening.
    cv : float, US gallons a minute
        The same at 1 psi.
    line_loss : float, m
        Head lost by friction and fittings of an upstream pipe; 0 without one.
    supply_head : float, m
        Total head at the far end of the upstream pipe, or at the flange without one.
    jet_velocity : float, m/s
    recovered_pressure, recovered_head : float, Pa, m
        Pressure and head that the jet gives back in a downstream pipe.
    tail_loss : float, m
        Head lost in the downstream pipe.
    downstream_head : float, m
        Static head at its far end, or around a free discharge, over that of the surroundings.
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
    jet_velocity: float
    recovered_pressure: float
    recovered_head: float
    tail_loss: float
    downstream_head: float

    def summary(self) -> dict[str, float]:
        """Plain numbers, SI but for kv and cv."""
        return asdict(self)


def hydraulics_of(
    pressure: float,
    density: float,
    volume_flow: float,
    flange_velocity: float,
    line_loss: float = 0.0,
    behind: Behind | None = None,
) -> Hydraulics:
    """Hydraulics of a flow.

    Parameters
    ----------
    pressure : float, Pa
        Static, at the flange, over that of the surroundings.
    density : float, kg/m3
    volume_flow : float, m3/s
    flange_velocity : float, m/s
    line_loss : float, m
    behind : Behind, optional
        Free discharge into the surroundings without it.

    Examples
    --------
    >>> found = hydraulics_of(1e5, 1000.0, 0.01, 1.0)
    >>> round(found.kv, 6), round(found.loss_coefficient, 6)
    (36.0, 201.0)
    """
    behind = Behind() if behind is None else behind
    velocity_head = flange_velocity**2 / (2 * GRAVITY)
    total = head_of(pressure, density) + velocity_head
    flows = velocity_head > 0
    static = behind.pressure + behind.recovered
    loss = total - head_of(static, density) - behind.velocity**2 / (2 * GRAVITY)
    drop = pressure - static
    kv = 3600 * volume_flow * math.sqrt(density / WATER * 1e5 / drop) if drop > 0 else math.nan
    return Hydraulics(
        flange_velocity=flange_velocity,
        total_head=total,
        head_loss=loss,
        loss_coefficient=loss / velocity_head if flows else math.inf,
        discharge_coefficient=flange_velocity / math.sqrt(2 * GRAVITY * loss) if flows and loss > 0 else 0.0,
        kv=kv,
        cv=CV_OVER_KV * kv,
        line_loss=line_loss,
        supply_head=total + line_loss,
        jet_velocity=behind.jet_velocity,
        recovered_pressure=behind.recovered,
        recovered_head=head_of(behind.recovered, density),
        tail_loss=behind.loss,
        downstream_head=head_of(static, density) - behind.loss,
    )
