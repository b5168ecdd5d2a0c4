"""Results of a limit cycle of the valve."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from continuation.periodic import PeriodicMotion

from ...model import ValveModel
from ...model.state import LipCentre

#: Instants of a period at which a cycle is looked at.
INSTANTS = 240


@dataclass(frozen=True, eq=False)
class Orbit:
    """A cycle of a valve, looked at over one period.

    Attributes
    ----------
    model : ValveModel
    mu : dict
        Parameters by the names of `dbvfiv.model.system.ValveSystem`.
    motion : PeriodicMotion
    """

    model: ValveModel
    mu: dict
    motion: PeriodicMotion

    @cached_property
    def phases(self) -> np.ndarray:
        """(k,) rad."""
        return 2 * np.pi * np.arange(INSTANTS) / INSTANTS

    @property
    def time(self) -> np.ndarray:
        """(k,) s."""
        return self.phases / self.motion.omega

    @cached_property
    def lip(self) -> np.ndarray:
        """(k,) displacement in y of the mid-surface of one lip at x = z = 0, m."""
        return self._of_node(self.model.mesh.centre_line[0], self.motion.coefficients)

    @cached_property
    def lip_rate(self) -> np.ndarray:
        """(k,) its rate, m/s."""
        rate = self.motion.omega * self.motion.harmonics.rate(self.motion.coefficients)
        return self._of_node(self.model.mesh.centre_line[0], rate)

    @cached_property
    def centre_line(self) -> np.ndarray:
        """(k, m) displacement in y of the line x = 0 at each row, m."""
        rows = self.model.mesh.centre_line
        return np.stack([self._of_node(node, self.motion.coefficients) for node in rows], axis=1)

    def _of_node(self, node: int, coefficients: np.ndarray) -> np.ndarray:
        number = self.model.shell.dofs.index[node, 1]
        if number < 0:
            return np.zeros(INSTANTS)
        return self.motion.harmonics.basis_at(self.phases) @ coefficients[:, number]

    @cached_property
    def lip_extremes(self) -> tuple[float, float]:
        """Least and largest displacement of the lip, m, between instants too."""
        return -_peak(-self.lip), _peak(self.lip)

    @property
    def lip_harmonics(self) -> np.ndarray:
        """(H + 1,) amplitudes of the harmonics of the lip's displacement, m; the mean first."""
        number = self.model.shell.dofs.index[self.model.mesh.centre_line[0], 1]
        parts = np.abs(self.motion.harmonics.complex(self.motion.coefficients[:, number]))
        return parts * np.append(1.0, np.full(len(parts) - 1, 2.0))

    @cached_property
    def flow(self) -> tuple[np.ndarray, np.ndarray]:
        """Mass flow at the lip, kg/s of the whole valve, at the samples of the series, and the least speed at any row
        then, m/s; (N,) each.
        """
        model, density = self.model, self.mu["density"]
        rates, samples = self.motion.rates, self.motion.samples
        n = model.size
        area = np.stack([model.rows.areas(model.nodal(x)) for x in samples[:, :n]])
        opening, inlet = rates.apply(1, area), samples[:, n]
        if model.flow.own_velocities(samples[0, n:]) is not None:
            speeds = np.stack([model.flow.own_velocities(x) for x in samples[:, n:]])
        elif not model.flow.unsteady:
            speeds = np.stack([model.flow.velocities(a, u) for a, u in zip(area, inlet)])
        else:
            fluid = model.flow.stepping(density)
            speeds = np.stack([fluid.state(a, r, u).speed for a, r, u in zip(area, opening, inlet)])
        open_area = np.array([model.flow.open_area(a) for a in area[:, 0]])
        out = model.mesh.part.copies * density * speeds[:, 0] * open_area
        return out, speeds.min(axis=1)

    def opening(self) -> float:
        """Least clear opening between the inner faces of both lips at x = z = 0, m; below zero where they cross."""
        lip = LipCentre(self.model.mesh, self.model.shell)
        samples = self.motion.at(self.phases[::4])[:, : self.model.size]
        return float(min(lip.opening(q) for q in samples))


def _peak(values: np.ndarray) -> float:
    """Largest value of a periodic signal, by the parabola through its largest sample and both neighbours."""
    top = int(np.argmax(values))
    a, b, c = values[top - 1], values[top], values[(top + 1) % len(values)]
    bend = a - 2 * b + c
    return float(b - 0.125 * (c - a) ** 2 / bend) if bend < 0 else float(b)
