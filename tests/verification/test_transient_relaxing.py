"""A small push in time against the eigenvalue, where the wall relaxes by the materials' loss factors.

The push starts on the mode with its memory, so one mode rings from the first instant; see `test_transient_modes` for
how its eigenvalue is read off the lip.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest

import dbvfiv
from dbvfiv.motion.control import RunOptions
from dbvfiv.motion.start import steady_positions
from dbvfiv.motion.stepper import StepOptions
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.transient.run import Runner
from tests.small_valves import FORMER

from .test_transient_modes import PUSH, QUASI, STORAGE, errors, ringing

#: Continuity law, pressure (Pa), density (kg/m3).
STATES = [(QUASI, 6e3, 50.0), (QUASI, 12e3, 1000.0), (STORAGE, 6e3, 10.0), (STORAGE, 12e3, 300.0)]


def two_routes(
    law: str, pressure: float, density: float, mesh=(6, 8), steps=(50, 100), further=MappingProxyType({})
) -> tuple[complex, list[complex]]:
    """Eigenvalue of the leading oscillating mode, and from its ringing by steps per period."""
    changes = dict(further) | {
        "mesh.around": mesh[0],
        "mesh.along": mesh[1],
        "fluid.continuity": law,
        "fluid.density": density,
        "drive.pressure": pressure,
        "damping.model": "loss factor",
        "transient.start": "kick",
        "transient.kick_opening": PUSH,
        "transient.duration": 0.2,
    }
    model = dbvfiv.load(thesis_case(), changes).model
    case, q = model.case, steady_positions(model, pressure)
    lip, rings, value = model.shell.dofs.index[model.mesh.rows[0, 0], 1], [], None
    step = 1e-3
    for count in (None, *steps):
        if count is not None:
            step = 2 * np.pi / value.imag / count
        duration = step if count is None else 1.25 * count * step
        model.case = case.replace({"transient.step": step, "transient.duration": duration})
        options = replace(RunOptions.of(model.case), step=StepOptions(tolerance=1e-8, floor=1e-13))
        run = Runner(model, options).start()
        assert not run.failures
        value = run.progress.eigenvalue
        if count is not None:
            rings.append(ringing((run.history["lip_displacement"] - q[lip]) / PUSH, step))
    return value, rings


@pytest.mark.parametrize("law, pressure, density", STATES)
def test_a_small_push_grows_at_the_eigenvalues_rate(law, pressure, density):
    value, rings = two_routes(law, pressure, density)
    limit = rings[1] + (rings[1] - rings[0]) / 3.0
    growth, frequency = errors(limit, value)
    print(
        f"\n{law} {pressure:g} Pa {density:g} kg/m3: {value:.5f}, in time {rings}, off by {growth:.2g} {frequency:.2g}"
    )
    assert growth < 0.01 and frequency < 0.005
    off = [abs(complex(r.real, abs(r.imag)) - value) for r in rings]
    assert off[1] < 0.3 * off[0]


#: Continuity law, pressure (Pa), bracket of densities (kg/m3) around the onset at which stability is lost or regained;
#: on even rows. The thesis's constants at 6 kPa, stable ones above, where these have lost material stability.
ONSETS = [
    (QUASI, 6e3, (800.0, 1200.0)),
    (QUASI, 25e3, (120.0, 240.0)),
    (STORAGE, 6e3, (200.0, 260.0)),
    (STORAGE, 12e3, (5.0, 10.0)),
]


@pytest.mark.slow
@pytest.mark.parametrize("law, pressure, bracket", ONSETS)
def test_the_onset_lies_where_the_sign_changes_in_time(law, pressure, bracket):
    """A little below and above the onset a push decays on one side and grows on the other, at rates that vanish where
    the eigenvalue's does.
    """
    valve = dict(FORMER) | ({"materials.constants": "stable"} if pressure > 6e3 else {})
    changes = valve | {
        "mesh.around": 6,
        "mesh.along": 8,
        "fluid.continuity": law,
        "drive.pressure": pressure,
        "damping.model": "loss factor",
        "onset.normal_form": False,
        "onset.coarse_mesh": 0.0,
    }
    found = dbvfiv.load(thesis_case(), changes).onset(f"density={bracket[0]}:{bracket[1]}:5").summary()["points"]
    assert len(found) == 1
    onset, limits = found[0]["value"], []
    densities = onset * np.array([0.98, 1.02])
    for density in densities:
        value, rings = two_routes(law, pressure, float(density), further=valve)
        assert abs(value.imag) / (2 * np.pi) == pytest.approx(found[0]["frequency"], rel=0.02)
        limits.append((rings[1] + (rings[1] - rings[0]) / 3.0).real)
    crossing = densities[0] - limits[0] * (densities[1] - densities[0]) / (limits[1] - limits[0])
    print(f"\n{law} {pressure:g} Pa: onset {onset:.4f} kg/m3, in time {limits} 1/s, {crossing:.4f} kg/m3")
    assert limits[0] * limits[1] < 0
    assert crossing == pytest.approx(onset, rel=2e-3)
