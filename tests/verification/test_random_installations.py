"""Random installations of all that a case can say of one: pipes in series, waves, discharge, water outside, gravity,
and both kinds of damping. None fails; spectrum and independent count agree, or the result says that they do not.
"""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.parameters import Mu
from dbvfiv.case.quantity import GRAVITY
from dbvfiv.errors import CaseError, SolveError
from dbvfiv.model import ValveModel, linearise, select_search
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.stability.walk import StabilityWalk
from eigen import SearchOptions, TransferBasis, certified_spectrum
from eigen.pairs import all_eigenvalues
from tests.verification.test_transient_modes import rung_in_time

MESH = {"mesh.around": 6, "mesh.along": 8}
#: What a state may be refused with: a discharge that gives back all the head there is, a wall that touches its pipe.
ALLOWED = ("finite steady flow", "touches the pipe around it", "wider than the pipe that it stands in")


#: Elements of the pipes in front, from the far end; 0 for a rigid one. A few patterns, as each is compiled by itself.
LINES = ((), (0,), (2,), (0, 0, 0), (0, 2), (2, 0, 1))


def random_pipe(rng, elements: int) -> dict:
    """Keys of a pipe that someone may have."""
    keys = {
        "length": float(10 ** rng.uniform(-1, 2.5)),
        "diameter": float(rng.uniform(0.15, 0.6)),
        "loss": float(rng.choice([0.0, rng.uniform(0, 10)])),
    }
    kind = rng.random()
    if kind < 0.3:
        keys["friction"] = float(rng.uniform(0.005, 0.08))
    elif kind < 0.6:
        keys["roughness"] = float(10 ** rng.uniform(-6, -3))
    if elements:
        keys |= {"wave_speed": float(10 ** rng.uniform(2.2, 3.2)), "elements": elements}
    return keys


def random_installation(rng) -> dict:
    """Keys of an installation, its drive and density."""
    density = float(10 ** rng.uniform(0, 3.2))
    keys = {"fluid.density": density, "valve.thickness_factor": float(rng.uniform(0.7, 1.3))}
    pipes = [random_pipe(rng, elements) for elements in LINES[rng.integers(len(LINES))]]
    if len(pipes) == 1:
        keys |= {f"upstream.{name}": value for name, value in pipes[0].items()}
    elif pipes:
        keys["upstream.pieces"] = pipes
    keys["drive.at"] = str(rng.choice(["reservoir", "line"]))
    keys["downstream.pressure"] = float(rng.choice([0.0, 10 ** rng.uniform(2, 5)]))
    if rng.random() < 0.3:
        keys |= {
            "downstream.pipe_diameter": float(rng.uniform(0.28, 0.9)),
            "downstream.length": float(rng.choice([0.0, 10 ** rng.uniform(-1, 2)])),
            "downstream.loss": float(rng.choice([0.0, rng.uniform(0, 10)])),
        }
    if rng.random() < 0.4:
        keys["outside.fluid"] = "same" if rng.random() < 0.6 else float(10.0 ** rng.uniform(0, 3.2))
        keys["outside.lips"] = str(rng.choice(["closed", "open"]))
        if rng.random() < 0.4:
            keys["outside.pipe_diameter"] = float(rng.uniform(0.33, 1.5))
    keys["gravity.direction"] = str(rng.choice(["none", "-z", "+z"]))
    keys["damping.model"] = str(rng.choice(["rayleigh", "loss factor"]))
    if keys["damping.model"] == "loss factor":
        keys["materials.constants"] = "stable"
    level = density * GRAVITY * 0.56 * {"none": 0.0, "-z": -1.0, "+z": 1.0}[keys["gravity.direction"]]
    drive = float(10 ** rng.uniform(2, 4.6))
    return keys | {"drive.pressure": max(keys["downstream.pressure"] + level, 0.0) + drive}


