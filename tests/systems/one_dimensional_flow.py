"""Linearised one-dimensional ideal flow through a channel of varying area.

The matrices that a `CoupledPencil` wants (areas to pressures, one inlet unknown), for
both continuity laws, by the trapezoidal rule along the stations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class FlowMatrices:
    """Pressures from areas and the inlet velocity, polynomial in lambda.

    Attributes
    ----------
    A0, A1, A2 : ndarray, shape (m, m)
        Pressure per area, per area rate, per second rate.
    B0, B1 : ndarray, shape (m, 1)
        Pressure per inlet velocity and its rate.
    R0, R1, R2 : ndarray, shape (1, m)
    S0, S1 : ndarray, shape (1, 1)
        The condition that closes the flow at the outlet.
    """

    A0: np.ndarray
    A1: np.ndarray
    A2: np.ndarray
    B0: np.ndarray
    B1: np.ndarray
    R0: np.ndarray
    R1: np.ndarray
    R2: np.ndarray
    S0: np.ndarray
    S1: np.ndarray

    def keywords(self) -> dict[str, np.ndarray]:
        """The matrices as keywords of `CoupledPencil`."""
        return dict(vars(self))


def cumulative_trapezoid(stations: np.ndarray) -> np.ndarray:
    """Matrix that integrates station values from the first station on, shape (m, m)."""
    step = np.diff(stations)
    integral = np.zeros((stations.size, stations.size))
    for k in range(1, stations.size):
        integral[k] = integral[k - 1]
        integral[k, k - 1] += 0.5 * step[k - 1]
        integral[k, k] += 0.5 * step[k - 1]
    return integral


def linearised_flow(
    stations,
    area,
    inlet_velocity,
    density,
    *,
    storage: bool,
    inlet: str = "head",
    inlet_length: float = 0.0,
    integral: np.ndarray | None = None,
) -> FlowMatrices:
    """Linearise p = P - rho [(U^2 - U_in^2)/2 + d/dt int U ds] about a steady flow.

    Parameters
    ----------
    stations : array, shape (m,)
        Positions from the inlet on, m.
    area : array, shape (m,)
        Steady areas (any unit of area per width).
    inlet_velocity : float
    density : float
    storage : bool
        True: the wall displaces fluid, dA/dt + d(AU)/dz = 0. False: A U is uniform.
    inlet : {"head", "flux"}
        "head": the pressure at the inlet is that of a reservoir,
        p = -rho (U u + inlet_length du/dt); "flux": the inlet velocity is held.
        Both have the outlet pressure at zero.
    integral : ndarray, shape (m, m), optional
        Integrals from the inlet to the stations; default the trapezoidal rule.
    """
    s, a = np.asarray(stations, float), np.asarray(area, float)
    m = s.size
    velocity = inlet_velocity * a[0] / a
    integral = cumulative_trapezoid(s) if integral is None else integral
    # u = from_area a + from_rate da/dt + from_inlet u_in
    from_area = -np.diag(velocity / a)
    from_area[:, 0] += velocity[0] / a  # a wall that moves at the inlet changes the flow rate
    from_rate = -integral / a[:, None] if storage else np.zeros((m, m))
    from_inlet = (a[0] / a)[:, None]
    # p = -rho (U u - U_in u_in + d/dt int u) + p_in, and the inlet's own law for p_in
    gain = -density * np.diag(velocity)
    inertia = -density * integral
    e_in = np.zeros((m, 1))
    e_in[:] = density * velocity[0]
    A0 = gain @ from_area
    A1 = gain @ from_rate + inertia @ from_area
    A2 = inertia @ from_rate
    B0 = gain @ from_inlet + e_in
    B1 = inertia @ from_inlet
    if inlet == "head":
        B0 = B0 - density * velocity[0]
        B1 = B1 - density * inlet_length
        return FlowMatrices(A0, A1, A2, B0, B1, A0[-1:], A1[-1:], A2[-1:], B0[-1:], B1[-1:])
    if inlet == "flux":
        # the unknown is the inlet pressure instead of the inlet velocity
        one, zero = np.ones((m, 1)), np.zeros((m, 1))
        return FlowMatrices(A0, A1, A2, one, zero, A0[-1:], A1[-1:], A2[-1:], one[-1:], zero[-1:])
    raise ValueError(f"The inlet law '{inlet}' is unknown; it is 'head' or 'flux'.")
