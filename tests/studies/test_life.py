"""Life of a valve: a bent strip in closed form, results that hold a motion and those that do not."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from dbvfiv.errors import CaseError
from dbvfiv.materials.fatigue import SHAPE, UNIT, CrackGrowth, shipped_growth
from dbvfiv.materials.laws import IsotropicElastic, MooneyRivlin
from dbvfiv.shell import Layer, Section, Shell, ShellMesh
from dbvfiv.shell.recovery import interlaminar_shear
from dbvfiv.shell.section import Zones
from dbvfiv.studies.case import load_case
from dbvfiv.studies.life import Life, Motion, _run, motion_of
from tests.shell.structures import rectangle
from tests.small_valves import load_small

MODULUS, THICKNESS, FLAW = 1e6, 0.01, 25e-6
#: Constants without spread.
EXACT = ("life.precursor=25e-6", "life.rate=1e-7", "life.exponent=2.5", "life.threshold=1", "life.crystallisation=0")


def strip(*layers):
    patch = rectangle(160, 1, 0.5, 0.1)
    return Shell(ShellMesh.build(patch.nodes, patch.quads, THICKNESS, material_axis=(1.0, 0, 0)), Section(layers))


def rolled(shell, curvature):
    """Unknowns (n,) of a strip that is rolled to a cylinder."""
    phi = shell.mesh.nodes[:, 0] * curvature
    nodal = np.zeros((shell.mesh.node_count, 5))
    nodal[:, 0] = np.sin(phi) / curvature - shell.mesh.nodes[:, 0]
    nodal[:, 2] = (1 - np.cos(phi)) / curvature
    nodal[:, 3] = -phi
    return shell.dofs.restrict(nodal)


RUBBER = Layer(MooneyRivlin.neo_hookean(MODULUS, 1300.0), THICKNESS, name="NR")


def life_of(curvatures, *keys):
    """Life, hours, of a strip of rubber that is rolled to some curvatures once an hour."""
    shell = strip(RUBBER)
    return life_of_states(shell, [rolled(shell, k) for k in curvatures], *keys)


def life_of_states(shell, states, *keys):
    case = load_case(
        None,
        (
            "materials.NR.kind=neo-hookean",
            "materials.NR.shear_modulus=1e6",
            "materials.NR.density=1300",
            "materials.NR.loss_factor=NR",
            "layers.0.material=NR",
            *keys,
        ),
    )
    result = SimpleNamespace(case=case, mesh=SimpleNamespace(layer_titles=lambda: ("NR", "ply", "cloth")))
    return Life(result, Motion(shell, states, 1.0, "a test"))


def test_bent_strip_in_closed_form():
    """Rolled to 1/R its faces are strained by E = h/(2 R) across a width that stays: W = G/2 (l^2 + 1/l^2 - 2), l^2 = 1
    + 2 E, on the face that is stretched; the other one only slides.
    """
    curvature = 20.0
    found = life_of([1e-6, 0.5 * curvature, curvature], *EXACT).first
    square = 1 + THICKNESS * curvature
    energy = 0.5 * MODULUS * (square + 1 / square - 2)
    speed = 1e-7 * (SHAPE * FLAW * energy / UNIT) ** 2.5
    exact = FLAW / (1.5 * speed) * (1 - (FLAW / 2e-3) ** 1.5)
    # the nodes lie on the arc, the elements on its chords
    assert np.isclose(found.release, SHAPE * FLAW * energy, rtol=6e-3)
    assert np.isclose(found.hours, exact, rtol=0.015) and found.interval == [found.hours] * 2
    assert found.ratio < 1e-6 and found.face == "inner face"
    assert np.isclose(found.growing_cut[0], 1.0 / (SHAPE * energy), rtol=6e-3)


def test_life_halves_as_theory_says():
    """Energy goes with the square of a small amplitude, life with the power -F of that; about zero the face that is
    stretched changes, and a strip that is kept bent lasts as its range of energy says.
    """
    once, more, both, kept = (
        life_of(curvatures, *EXACT, "life.threshold=1e-3")
        for curvatures in ([1e-6, 1.0], [1e-6, 2 ** (1 / 5)], [-1.0, 1e-6, 1.0], [0.6, 1.0])
    )
    assert np.isclose(once.first.hours / more.first.hours, 2.0, rtol=5e-3)
    assert np.isclose(both.first.hours, once.first.hours, rtol=1e-2)
    assert np.isclose(kept.first.hours / once.first.hours, (1 - 0.36) ** -2.5, rtol=1e-2)


def test_the_way_back_is_that_of_the_way_there():
    """A strip that is bent, let go and bent again on its way back lives half as long as one that is bent once."""
    shell = strip(RUBBER)

    def hours(*curvatures):
        states = [SimpleNamespace(nodal=shell.dofs.expand(rolled(shell, k)), pressure=1e3) for k in curvatures]
        named = {"kind": "steady", "header": SimpleNamespace(name="strip"), "states": states}
        case = SimpleNamespace(units=SimpleNamespace(pressure=str))
        motion = motion_of(SimpleNamespace(**named, case=case, model=SimpleNamespace(shell=shell)), per_day=24.0)
        return life_of_states(shell, motion.states, *EXACT).first.hours

    def words(*pressures):
        states = [SimpleNamespace(nodal=shell.dofs.expand(rolled(shell, 1e-2 * p)), pressure=p) for p in pressures]
        header, case = SimpleNamespace(name="strip"), SimpleNamespace(units=SimpleNamespace(pressure=str))
        result = SimpleNamespace(kind="steady", header=header, states=states, case=case)
        motion = motion_of(SimpleNamespace(**vars(result), model=SimpleNamespace(shell=shell)), per_day=24.0)
        return motion.words, np.round(motion.states, 12).tolist()

    assert words(2e3, 1e3) == words(1e3, 2e3)  # as they rise, in whichever order they were asked for
    once = hours(20.0)
    assert hours(20.0, 1e-6) == pytest.approx(0.5 * once, rel=1e-6)
    assert hours(10.0, 20.0) == pytest.approx(once, rel=1e-9)


def test_interval_is_that_of_the_samples():
    """Ends are quantiles of the closed form over samples; a flaw below the threshold does not grow."""
    found = life_of([1e-6, 20.0], "life.threshold=1e-3").first
    drawn = CrackGrowth.draw(shipped_growth("NR") | {"precursor": (20e-6, 50e-6), "threshold": (1e-3,)})
    square = 1 + THICKNESS * 20.0
    speed = drawn.speed(SHAPE * drawn.precursor * 0.5 * MODULUS * (square + 1 / square - 2), 0.0)
    power = drawn.exponent - 1
    exact = drawn.precursor / (power * speed) * (1 - (drawn.precursor / 2e-3) ** power)
    assert np.allclose(found.interval, np.quantile(exact, [0.1, 0.9]), rtol=0.02)
    slow = life_of([1e-6, 1.0])
    assert np.isinf(slow.first.hours) and slow.first.without_growth == 1.0
    assert slow.lines()[0].startswith(
        "No crack grows to 2 mm. Nearest to it is NR, inner face: a cut grows there from "
    )


def test_interlaminar_shear_of_a_sheared_strip():
    """Parabola with the shear force k G gamma h: 3/2 of its mean in the middle of the wall."""
    layer = Layer(IsotropicElastic(3e6, 0.5 - 1e-9, 1.0), 0.005, shear_correction=5 / 6)
    shell = strip(layer, layer)
    nodal = np.zeros((shell.mesh.node_count, 5))
    nodal[:, 3] = 1e-4
    assert np.allclose(interlaminar_shear(shell, shell.dofs.restrict(nodal)), 1.5 * 5 / 6 * 1e6 * 1e-4, rtol=1e-3)


@pytest.mark.slow
def test_bonds_are_where_the_layers_meet():
    """A ply that ends half way, with a cloth outside it: each bond of the rubber lasts where it is not."""
    ply, patch = (
        Layer(IsotropicElastic(3e6, 0.5 - 1e-9, 1.0), 0.005, shear_correction=5 / 6),
        rectangle(16, 1, 0.5, 0.1),
    )
    mesh = ShellMesh.build(patch.nodes, patch.quads, 0.02, material_axis=(1.0, 0, 0))
    present = np.ones((16, 3), bool)
    present[8:, 1] = False
    shell = Shell(mesh, Section((RUBBER, ply, ply)), zones=Zones.of(present))
    nodal = np.zeros((shell.mesh.node_count, 5))
    nodal[:, 3] = 0.1
    found = life_of_states(shell, [np.zeros(shell.size), shell.dofs.restrict(nodal)], *EXACT, "life.threshold=1e-3")
    bonds = {part.name: np.isfinite(part.all_hours) for part in found.parts if len(part.layers) == 2}
    assert set(bonds) == {"NR to ply", "NR to cloth"}
    assert np.array_equal(bonds["NR to ply"], present[:, 1]) and np.array_equal(bonds["NR to cloth"], ~present[:, 1])


@pytest.fixture(scope="module")
def opened(tmp_path_factory):
    """Steady states of the small valve, in a file."""
    path = tmp_path_factory.mktemp("life") / "steady.h5"
    load_small().steady([2e3, 18e3], output=path)
    return path


def test_valve_that_opens_some_times_a_day(opened, command_line, tmp_path):
    """From rest to 18 kPa: every layer on its stretched face, twice as often lasts half as long."""
    keys = ("--set=life.precursor=1 mm", "--set=life.threshold=5")
    once, twice = (
        json.loads(command_line("life", opened, "--per-day", n, *keys, "--plots", tmp_path, "--json").out)
        for n in (10, 20)
    )
    assert np.isclose(once["hours"], 2 * twice["hours"]) and np.allclose(
        once["interval"], 2 * np.array(twice["interval"])
    )
    assert [part["name"] for part in once["parts"]] == ["CR", "SBR", "EPDM", "SBR to fibre +54°", "fibre -54° to EPDM"]
    assert all(part["ratio"] == 0 for part in once["parts"][:3])
    assert sorted(path.name for path in tmp_path.glob("*.png")) == ["crack-energy.png", "life.png"]
    told = command_line("life", opened, "--per-day", 10, *keys).out.splitlines()
    assert told[0].startswith("Hours to a crack of 2 mm: ") and "10 ways a day from rest to 18 kPa and back" in told[1]


def test_run_in_time(command_line, misused, tmp_path):
    """A part of a run without pause is the same as so often a day; full states too far apart are refused."""
    keys = {"transient.start": "rest", "transient.duration": 0.06, "transient.step": 1e-3, "drive.pressure": 6e3}
    keys["fluid.density"] = 60.0
    path, sparse = tmp_path / "run.h5", tmp_path / "sparse.h5"
    load_small(keys | {"transient.save_every": 2e-3}).transient(output=path)
    load_small(keys | {"transient.save_every": 0.02}).transient(output=sparse)
    cut = ("--since", 0.02, "--set=life.precursor=1 mm", "--set=life.threshold=1", "--json")
    lasting = json.loads(command_line("life", path, *cut).out)
    daily = json.loads(command_line("life", path, *cut, "--per-day", 86400 / 0.04).out)
    assert np.isclose(lasting["hours"], daily["hours"], rtol=1e-6) and "without pause" in lasting["motion"]
    assert 0 < lasting["ratio"] < 1 and lasting["interval"][0] < lasting["hours"] < lasting["interval"][1]
    for options, said in (
        (("--since", 0.01), "of the swings of the lip"),
        (("--since=-1",), "the run begins at 0 s"),
        (("--at", 5), "--at does not go with a result of kind 'transient', which takes --since and --per-day"),
    ):
        misused(said, "life", sparse, *options)


def test_a_cycle_of_the_flow_alone_gives_the_time():
    """The lip stands still: two periods of the flow, 4 ms each, at the end of the run."""
    flow = {"verdict": "limit cycle", "frequency": 250.0, "cycles_observed": 2}
    still = {"verdict": "steady", "frequency": None, "cycles_observed": 0}
    result = SimpleNamespace(
        kind="transient",
        require_steps=lambda: None,
        history={"time": np.linspace(0.0, 0.1, 101)},
        verdict={"verdict": "limit cycle", "lip_displacement": still, "mass_flow": flow},
        record=SimpleNamespace(column=lambda *_: np.array([0.05])),
        model=SimpleNamespace(shell=None),
    )
    with pytest.raises(CaseError, match="0 full states from 0.092 s on"):
        _run(result, None, None)
    result.verdict, result.judged_from = {"verdict": "chatters"}, 0.06  # behind a ramp
    with pytest.raises(CaseError, match="0 full states from 0.06 s on"):
        _run(result, None, None)


def test_results_without_a_motion_are_refused(opened, misused, tmp_path):
    path = tmp_path / "run.h5"
    load_small({"transient.duration": 0.02, "transient.step": 1e-3}).transient(output=path)
    for arguments, words in (
        ([opened], "--per-day N"),
        ([path], "--per-day N"),
        ([path, "--per-day", 5], "transient.save_every"),
        ([opened, "--per-day", 5, "--set=mesh.around=8"], "keys of [life]"),
        ([opened, "--per-day", 5, "--set=life.crack=1 um"], "life.crack"),
        ([opened, "--per-day", 5, "--since", 0], "which takes --per-day"),
    ):
        misused(words, "life", *arguments)
    result = load_small().steady([2e3])
    motion = motion_of(result, per_day=1.0)
    with pytest.raises(CaseError, match="does not move"):
        Life(result, Motion(motion.shell, [motion.states[-1]] * 3, 1.0, "a state"))
    with pytest.raises(CaseError, match="holds no motion"):
        motion_of(result.states[0].modes(count=1))


def test_rubber_of_unknown_growth_is_refused():
    with pytest.raises(CaseError, match="one of NR, SBR, CR, EPDM"):
        life_of(
            [1e-6, 1.0],
            "materials.gum.kind=neo-hookean",
            "materials.gum.shear_modulus=1e6",
            "materials.gum.density=1300",
            "materials.gum.loss_factor=NR",
            "layers.0.material=gum",
        )
