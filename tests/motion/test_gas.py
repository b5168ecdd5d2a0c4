"""Valves in a gas: the kick's rate of growth, the incompressible limit, slams above vacuum, restarts."""

from types import SimpleNamespace

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.parameters import Mu
from dbvfiv.flow.energy import GAS_BOOKS
from dbvfiv.model.dynamics import linearise
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.motion.scheme import scheme
from dbvfiv.motion.start import kicked, steady_fluid, steady_positions
from dbvfiv.motion.stepper import Stepper
from dbvfiv.studies.case import thesis_case
from eigen import SearchOptions, leading_modes

AIR = {
    "fluid.density": 1.2,
    "fluid.continuity": "storage",
    "drive.pressure": 2e3,
    "damping.alpha": 0.0,
    "damping.beta": 4e-4,
}
SOUND = {"fluid.sound_speed": 343.0}


def leading(model, inlet):
    q = steady_positions(model, inlet)
    pencil = linearise(model, q, inlet).pencil(Mu.of(model.case))
    return q, leading_modes(pencil, 4, SearchOptions(limit_point=-2500.0)).eigenvalues[0]


def swung(model, inlet, step, duration, opening=1e-5):
    """Lip's swing, m, after a small kick along the leading mode, and its eigenvalue."""
    motion = ValveMotion(model)
    q = steady_positions(model, inlet)
    case = model.case.replace({"transient.kick_opening": opening, "modes.count": 6})
    state, eigenvalue = kicked(motion, q, steady_fluid(motion, q, inlet), inlet, case)
    stepper, lip = (
        Stepper(motion, scheme("generalised-alpha"), lambda t: inlet),
        model.shell.dofs.index[model.mesh.rows[0, 0], 1],
    )
    swing = [state.q[lip] - q[lip]]
    for _ in range(round(duration / step)):
        state = stepper.step(state, step).state
        swing.append(state.q[lip] - q[lip])
    return np.array(swing), eigenvalue, motion


@pytest.mark.parametrize(
    ("sealed", "inlet", "velocity", "found"),
    [
        (True, 1e3, None, (1e3, 0.0)),
        (True, 1e3, 0.0, (1e3, 0.0)),
        (True, 0.0, 0.0, None),
        (False, 1e3, None, 1e3),
        (False, 1e3, 0.0, None),
        (False, 1e3, 2.0, (1e3, 2.0)),
        (False, 0.0, None, None),
    ],
)
def test_fluid_behind_a_seal_has_the_inlet_pressure_at_rest(sealed, inlet, velocity, found):
    """From a state in a file, whose velocity is known, as from the state that is found."""
    flow = SimpleNamespace(back=0.0, with_velocity=lambda inner, velocity: (inner, velocity))
    model = SimpleNamespace(flow=flow, rows=SimpleNamespace(areas=np.abs), nodal=np.abs)
    model.seal = lambda area: 3 if sealed else None
    motion = SimpleNamespace(model=model, fluid=SimpleNamespace(steady_inner=lambda area, inlet: inlet))
    assert steady_fluid(motion, np.zeros(2), inlet, velocity) == found


@pytest.mark.slow
def test_compression_moves_the_spectrum_by_little(valve):
    """Air at 2 kPa: growth of the leading mode +0.03 1/s of 143, frequency +0.05 Hz of 27.1 on this mesh."""
    plain, gas = (leading(valve(AIR | more), 2e3)[1] for more in ({}, SOUND))
    assert gas.real - plain.real == pytest.approx(0.028, abs=0.01)
    assert gas.imag - plain.imag == pytest.approx(0.307, abs=0.05)


@pytest.mark.slow
def test_a_kick_grows_as_the_eigenvalue_says(valve):
    """By exp(lambda t), with an error of the second order in the step."""
    model, duration = valve(AIR | SOUND), 4e-3
    errors = []
    for step in (4e-4, 2e-4):
        swing, rate, motion = swung(model, 2e3, step, duration)
        assert motion.fluid.compressed
        growth = np.exp(rate * step * np.arange(len(swing)))  # the lip swings in phase: the mode is scaled by it
        errors.append(np.abs(swing / swing[0] - growth.real)[-1])
    assert errors[1] < 3e-4 and errors[0] > 3.0 * errors[1]


def test_a_stiff_gas_moves_as_the_incompressible_law(valve):
    """c = 1e5 m/s: what is left is the difference of two schemes of second order for the same equations."""
    assert not ValveMotion(valve(AIR)).fluid.compressed
    plain, gas = (swung(valve(AIR | more), 2e3, 4e-4, 4e-3)[0] for more in ({}, {"fluid.sound_speed": 1e5}))
    assert np.abs(plain - gas).max() < 1e-4 * np.abs(plain).max()


def test_a_gas_is_drawn_in_without_numerical_damping(valve):
    """A liquid is not: without it a valve in water rings from step to step after its first hammer."""
    water = {"fluid.density": 1e3, "fluid.sound_speed": 1480.0, "fluid.heat_capacity_ratio": 7.15}
    for more, damping in ((SOUND, 0.0), (water, 0.2)):
        stepper = Stepper(ValveMotion(valve(AIR | more)), scheme("generalised-alpha"), lambda t: 2e3)
        assert stepper._inward.gamma - 0.5 == pytest.approx(damping)


@pytest.mark.slow
def test_slams_stay_above_vacuum(tmp_path):
    """6 kPa: without compression pressures of this motion fall to -20 MPa; a gas ends at its absolute pressure."""
    changes = AIR | SOUND | {"mesh.around": 6, "mesh.along": 8, "drive.pressure": 6e3}
    changes |= {"transient.start": "kick", "transient.kick_opening": 1e-3, "transient.step": 2e-4}
    run = dbvfiv.load(thesis_case(), changes | {"transient.duration": 0.06}).transient(output=tmp_path / "run.h5")
    history = run.history
    assert history["time"][-1] == pytest.approx(0.06)
    assert history["station_pressure"].min() > -1.2 * 343.0**2 / 1.4
    assert history["mach"].max() < 1.3
    gained = history["gas_energy"] - history["gas_energy"][0] - history["gas_supply"]
    gone = sum(history[name] for name in GAS_BOOKS[1:])
    assert np.abs(gained + gone).max() < 1e-9 * history["gas_supply"][-1]
