"""Friction of the passage's own walls: laminar in narrow gaps, turbulent in wide ones.

    head_k = integral_in^k g ds,      g = 48 nu U/D^2 [1 + (Re/Re_c)^6]^(1/8),      Re = |U| D/nu,      D = 4 A/P

D is the hydraulic diameter of a section, A its area, P the arc of its wall. Slow flow is Poiseuille's between parallel
faces, dp/ds = 12 mu U/h^2 with D = 2 h. Fast flow is Dean's turbulent channel (1978, J. Fluids Eng. 100, 215), a stress
of 0.073 Re_h^(-1/4) rho U^2/2 on either face with Re_h = |U| h/nu. They meet at Re_c, where the power makes one of the
two, within 9 per cent of the larger; a real channel stays laminar up to 1.5 Re_c. Both are developed flows: on a short
wide passage the boundary layers leave a core that loses nothing, and friction here is an upper bound.

Equation (T.22) of docs/theory.md.
"""

from __future__ import annotations

from ..law import FlowParameter
from ..term import VISCOSITY, FlowTerm, upstream_integral

#: Darcy's factor times Re between parallel faces, and Dean's factor times Re^(1/4), by the hydraulic diameter.
LAMINAR, TURBULENT = 96.0, 4 * 0.073 * 2**0.25
#: Reynolds number at which they meet.
MEETING = (LAMINAR / TURBULENT) ** (4 / 3)


class GapFriction(FlowTerm):
    """Friction of a fluid in the valve's passage.

    Parameters
    ----------
    viscosity : float, Pa s
    """

    DATA = ("viscosity",)
    viscous = True

    def __init__(self, viscosity: float):
        self.viscosity = float(viscosity)

    @property
    def parameters(self) -> tuple[FlowParameter, ...]:
        return (FlowParameter(VISCOSITY, "Pa s", "viscosity of the fluid", self.viscosity),)

    def gradient(self, speed, diameter, viscosity):
        """Head lost per length, m/s2, at speeds, m/s, in sections of hydraulic diameters, m; viscosity over density in
        m2/s.
        """
        reynolds = speed * diameter / viscosity
        slow = 0.5 * LAMINAR * viscosity * speed / diameter**2
        return slow * (1.0 + (reynolds / MEETING) ** 6) ** 0.125

    def head(self, stream, parameters):
        diameter = 4.0 * stream.open_area / stream.perimeter
        lost = self.gradient(stream.speed, diameter, parameters[VISCOSITY] / parameters["density"])
        return upstream_integral(stream.step, lost)


def from_case(case) -> GapFriction | None:
    """The friction of a case, or None where its fluid has no viscosity."""
    return GapFriction(case.fluid.dynamic_viscosity) if case.fluid.dynamic_viscosity else None
