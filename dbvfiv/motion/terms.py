"""Parts of the equations of a time step: weights, start of the fluid, and load by the fluid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..flow.gas_stepping import GasFlow, GasInstant, GasStep
from ..flow.line_stepping import LineInstant, LineState, LineStep


@dataclass(frozen=True)
class Weights:
    """Weights of the parts of a step's equations: their dependence on the new unknowns.

    Attributes
    ----------
    theta : float
        Point in the step at which the fluid's equations are met: the share of the new state there.
    load : float
        Factor of G p there.
    inertia : float
        Factor of M, 1/s2; mass damping included.
    force : float
        Factor of the tangent of F.
    velocity : float
        Derivative of the new velocities with respect to the new positions, 1/s.
    psi : float
        Derivative of the rate of psi with respect to the new psi, 1/s.
    outside : float
        Factor of the added mass of fluid outside, 1/s2: no damping acts on it.
    """

    theta: float
    load: float
    inertia: float
    force: float
    velocity: float
    psi: float
    outside: float = 0.0


@dataclass(frozen=True)
class Step:
    """Start of the fluid in a step.

    Attributes
    ----------
    theta : float
        See `Weights`.
    speed : float
        Inlet velocity at the start, m/s.
    psi_weight : float
    psi_known : (m,) array
        The rate of psi is psi_weight psi + psi_known, with the new psi.
    inlet : float
        Inlet pressure where the equations are met, Pa.
    line : LineStep or LineInstant, optional
        Waves in an elastic upstream pipe; `inlet` is then the pressure at its far end.
    gas : GasStep or GasInstant, optional
        State of a compressible fluid.
    """

    theta: float
    speed: float
    psi_weight: float
    psi_known: np.ndarray
    inlet: float
    line: LineStep | LineInstant | None = None
    gas: GasStep | GasInstant | None = None


@dataclass
class Load:
    """Fluid of a step and its force on the wall.

    Attributes
    ----------
    force : (n,) array
        G p, where the equations are met.
    outlet : float
        Pressure at the outlet, Pa, to vanish; zero where U is no unknown.
    pressure : (m,) array
        Pa, where the equations are met.
    area, speed, psi : (m,) arrays
        At the end of the step: m2 of the part, m/s, m2/s.
    psi_rate : (m,) array
        Where the equations are met, m2/s2.
    inlet : float
        Inlet pressure there, Pa.
    mid_speed : float
        Inlet velocity there, m/s.
    line : LineState, optional
        Waves in an elastic line at the end of the step.
    flange_slope : float
        Derivative of the pressure at the flange by the inlet velocity, both where the equations are met, Pa s/m.
    gas : GasFlow, optional
        A fluid that is compressed, at the end of the step.
    """

    force: np.ndarray
    outlet: float
    pressure: np.ndarray
    area: np.ndarray
    speed: np.ndarray
    psi: np.ndarray
    psi_rate: np.ndarray
    inlet: float
    mid_speed: float
    line: LineState | None = None
    flange_slope: float = 0.0
    gas: GasFlow | None = None
