"""Sizes of a valve that follow from its case: what an engineer checks beside a drawing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .valve import ValveModel


def hoop_strain(model: ValveModel, pressure: float) -> float:
    """Strain of the round wall at the inlet by an inner pressure, Pa, of a thin cylinder that is free along its axis
    and keeps the stiffness it has at rest.
    """
    valve, stiffness = model.case.valve, model.shell.at_rest.plane_stiffness
    a = stiffness if stiffness.ndim == 2 else stiffness[-1]  # the zone at the inlet
    around = a[1, 1] - a[0, 1] ** 2 / a[0, 0]
    return float(pressure * valve.inlet_radius / (valve.thickness_at(valve.length) * around))


@dataclass(frozen=True)
class ValveSizes:
    """Derived sizes."""

    length: float  #: m.
    #: bill_width and bill_height: m; over the outer faces of the lip, at rest.
    bill_width: float
    bill_height: float
    wall_mass: float  #: kg.
    #: lip_area and inlet_area: m2; passage at rest.
    lip_area: float
    inlet_area: float
    line_volume: float  #: m3; of the pipes in front; 0 without any.

    @classmethod
    def of(cls, model: ValveModel) -> ValveSizes:
        case, shell, mesh = model.case, model.shell, model.mesh
        density = np.atleast_2d(shell.at_rest.inertia)[:, 0]  # of the wall, by element or everywhere
        mass = float(np.sum(shell.geometry.area.sum(axis=1) * shell.mesh.thickness * density))
        passage = mesh.part.copies * (mesh.rest_area - mesh.wall_deduction)
        x, y = mesh.nodes[mesh.rows[0], :2].T
        wall = mesh.thickness[: len(x) - 1]  # of the elements at the lip, from one side edge or the middle on
        width = 2 * np.abs(x).max() + wall[-1] if mesh.part.is_quarter else np.ptp(x) + 0.5 * (wall[0] + wall[-1])
        pipes = case.upstream.pipes if case.has_line else ()
        bores = [0.25 * np.pi * pipe.diameter**2 if pipe.diameter else passage[-1] for pipe in pipes]
        line = sum(bore * pipe.length for bore, pipe in zip(bores, pipes))
        return cls(
            case.valve.length,
            float(width),
            float(np.max(2 * np.maximum(y[1:], y[:-1]) + wall)),
            mesh.part.copies * mass,
            float(passage[0]),
            float(passage[-1]),
            float(line),
        )

    def lines(self) -> list[str]:
        """Sentences with units."""
        said = [
            f"{1e3 * self.length:.4g} mm long, bill {1e3 * self.bill_width:.4g} mm wide and "
            f"{1e3 * self.bill_height:.4g} mm high, wall of {self.wall_mass:.3g} kg",
            f"passage at rest {1e4 * self.lip_area:.3g} cm2 at the lips, {1e4 * self.inlet_area:.4g} cm2 at the inlet",
        ]
        if self.line_volume:
            said.append(f"pipe in front holds {self.line_volume:.4g} m3 of the fluid")
        return said
