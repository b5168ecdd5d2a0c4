"""Do forces and energies of pressed states balance? Checks that know nothing of how the states were found."""
from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..contact import PressedShell
from ..shell import Shell

#: Gauss points of a stretch of path, exact for the work along a cubic path of a load that is quadratic in the positions.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True)
class ForceBalance:
    """Resultants on the quarter shell, N, each (3,).

    Attributes
    ----------
    pressure, contact, supports : (3,) arrays
    error : float
        Norm of their sum over the sum of their norms.
    """

    pressure: np.ndarray
    contact: np.ndarray
    supports: np.ndarray

    @property
    def error(self) -> float:
        parts = (self.pressure, self.contact, self.supports)
        total = sum(float(np.linalg.norm(part)) for part in parts)
        return float(np.linalg.norm(sum(parts))) / total if total > 0 else 0.0


def force_balance(pressed: PressedShell, q: np.ndarray, pressure: float) -> ForceBalance:
    """Resultants at a state: the supports give what the internal forces at held displacements ask for."""
    mesh, dofs = pressed.mesh, pressed.shell.dofs
    nodal = pressed.nodal(q)
    loose = Shell(mesh, pressed.shell.section, metric=pressed.shell.metric)
    internal = loose.force(nodal.ravel()).reshape(nodal.shape)
    load = pressed.nodal_pressure_force(nodal, pressure)
    contact = np.zeros_like(nodal)
    if pressed.contact is not None:
        contact[pressed.contact.nodes, pressed.contact.axis] = pressed.contact_state(q).force
    held = np.where(dofs.free, 0.0, internal - load - contact)
    return ForceBalance(load[:, :3].sum(axis=0), contact[:, :3].sum(axis=0), held[:, :3].sum(axis=0))


@dataclass
class EnergyLedger:
    """Adds up the work of pressure and contact along a path and compares it with the strain energy gained.

    Between two equilibria the path is a cubic through both with the slopes dq/dP where these are known, else straight. Pressure follows the
    deforming shell, so its work depends on the path unless the load has a potential; the error of the balance therefore falls with the
    load step, with its fourth power on smooth stretches.

    Attributes
    ----------
    work : float, J
        Of the pressure.
    contact : float, J
        Taken up by the contact's potential.
    strain : float, J
        Strain energy gained.
    """

    pressed: PressedShell
    work: float = 0.0
    contact: float = 0.0
    strain: float = 0.0
    _last: tuple | None = field(default=None, repr=False)

    def begin(self, q: np.ndarray, pressure: float, slope: np.ndarray | None = None) -> None:
        """Where the path starts."""
        self._last = (pressure, q, slope, self.pressed.shell.energy(q), self.pressed.contact_energy(q))

    def add(self, q: np.ndarray, pressure: float, slope: np.ndarray | None = None) -> None:
        """The next equilibrium. The multipliers must be those that held since the last one."""
        before, start, slope0, strain, stored = self._last
        step, reach = q - start, pressure - before
        if slope0 is None or slope is None:
            slope0 = slope = step / reach if reach else None
        for x, w in zip(0.5 * (1 + _POINTS), 0.5 * _WEIGHTS):
            if slope is None:
                place, rate = start + x * step, step
            else:
                place, rate = _hermite(x, start, step, reach * slope0, reach * slope)
            self.work += w * float(self.pressed.pressure_force(self.pressed.nodal(place), before + x * reach) @ rate)
        energy, potential = self.pressed.shell.energy(q), self.pressed.contact_energy(q)
        self.strain += energy - strain
        self.contact += potential - stored
        self._last = (pressure, q, slope, energy, potential)

    def renewed(self) -> None:
        """The multipliers were renewed at the last state."""
        pressure, q, slope, energy, _ = self._last
        self._last = (pressure, q, slope, energy, self.pressed.contact_energy(q))

    @property
    def error(self) -> float:
        """What is missing in the balance over the work of the pressure."""
        return abs(self.work - self.strain - self.contact) / abs(self.work) if self.work else 0.0


def _hermite(x, start, step, m0, m1):
    """Cubic through two states and its derivative with respect to x in 0..1."""
    h = x * x * (3 - 2 * x)
    place = start + h * step + x * (1 - x) ** 2 * m0 + x * x * (x - 1) * m1
    rate = 6 * x * (1 - x) * step + (1 - x) * (1 - 3 * x) * m0 + x * (3 * x - 2) * m1
    return place, rate
