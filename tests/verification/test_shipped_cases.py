"""Every case that ships as a valve of its own: steady from 0.1 to 10 m of head, modes, onset over density, closure to
its rated back pressure. On coarse meshes, and on those of the cases.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.quantity import GRAVITY
from tests.small_valves import SMALL

CASES = Path(__file__).parents[2] / "cases"
VALVES = ("dbv12", "dbv12-table-layers", "dbv12-40-percent", "dbv6", "dbv36", "dbv4-wide", "dbv4-flat")
HEADS = (0.1, 0.5, 2.0, 5.0, 10.0)
MESHES = {"coarse": {"mesh.around": 8, "mesh.along": 14}, "own": {}}
OWN = ("dbv12", "dbv4-flat")  #: Those of which `make verify` takes the mesh of the case too.
each_valve = pytest.mark.parametrize(
    ("mesh", "name"),
    [("coarse", name) for name in VALVES]
    + [pytest.param("own", name, marks=() if name in OWN else pytest.mark.random) for name in VALVES],
)


def valve_of(name: str, mesh: str, **more):
    changes = {key.replace("__", "."): value for key, value in more.items()}
    return dbvfiv.load(CASES / f"{name}.toml", MESHES[mesh] | changes)


def examine(valve, heads) -> None:
    """Steady states at heads, and modes in water."""
    weight = valve.case.fluid.density * GRAVITY
    found = valve.steady(pressure=[weight * head for head in heads])
    assert len(found.states) == len(heads) and not found.failures
    flows = np.array([state.mass_flow for state in found.states])
    opening = np.array([state.lip_opening for state in found.states])
    assert np.all(np.diff(flows) > 0) and np.all(np.diff(opening) > 0) and flows[0] > 0
    for state in found.states:
        assert state.converged and state.residual < 1e-8
        jet = np.sqrt(2 * GRAVITY * state.hydraulics.total_head)
        assert state.outlet_velocity <= jet * (1 + 1e-9)  # nothing leaves faster than its head lets it
    heads = ", ".join(f"{head:g} m {flow:.4g} kg/s" for head, flow in zip(heads, flows))
    modes = valve.modes(pressure=2.0 * GRAVITY * valve.case.fluid.density)
    certificate = modes.certificate
    assert modes.stable and certificate.unstable_count == certificate.unstable_count_independent == 0
    assert all(mode.residual < 1e-8 for mode in modes.modes)
    first = modes.modes[0]
    print(f"\n{heads}; water at 2 m of head, leading mode {first.growth_rate:.4g} 1/s at {first.frequency:.4g} Hz")


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(path.stem for path in CASES.glob("*.toml")))
def test_every_case_has_a_steady_state(name):
    """At its own drive, on 6 x 8 elements."""
    valve = dbvfiv.load(CASES / f"{name}.toml", SMALL)
    state = valve.steady(pressure=valve.case.drive.pressure)
    assert state.converged and state.residual < 1e-7


@pytest.mark.slow
def test_the_wide_bill_from_rest_to_two_metres():
    examine(dbvfiv.load(CASES / "dbv4-wide.toml", SMALL), (0.1, 2.0))


@pytest.mark.slow
@each_valve
def test_steady_and_modes(name, mesh):
    examine(valve_of(name, mesh), HEADS)


@pytest.mark.slow
@each_valve
def test_onset_over_density(name, mesh):
    """Each flutters in a light enough fluid at half a metre of head, under both laws, softly or hard, and says where;
    the quasi-steady law takes it for unstable in denser fluids.
    """
    found = {}
    for law in ("quasi-steady", "storage"):
        changes = {"fluid__continuity": law, "onset__coarse_mesh": 0, "onset__normal_form": False}
        valve = valve_of(name, mesh, **changes)
        points = valve.onset(over="density=0.5:5000:25:log", pressure=0.5 * GRAVITY * 1000.0).points
        found[law] = max(point["value"] for point in points)
        assert all(point["frequency"] > 1.0 for point in points)
        told = ", ".join(f"{p['value']:.4g} kg/m3 at {p['frequency']:.4g} Hz" for p in points)
        print(f"\n{name}: {law} onset at half a metre {told}")
    assert found["quasi-steady"] > 2.0 * found["storage"] > 0


@pytest.mark.slow
@each_valve
def test_closure_to_the_rated_back_pressure(name, mesh):
    valve = valve_of(name, mesh)
    found = valve.closure()
    rated = valve.case.closure.rated_pressure or max(valve.case.closure.pressures)
    assert max(state.pressure for state in found.states) >= rated
    assert all(state.closed for state in found.states) and not found.failures
    assert found.safety.factor >= 1.0
    last = max(found.states, key=lambda state: state.pressure)
    print(
        f"\n{name}: at {last.pressure / 1e3:g} kPa sealed {1e3 * last.lip_seal:.1f}+{1e3 * last.joint_seal:.1f} mm, "
        f"{last.contact_force:.5g} N, {1e6 * last.least_opening:.3g} mm2 left\n{found.safety.sentence}"
    )
