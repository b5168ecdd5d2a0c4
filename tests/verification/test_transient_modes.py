"""Three routes to one number: the full pencil, its reduced-order model, and the ringing of the nonlinear valve after a
small push.

The push follows the leading oscillating mode. Growth rate and frequency are read off the lip by fitting x_{k+1} + g^2
x_{k-1} = 2 g cos(omega h) x_k, which holds for one mode exactly; without numerical damping the step leaves errors of
second order, which two steps show and remove.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.parameters import Mu
from dbvfiv.model.dynamics import linearise
from dbvfiv.model.equilibria import SteadyOptions
from dbvfiv.motion.control import RunOptions
from dbvfiv.motion.start import on_mode, steady_fluid, steady_positions
from dbvfiv.motion.stepper import StepOptions
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.stability.walk import StabilityWalk
from dbvfiv.studies.transient.run import Runner
from eigen import SearchOptions, leading_modes
from tests.pages import agrees, table_of

PUSH = 1e-8  # m; at 2 kPa, where stops at the corners of the lips part, 1e-6 m changes the frequency by 0.5 %
BETA = 0.003
QUASI, STORAGE = "quasi-steady", "storage"
MESH = {"mesh.around": 6, "mesh.along": 8}
#: Fineness in space and time of quick tests.
COARSE = {"mesh": tuple(MESH.values()), "steps": (25, 50)}
#: Continuity law, pressure (Pa), density (kg/m3), and the sign of the growth rate.
STATES = [
    (QUASI, 2e3, 10.0, +1),
    (QUASI, 6e3, 1.2, +1),
    (QUASI, 10e3, 100.0, -1),
    (QUASI, 18e3, 1000.0, -1),
    (STORAGE, 2e3, 1.2, +1),
    (STORAGE, 6e3, 1.2, +1),
    (STORAGE, 10e3, 10.0, -1),
    (STORAGE, 18e3, 1000.0, -1),
]


def three_routes(
    law: str, pressure: float, density: float, mesh=(8, 12), steps=(50, 100), periods: float = 1.25, further=None
) -> dict:
    """Eigenvalues of the leading oscillating mode by the three ways, the last by steps per period and in the limit of
    small ones; `further` holds other keys of the case.
    """
    changes = {
        "mesh.around": mesh[0],
        "mesh.along": mesh[1],
        "fluid.continuity": law,
        "fluid.density": density,
        "drive.pressure": pressure,
        "damping.alpha": 0.0,
        "damping.beta": BETA,
    } | (further or {})
    valve = dbvfiv.load(thesis_case(), changes)
    model, full = valve.model, leading_oscillation(valve)
    q = steady_positions(model, pressure)
    walk, place = StabilityWalk(valve.case, model=model), Mu.of(valve.case)
    walk.give(place, q)
    # the reduced-order model is made beside the state itself
    column = walk.column([place.at(beta=share * BETA) for share in (0.9, 0.95, 1.05, 1.1)])
    reduced = column.model.nearest(place, full.eigenvalue)
    rings, limit = rung_in_time(valve, full.frequency, steps, periods)
    return {"full": full.eigenvalue, "reduced": complex(reduced), "in time": rings, "limit": limit}


def leading_oscillation(valve):
    """The mode that a kick of a valve follows."""
    return [mode for mode in valve.modes(count=8).modes if mode.frequency > 0][valve.case.transient.kick_mode - 1]


def rung_in_time(
    valve, frequency: float, steps=(50, 100), periods: float = 1.25, examine=lambda run: None
) -> tuple[list[complex], complex]:
    """Eigenvalues of a valve's ringing after a push of its lip by `PUSH` along the mode of a frequency, Hz, for numbers
    of steps a period; and in the limit of small steps, from the last two.
    """
    model, rings, lip = valve.model, [], valve.model.shell.dofs.index[valve.model.mesh.centre_line[0], 1]
    q = steady_positions(model, valve.case.drive.pressure, SteadyOptions.of(valve.case))
    for count in steps:
        step = 1 / frequency / count
        keys = {"transient.step": step, "transient.duration": periods * count * step}
        model.case = valve.case.replace({"transient.start": "kick", "transient.kick_opening": PUSH} | keys)
        options = replace(RunOptions.of(model.case), step=StepOptions(tolerance=1e-8, floor=1e-13))
        run = Runner(model, options).start()
        assert not run.failures
        examine(run)
        rings.append(ringing((run.history["lip_displacement"] - q[lip]) / PUSH, step))
    first, second = rings[-2:]
    return rings, second + (second - first) / ((steps[-1] / steps[-2]) ** 2 - 1)


def ringing(x: np.ndarray, step: float) -> complex:
    """Eigenvalue of a series that one mode makes."""
    square, double = np.linalg.lstsq(np.stack([-x[:-2], x[1:-1]], axis=1), x[2:], rcond=None)[0]
    root = np.roots([1.0, -double, square]).astype(complex)
    return complex(np.log(root[np.argmax(root.imag)]) / step)


def check_three_routes(found: dict, words: str) -> None:
    """The full pencil, its reduction and the ringing in time say the same."""
    full = found["full"]
    print(f"\n{words}: full {full:.5f} reduced {found['reduced']:.5f} limit {found['limit']:.5f} {found['in time']}")
    assert abs(found["reduced"] - full) < 1e-6 * abs(full)
    growth, frequency = errors(found["limit"], full)
    assert growth < 0.01 and frequency < 0.005


def errors(found: complex, expected: complex) -> tuple[float, float]:
    """Relative errors of growth rate and frequency."""
    return abs(found.real / expected.real - 1), abs(abs(found.imag) / abs(expected.imag) - 1)


def table(rows: list) -> str:
    """Lines for the documentation."""
    lines = [
        "| continuity | kPa | kg/m3 | growth rate, frequency (full) | reduced | in time | off by, % |",
        "|---|---|---|---|---|---|---|",
    ]
    for (law, pressure, density, _), r in rows:

        def text(v):
            return f"{v.real:.4f}, {abs(v.imag) / (2 * np.pi):.4f}"

        growth, frequency = errors(r["limit"], r["full"])
        lines.append(
            f"| {law} | {pressure / 1e3:g} | {density:g} | {text(r['full'])} | {text(r['reduced'])} | "
            f"{text(r['limit'])} | {100 * growth:.3f}, {100 * frequency:.4f} |"
        )
    return "\n".join(lines)


@pytest.mark.parametrize("law, pressure, density, sign", [STATES[n] for n in (0, 3, 4, 7)])
def test_three_routes(law, pressure, density, sign):
    """Each flow model at either sign; `test_three_routes_on_the_valve` has all states."""
    found = three_routes(law, pressure, density, **COARSE)
    full = found["full"]
    check_three_routes(found, f"{law} {pressure:g} {density:g}")
    assert np.sign(full.real) == sign
    # what the step leaves falls as its square
    off = [abs(complex(r.real, abs(r.imag)) - full) for r in found["in time"]]
    assert off[1] < 0.3 * off[0]


LINE = {"upstream.length": 10.0, "upstream.friction": 0.02, "upstream.loss": 1.5, "upstream.diameter": "300 mm"}
WAVES = LINE | {"upstream.wave_speed": 300.0}
#: A rigid pipe before two elastic ones.
MIXED = {
    "upstream.pieces": [
        {"length": 4.0, "diameter": "300 mm", "loss": 0.5},
        {"length": 8.0, "diameter": "250 mm", "wave_speed": 600.0, "elements": 3},
        {"length": 2.0, "diameter": "200 mm", "friction": 0.02, "wave_speed": 900.0, "elements": 2},
    ]
}
VISCOUS = {"fluid.viscosity": "water"}
TAIL = {"downstream.pipe_diameter": "305 mm", "downstream.length": 5.0, "downstream.loss": 1.5}
#: Installations and fluids by name: continuity law, pressure, density, keys, and mesh where it is not (8, 12); the last
#: three are gaps that take a good part of the head.
INSTALLED = {
    "pipe": (QUASI, 2e3, 10.0, LINE),
    "short pipe": (STORAGE, 6e3, 1.2, LINE | {"upstream.length": 2.0, "drive.at": "line"}),
    "elastic line": (QUASI, 2e3, 10.0, WAVES),
    "elastic line from a gauge": (STORAGE, 6e3, 100.0, WAVES | {"upstream.wave_speed": 400.0, "drive.at": "line"}),
    "three pipes": (STORAGE, 6e3, 100.0, MIXED, (6, 8)),
    "pipe behind": (QUASI, 2e3, 10.0, TAIL),
    "pipe behind, storage": (STORAGE, 6e3, 1.2, TAIL),
    "downwards": (STORAGE, 4e3, 1000.0, {"gravity.direction": "-z"}, (6, 8)),
    "upwards in water": (STORAGE, 14e3, 1000.0, {"gravity.direction": "+z", "outside.fluid": "same"}, (6, 8)),
    "thick fluid": (QUASI, 1000.0, 1000.0, {"fluid.viscosity": 0.02}, (6, 8)),
    "water": (STORAGE, 600.0, 1000.0, VISCOUS, (6, 8)),
    "water, pipe": (STORAGE, 2e3, 1e3, VISCOUS | {"upstream.length": 2, "upstream.loss": 0.5}, (6, 8)),
}
QUICK = ("short pipe", "pipe behind, storage")


@pytest.mark.slow
@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in INSTALLED])
def test_three_routes_of_installations(name):
    law, pressure, density, further, *mesh = INSTALLED[name]
    fineness = COARSE if name in QUICK else {"mesh": mesh[0]} if mesh else {}
    check_three_routes(three_routes(law, pressure, density, further=further, **fineness), name)


@pytest.mark.slow
def test_three_routes_with_the_default_mesh():
    """Mass and inertia of the fluid are the same in spectra and in time; they move the eigenvalue by more than these
    differ.
    """
    law, pressure, density, _ = STATES[0]
    keys = {"shell.mass": "averaged", "mesh.inertia": "parabolic"}
    found = three_routes(law, pressure, density, further=keys, **COARSE)
    check_three_routes(found, "averaged mass, parabolic inertia")
    changes = MESH | {"damping.alpha": 0.0, "damping.beta": BETA}
    valve = dbvfiv.load(thesis_case(), changes | {"fluid.density": density, "drive.pressure": pressure})
    consistent = leading_oscillation(valve)
    assert abs(found["full"].imag) / (2 * np.pi) < 0.99 * consistent.frequency


@pytest.mark.slow
@pytest.mark.parametrize("law", [QUASI, STORAGE])
@pytest.mark.parametrize("pressure, touching", [(1.6e3, 3), (1.7e3, 2), (1.8e3, 2), (2.2e3, 0)])
def test_three_routes_of_a_bill_that_is_moulded_shut(law, pressure, touching):
    """From 0.2 to 3 mm of opening, in water: faces that touch in the state do so in spectra and in time."""
    keys = {"valve.sealing_pressure": 800.0, "damping.beta": 1e-3}
    state = dbvfiv.load(thesis_case(), MESH | keys).steady(pressure=pressure)
    assert state.stops == touching and state.mass_flow > 0
    found = three_routes(law, pressure, 1000.0, mesh=tuple(MESH.values()), further=keys)
    full = found["full"]
    print(f"\n{law} {pressure:g}: full {full:.5f} limit {found['limit']:.5f} in time {found['in time']}")
    assert np.sign(full.real) == (1 if law == QUASI else -1)
    assert abs(found["reduced"] - full) < 1e-5 * abs(full)
    growth, frequency = errors(found["limit"], full)
    assert growth < 1e-3 and frequency < 1e-3


#: Waves take 20 ms through the line.
SOFT_LINE = {
    f"upstream.{k}": x for k, x in {"length": 3.0, "diameter": 0.3, "wave_speed": 150.0, "elements": 8}.items()
}
#: Air behind a rigid column of it.
AIR = {"fluid.density": 1.2, "fluid.sound_speed": 340.0, "upstream.length": 3.0, "upstream.diameter": 0.3}


@pytest.mark.slow
@pytest.mark.parametrize(
    "law, more, number",
    [
        (QUASI, {}, 0),
        pytest.param(STORAGE, {}, 0, marks=pytest.mark.slow),
        pytest.param(STORAGE, SOFT_LINE, 1, marks=pytest.mark.slow),
        pytest.param(STORAGE, AIR, 0, marks=pytest.mark.slow),
    ],
)
def test_a_sealed_bill_rings_as_its_spectrum_says(law, more, number):
    """At 0.6 of the sealing pressure, in a fluid that is still but for what the wall displaces, and its waves. The lips
    are held, so the push is measured where the line through their middle moves most: 1 um, a ninetieth of what parts or
    meets a face.
    """
    keys = MESH | {"valve.sealing_pressure": 800.0, "damping.alpha": 0.0, "damping.beta": 1e-3} | more
    pressure, push, rings = 480.0, 1e-6, []
    valve = dbvfiv.load(thesis_case(), keys | {"fluid.continuity": law, "drive.pressure": pressure})
    model, q = valve.model, steady_positions(valve.model, pressure)
    found = leading_modes(linearise(model, q, pressure).pencil(Mu.of(valve.case)), 4, SearchOptions())
    mode = found.mode(int(np.flatnonzero(found.eigenvalues.imag > 1.0)[number]))
    eigenvalue, line = complex(mode.eigenvalue), model.shell.dofs.index[model.mesh.centre_line, 1]
    row = int(np.argmax(np.where(line >= 0, abs(mode.q[line]), 0.0)))
    shape = mode.q * (push / mode.q[line[row]])
    assert model.contact_reach(q, model.nodal(shape)) > 90
    for count in (25, 50) if law == QUASI else (50, 100):
        step = 2 * np.pi / eigenvalue.imag / count
        model.case = valve.case.replace({"transient.step": step, "transient.duration": 1.25 * count * step})
        run = Runner(model, replace(RunOptions.of(model.case), step=StepOptions(tolerance=1e-8, floor=1e-13)))
        inner = steady_fluid(run.motion, q, pressure)
        flow = (mode.u * (push / mode.q[line[row]])).real
        run.start(on_mode(run.motion, q, inner, pressure, shape, eigenvalue, flow))
        assert not run.failures
        rings.append(ringing((run.history["centre_line"][:, row] - q[line[row]]) / push, step))
    limit = rings[1] + (rings[1] - rings[0]) / 3
    print(f"\n{law}: {eigenvalue:.5f} limit {limit:.5f} in time {rings}")
    growth, frequency = errors(limit, eigenvalue)
    assert eigenvalue.real < 0 and growth < 5e-3 and frequency < 2e-3


@pytest.mark.slow
def test_three_routes_on_the_valve():
    rows = [(state, three_routes(*state[:3], mesh=(28, 48))) for state in STATES]
    print("\n" + table(rows))
    for (_, _, _, sign), found in rows:
        growth, frequency = errors(found["limit"], found["full"])
        assert np.sign(found["full"].real) == sign
        assert growth < 2e-5 and frequency < 1e-5
    check_page({f"{law} {p / 1e3:g} {density:g}": found["full"] for (law, p, density, _), found in rows})


def check_page(found: dict) -> None:
    """Eigenvalues by flow model, kPa and kg/m3 are those that docs/evidence/time.md prints."""
    for law, pressure, density, printed, *_ in table_of("evidence/time.md", "flow model | kPa | kg/m3").rows[1:]:
        value, (growth, frequency) = found[f"{law} {pressure} {density}"], printed.split(", ")
        assert agrees(growth, value.real) and agrees(frequency, abs(value.imag) / (2 * np.pi)), (printed, value)