def look_at(number: int, seed: int, conditions_each: int = 3) -> tuple[list[str], list[str], int]:
    """Conditions left open, states refused with a reason, and how many conditions were unstable."""
    rng, left_open, refused, unstable = np.random.default_rng(seed), [], [], 0
    for i in range(number):
        keys = random_installation(rng)
        case = thesis_case(MESH | keys)
        model = ValveModel(case)
        try:
            linear = linearise(model, LoadPath(model).go_to(case.drive.pressure).q, case.drive.pressure)
        except SolveError as error:
            assert any(words in str(error) for words in ALLOWED), (i, keys, str(error))
            refused.append(f"{i}: {error}")
            continue
        basis = None
        for _ in range(conditions_each):
            own = Mu.of(case)
            relaxes = bool(model.relaxation.groups)
            beta = 0.0 if relaxes or rng.random() < 0.1 else float(10 ** rng.uniform(-5, -2))
            factor = float(rng.uniform(0.3, 2.0)) if relaxes else 0.0
            line = own.pipes
            conditions = Mu(
                density=own.density, alpha=float(rng.choice([0.0, 5.0])), beta=beta, loss_factor=factor, **line
            )
            pencil = linear.pencil(conditions.at(storage=float(rng.choice([0.0, 1.0]))))
            basis = TransferBasis(pencil) if basis is None or relaxes else basis
            lowest = basis.structural_frequencies
            resolved = model.flow.resolved(line)
            search = select_search(SearchOptions(), conditions, lambda n, known=lowest: known[:n], 6, resolved)
            found = certified_spectrum(pencil, 6, search.options, basis=basis, whole=False)
            unstable += bool(found.unstable_count)
            if not found.agrees:
                assert not found.stable and found.statement
                left_open.append(f"{i}: {conditions}, {keys}: {found.statement}")
    return left_open, refused, unstable


@pytest.mark.slow
def test_waves_resolved_far_above_the_modes():
    """The band ends where the waves are resolved, at thirty times the highest unstable mode of a lightly damped wall:
    shifts of the band's size converge to nothing, and closer ones are taken.
    """
    keys = {
        "fluid.density": 6.439481599036446,
        "valve.thickness_factor": 0.7471367031159876,
        "upstream.pieces": [
            {"length": 1.3914951978421821, "diameter": 0.4537121899809169},
            {
                "length": 0.1920701519938924,
                "diameter": 0.5060342722202749,
                "friction": 0.07309567392050009,
                "wave_speed": 537.8548622781612,
                "elements": 2,
            },
        ],
        "downstream.pressure": 140.6336416111368,
        "drive.at": "reservoir",
        "drive.pressure": 343.6359928351305,
    }
    case = thesis_case(MESH | keys)
    model = ValveModel(case)
    linear = linearise(model, LoadPath(model).go_to(case.drive.pressure).q, case.drive.pressure)
    own = Mu.of(case)
    pencil = linear.pencil(Mu(density=own.density, alpha=5.0, beta=1.838e-5, loss_factor=0.0, **own.pipes, storage=1.0))
    found = certified_spectrum(pencil, 6, SearchOptions(max_frequency=2800.0), whole=False)
    assert found.agrees and found.unstable_count == 8, found.statement
    every = all_eigenvalues(pencil)
    every = every[(every.imag > 0) & (every.imag < 2 * np.pi * 2800.0)]
    listed = found.spectrum.eigenvalues
    assert np.allclose(listed, every[np.argsort(-every.real)][: len(listed)], rtol=1e-7)


