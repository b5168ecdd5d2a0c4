"""Strain levels that agree with the strains of the layers (Eq. 7.1)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dbvfiv
from dbvfiv.case import CaseError
from dbvfiv.case.write import case_toml
from dbvfiv.model.strain_level import tension_of
from dbvfiv.studies.case import load_case, thesis_case

COARSE = {"mesh.around": 8, "mesh.along": 14}
AUTO = COARSE | {"materials.strain_level": "auto"}


@given(st.floats(0.0, 3.0))
def test_strain_of_tension_is_found_from_its_invariant(strain):
    exact = strain**2 * (3 + strain) / (1 + strain)  # stretch^2 + 2/stretch - 3 without cancellation
    assert float(tension_of(np.array(exact))) == pytest.approx(strain, rel=1e-6, abs=1e-9)


@pytest.fixture(scope="module")
def found():
    return dbvfiv.load(thesis_case(), COARSE).levels(["18 kPa", "36 kPa"])


def test_levels_agree_with_the_strains_they_give(found):
    """On 8 x 14 elements: CR 13.3 % at 18 kPa and 17.9 % at 36 kPa; the thin outer rubbers stay below their tests."""
    rows = {(row["pressure"], row["material"]): row for row in found.rows}
    assert len(rows) == 6 and [row["layer"] for row in found.rows] == [1, 2, 5] * 2
    for pressure, level in ((18e3, 0.1334), (36e3, 0.1789)):
        row = rows[pressure, "CR"]
        assert row["level"] == pytest.approx(row["peak"], abs=1.1e-4)
        assert row["level"] == pytest.approx(level, abs=2e-3) and row["mean"] < row["peak"]
        for name in ("SBR", "EPDM"):
            assert rows[pressure, name]["level"] == 0.10 > rows[pressure, name]["peak"]
    given = dbvfiv.load(thesis_case(), COARSE).steady(pressure=36e3)
    assert rows[36e3, "CR"]["mass_flow"] > 1.03 * given.mass_flow


def test_auto_is_the_state_of_the_levels_found(found):
    state = dbvfiv.load(thesis_case(), AUTO).steady(pressure=36e3)
    row = next(row for row in found.rows if row["pressure"] == 36e3)
    assert state.mass_flow == pytest.approx(row["mass_flow"], rel=1e-4)
    case = state.results.case
    assert case.materials.card("CR").strain_level == pytest.approx(row["level"], abs=2e-4)
    assert not case.seeks_levels
    modes = dbvfiv.load(thesis_case(), AUTO | {"drive.pressure": 36e3}).modes(count=2, in_vacuo=True)
    again = state.modes(count=2, in_vacuo=True)
    for one, two in zip(modes.modes, again.modes):
        assert one.frequency == pytest.approx(two.frequency, rel=1e-3)


def test_auto_keeps_how_rubbers_relax(tmp_path):
    (tmp_path / "own.toml").write_text(
        "[materials]\nstrain_level = 'auto'\n[materials.CR]\nloss_factor = 0.12\n[damping]\nmodel = 'loss factor'\n"
    )
    case = load_case(tmp_path / "own.toml")
    assert case.seeks_levels
    for comments in (True, False):
        (tmp_path / "again.toml").write_text(case_toml(case, comments))
        assert load_case(tmp_path / "again.toml") == case
    resolved = case.replace(case.materials.at_levels({"CR": 0.2, "SBR": 0.15}))
    assert resolved.materials.card("CR").loss_factor == 0.12 and resolved.materials.card("CR").strain_level == 0.2
    assert resolved.materials.loss("SBR") is not None and resolved.seeks_levels  # EPDM is left


def test_what_has_no_levels_is_refused(one_sentence):
    silicone = {"kind": "neo-hookean", "shear_modulus": 1e6, "density": 1100}
    other = {"materials.A": silicone, "layers": [{"material": "A", "thickness": 0.01}]}
    with pytest.raises(CaseError, match="No layer is one of the built-in rubbers") as caught:
        dbvfiv.load(thesis_case(), COARSE | other).levels("6 kPa")
    assert one_sentence(str(caught.value))
    assert not thesis_case(other | {"materials.strain_level": "auto"}).seeks_levels
    with pytest.raises(CaseError, match="strain_level is 'auto', which needs a steady flow"):
        dbvfiv.load(thesis_case(), AUTO | {"drive.kind": "uniform"}).steady(pressure=1e3)
    for wrong in ("automatic", 0.05, "70 %", True):
        with pytest.raises(CaseError, match=r"strain_level is given as .*60 %, or \"auto\"|truth value"):
            thesis_case({"materials.strain_level": wrong})


def test_the_command_prints_and_keeps_levels(tmp_path, command_line):
    done = command_line(
        "levels", "--set", "mesh.around=6", "--set", "mesh.along=8", "-p", "6 kPa", "-o", tmp_path / "l.h5"
    )
    assert done.status == 0 and "rubber" in done.out and "EPDM" in done.out
    assert len(dbvfiv.load_result(tmp_path / "l.h5").rows) == 3
    assert command_line("info", tmp_path / "l.h5").status == 0
