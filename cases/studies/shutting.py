"""A valve that water shuts: the drive turns from +10 to -10 kPa in 0.2 s, the inner faces meet.

Printed are, for each mesh, the smallest area of the passage (0.5 cm2 at rest), pressures, how deep the faces are
pressed into the closing plane, and the energies: turned over by the pressure, lost in damping and contact, unexplained.

    python cases/studies/shutting.py 6x8 8x14
    python cases/studies/shutting.py 6x8 --set supports.contact_stiffness="1000 MPa/mm"
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from kept import base_case, takes_keys

from dbvfiv.model import ValveModel
from dbvfiv.studies.session import Session

#: Against 10 kPa behind the valve.
TABLE = "time [s], pressure [kPa]\n0, 20\n0.02, 20\n0.22, 0\n"
KEYS = {
    "supports.contact": "faces",
    "downstream.pressure": "10 kPa",
    "fluid.continuity": "storage",
    "transient.start": "steady",
    "transient.duration": 0.42,
    "transient.numerical_damping": 0.2,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("meshes", nargs="+", help="AROUNDxALONG")
    takes_keys(parser)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "turn.csv"
        table.write_text(TABLE)
        for mesh in given.meshes:
            around, along = (int(part) for part in mesh.split("x"))
            size = {"mesh.around": around, "mesh.along": along, "transient.drive_table": str(table)}
            case = base_case(given).replace(KEYS | size)
            session = Session(case, mesh)
            session.model = ValveModel(case)
            tell(mesh, session.perform("transient"))


def tell(mesh: str, run) -> None:
    """Print what a run amounts to."""
    h = run.history
    pressure = h["station_pressure"] / 1e3
    print(
        f"{mesh}: {len(h['time']) - 1} steps, area {1e4 * h['smallest_area'].min():.3f} cm2, "
        f"pressures {pressure.min():.0f} to {pressure.max():.0f} kPa, "
        f"pressed in {1e6 * h['penetration'].max():.1f} um, force {h['contact_force'][-1]:.0f} N at the end, "
        f"turned over {np.abs(np.diff(h['pressure_work'])).sum():.2f} J, "
        f"damping {h['dissipation'][-1]:.2f} J, contact {h['contact_loss'][-1]:.3f} J, "
        f"numerical damping {h['numerical_loss'][-1]:.3f} J, unexplained {np.abs(h['balance']).max():.3f} J, "
        f"failures {list(run.failures)}",
        flush=True,
    )


if __name__ == "__main__":
    main()