@pytest.mark.slow
def test_a_short_line_resolves_waves_far_above_the_modes():
    """Up to 16 kHz: at light damping a first shift of that size meets acoustic modes alone; at more the wall is stable
    and the count above what is resolved says nothing.
    """
    keys = {"fluid.density": 44.36, "drive.pressure": 5712.0, "fluid.continuity": "storage", "drive.at": "line"}
    line = {"length": 0.1546, "diameter": 0.2333, "wave_speed": 1202.3, "elements": 4}
    case = thesis_case(MESH | keys | {f"upstream.{name}": value for name, value in line.items()})
    valve = dbvfiv.load(case, {"damping.alpha": 0.0})
    walk = StabilityWalk(valve.case, model=valve.model)
    for beta in (1.3e-4, 2.4e-3):
        mu = Mu.of(valve.case).at(beta=beta)
        sample = walk.sample(mu, walk.cell(mu))
        every = all_eigenvalues(walk.family(mu).at(mu))
        leading = max(every[every.imag < 2 * np.pi * walk.search(mu).claimed], key=lambda value: value.real)
        assert sample.certified and sample.verdict.outcome == ("flutters" if leading.real > 0 else "stable")
        assert np.abs(sample.eigenvalues - leading).min() < 1e-6 * abs(leading)
        modes = valve.modes(count=4, beta=beta)
        assert modes.verdict.outcome == sample.verdict.outcome and modes.verdict.certain


@pytest.mark.slow
def test_a_wall_with_loss_factors_is_counted_as_far_as_waves_are_resolved():
    keys = {"damping.model": "loss factor", "damping.loss_factor": 1.374, "materials.constants": "stable"}
    keys |= {"fluid.density": 370.6, "drive.pressure": 1853.8, "fluid.continuity": "storage"}
    line = {"length": 0.844, "diameter": 0.5124, "wave_speed": 419.054, "elements": 4}
    valve = dbvfiv.load(thesis_case(), MESH | keys | {f"upstream.{name}": value for name, value in line.items()})
    modes, walk = valve.modes(count=6), StabilityWalk(valve.case, model=valve.model)
    assert modes.verdict.outcome == walk.verdict(Mu.of(valve.case)).outcome == "stable" and modes.verdict.certain


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "seed"), [(6, 102), *(pytest.param(40, n, marks=pytest.mark.random) for n in (100, 101))]
)
def test_many_installations(number, seed):
    left_open, refused, unstable = look_at(number, seed)
    print(
        f"\n{unstable} of {3 * number} unstable, {len(left_open)} left open, {len(refused)} refused",
        *left_open,
        *refused,
        sep="\n",
    )
    assert len(left_open) <= 2 and len(refused) <= 4 and unstable


@pytest.mark.slow
@pytest.mark.random
def test_modes_of_many_installations_ring_in_time():
    """A push along the leading oscillating mode swings and grows as its eigenvalue says, in steps of 1/50 and 1/100 of
    its period extrapolated: within 0.3 %, where lips that touch stiffen it most. Installations whose modes are not
    listed as far as they grow are left out.
    """
    rng, worst, rung = np.random.default_rng(2), 0.0, 0
    for _ in range(16):
        keys = random_installation(rng) | {"fluid.continuity": str(rng.choice(["quasi-steady", "storage"]))}
        if keys["damping.model"] == "rayleigh":
            keys |= {"damping.alpha": float(rng.choice([0.0, 5.0])), "damping.beta": float(10 ** rng.uniform(-4, -2))}
        try:
            valve = dbvfiv.load(thesis_case(), MESH | keys)
            found = valve.modes(count=8)
        except (CaseError, SolveError):
            continue
        walk = StabilityWalk(valve.case, model=valve.model)
        assert walk.verdict(Mu.of(valve.case)).outcome == found.verdict.outcome, keys
        if found.verdict.outcome == "undecided":
            continue
        leading = next(mode for mode in found.modes if mode.frequency > 0)
        eigenvalue = leading.eigenvalue
        limit = rung_in_time(valve, leading.frequency)[1]
        rung, worst = rung + 1, max(worst, abs(limit - eigenvalue) / abs(eigenvalue))
        print(f"{eigenvalue:.5g} 1/s, in time {limit:.5g}: {keys}")
    assert rung >= 10 and worst < 3e-3
