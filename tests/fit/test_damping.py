"""Damping of the materials of a case: where it comes from, tables as instruments write them, Rayleigh's constants."""

from __future__ import annotations

import tomllib
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dbvfiv.case.damping import SHIPPED_LOSSES
from dbvfiv.case.parameters import Mu
from dbvfiv.errors import CaseError
from dbvfiv.fit import damping_of, relaxation_from_case
from dbvfiv.fit.cards import describe_damping, outside_band, rayleigh_constants, rayleigh_ratio, read_frequencies
from dbvfiv.materials.laws import MaterialError
from dbvfiv.materials.shipped import shipped_loss, shipped_loss_names
from dbvfiv.model.build import build_section
from dbvfiv.model.relaxing import WallRelaxation
from dbvfiv.studies.case import Case, thesis_case

LOSS = {"damping.model": "loss factor"}
FREQUENCY = np.geomspace(0.8, 250.0, 26)


def case_of(**keys) -> Case:
    return thesis_case(LOSS | {"materials.CR": keys})


def written(path, head: str, *columns, separator=", ") -> str:
    rows = [separator.join(f"{x:.12g}" for x in row) for row in zip(*columns)]
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return str(path)


# -- what ships


def test_shipped_loss_factors_are_middles_of_their_ranges():
    assert shipped_loss_names() and set(shipped_loss_names()) == set(SHIPPED_LOSSES)
    for name in SHIPPED_LOSSES:
        shipped = shipped_loss(name)
        low, high = shipped.range
        assert low < shipped.value < high and shipped.note and "compilations" in shipped.source
        if name != "fibre":
            assert shipped.value == pytest.approx((low + high) / 2)
    table = tomllib.loads(files("dbvfiv.materials").joinpath("loss_factors.toml").read_text("utf-8"))
    assert table["SBR"]["range"] == [0.10, 0.25]
    with pytest.raises(MaterialError, match="NR, SBR, CR.*'steel'|SBR, CR.*'steel'"):
        shipped_loss("steel")


@pytest.mark.parametrize("name", ["CR", "SBR", "EPDM", "fibre"])
def test_built_in_materials_take_the_shipped_values(name):
    found = damping_of(thesis_case(LOSS), name)
    at = np.geomspace(1, 200, 50)
    np.testing.assert_allclose(found.prony.loss_factor(at), shipped_loss(name).value, rtol=0.03)
    assert f"shipped for {name}" in found.source


def test_every_layer_relaxes_with_the_same_times_and_none_does_under_rayleigh_damping():
    relaxing = [layer.relaxation for layer in build_section(thesis_case(LOSS)).layers]
    assert {prony.times for prony in relaxing} == {relaxing[0].times} and len(relaxing[0].times) == 4
    assert {layer.relaxation for layer in build_section(thesis_case()).layers} == {None}
    assert relaxation_from_case(thesis_case(), "CR") is None


#: Load and flow model of the thesis's case.
AT_18_KPA = {"pressure": 18e3, "storage": 0.0}


def test_laws_and_conditions_of_rayleigh_cases_are_what_they_were():
    assert Mu.of(thesis_case()) == Mu(AT_18_KPA, density=1000.0, alpha=5.0, beta=0.003, loss_factor=0.0)
    assert Mu.of(thesis_case(LOSS)) == Mu(AT_18_KPA, density=1000.0, alpha=0.0, beta=0.0, loss_factor=1.0)
    assert Mu.of(thesis_case(LOSS | {"damping.loss_factor": 0.5, "damping.alpha": 2})) == Mu(
        AT_18_KPA, density=1000.0, alpha=2.0, beta=0.0, loss_factor=0.5
    )
    slow, relaxing = build_section(thesis_case()), build_section(thesis_case(LOSS))
    assert [layer.law for layer in slow.layers] == [layer.law for layer in relaxing.layers]
    assert np.array_equal(slow.parameters, relaxing.parameters)


# -- the ways to say it


def test_a_loss_factor_of_ones_own_or_by_name():
    assert damping_of(case_of(loss_factor=0.3), "CR").prony.loss_factor(40.0) == pytest.approx(0.3, rel=0.03)
    named, own = (damping_of(case_of(loss_factor=value), "CR") for value in ("NBR", shipped_loss("NBR").value))
    assert named.prony == own.prony and "NBR" in named.source and "given" in own.source
    assert relaxation_from_case(case_of(loss_factor=0), "CR").elastic


def test_a_table_of_a_built_in_material_leaves_its_constants_as_they_are():
    from dbvfiv.fit import law_from_case

    case = thesis_case({"materials.strain_level": 0.4, "materials.CR.loss_factor": 0.2})
    assert law_from_case(case, "CR") == law_from_case(thesis_case({"materials.strain_level": 0.4}), "CR")
    assert law_from_case(case.replace({"materials.fibre.loss_factor": 0.1}), "fibre") == law_from_case(
        thesis_case(), "fibre"
    )


def test_keys_of_a_table_can_be_changed_one_by_one():
    own = {"kind": "neo-hookean", "shear_modulus": 1e6, "density": 1200.0, "loss_factor": 0.1}
    case = thesis_case({"materials.CR": own}).replace({"materials.CR.loss_factor": 0.2})
    assert case.materials.card("CR").shear_modulus == 1e6 and case.materials.card("CR").loss_factor == 0.2


def test_a_series_is_taken_as_it_is():
    found = relaxation_from_case(case_of(prony=[[0.1, "10 ms"], [0.2, 0.5]]), "CR")
    assert found.strengths == (0.1, 0.2) and found.times == (0.01, 0.5)


def test_series_that_miss_are_told_and_those_that_say_nothing_refused(one_sentence, refused):
    """Two branches cannot damp that much over 2.3 decades; four do so roughly."""
    rough = damping_of(case_of(loss_factor=2), "CR")
    assert rough.fit.largest_error > 0.2 and one_sentence(rough.note) and "27%" in rough.note
    assert f"Note: {rough.note}" in describe_damping(case_of(loss_factor=2)).lines()
    assert damping_of(case_of(loss_factor=0.5), "CR").note is None
    with refused(CaseError, match="series of 2 branches misses it by 100% rms"):
        damping_of(case_of(loss_factor=2).replace({"damping.branches": 2}), "CR")


@pytest.mark.parametrize(
    "head, units, separator",
    [
        ("frequency [Hz], tan delta", 1.0, ", "),
        ("Frequency (kHz); Tan_Delta (-)", 1e-3, "; "),
        ("f [Hz]\tLoss Factor [%]", 1.0, "\t"),
        ("angular frequency [rad/s], tan delta", 2 * np.pi, ", "),
    ],
)
def test_tables_of_tan_delta(tmp_path, head, units, separator):
    tan_delta = 0.1 * FREQUENCY**0.1
    percent = 100.0 if "%" in head else 1.0
    file = written(tmp_path / "t.csv", head, units * FREQUENCY, percent * tan_delta, separator=separator)
    found = damping_of(case_of(loss_data=file), "CR")
    at = np.geomspace(1, 200, 40)
    np.testing.assert_allclose(found.prony.loss_factor(at), 0.1 * at**0.1, rtol=0.04)
    np.testing.assert_allclose(found.data[1], tan_delta, rtol=1e-9)
    assert found.fit.largest_error < 0.04 and "t.csv" in found.source


def test_decimal_commas_and_a_row_of_units(tmp_path):
    rows = [f"{f:.6f};{0.15:.3f}".replace(".", ",") for f in FREQUENCY]
    (tmp_path / "t.csv").write_text("\n".join(["Frequency;tan delta", "[Hz];[-]", *rows]))
    assert damping_of(case_of(loss_data=str(tmp_path / "t.csv")), "CR").fit.largest_error < 0.04


@pytest.mark.parametrize("storage, loss", [("storage modulus [MPa]", "loss modulus [kPa]"), ("E' [MPa]", "E'' [kPa]")])
def test_tables_of_moduli(tmp_path, storage, loss):
    made = damping_of(case_of(loss_factor=0.2), "CR").prony
    modulus = 3.0 * made.modulus(2j * np.pi * FREQUENCY)
    file = written(
        tmp_path / "m.csv", f"frequency [Hz], {storage}, {loss}", FREQUENCY, modulus.real, 1e3 * modulus.imag
    )
    found = damping_of(case_of(loss_data=file), "CR")
    at = np.geomspace(1, 200, 40)
    np.testing.assert_allclose(found.prony.loss_factor(at), made.loss_factor(at), rtol=5e-3)
    np.testing.assert_allclose(found.prony.modulus(1e9), made.modulus(1e9), rtol=0.05)


def test_relaxation_tables(tmp_path):
    made = damping_of(case_of(loss_factor=0.2), "CR").prony
    time = np.geomspace(1e-4, 20.0, 80)
    modulus = 2.0 * (1 + np.exp(-np.multiply.outer(time, 1 / np.array(made.times))) @ np.array(made.strengths))
    file = written(tmp_path / "r.csv", "time [ms], modulus [MPa]", 1e3 * time, modulus)
    found = damping_of(case_of(relaxation_data=file), "CR")
    np.testing.assert_allclose(found.prony.strengths, made.strengths, rtol=1e-6)
    assert found.fit.quantity == "relaxing modulus" and found.data is None


def test_one_of_several_temperatures(tmp_path):
    columns = [np.concatenate([FREQUENCY] * 2), np.repeat([0.1, 0.2], 26), np.repeat([20.2, 40.0], 26)]
    file = written(tmp_path / "t.csv", "frequency [Hz], tan delta, temperature [degC]", *columns)
    warm = damping_of(case_of(loss_data=file, loss_temperature="40 degC"), "CR")
    cool = damping_of(case_of(loss_data=file, loss_temperature=293.15), "CR")
    assert warm.prony.loss_factor(20.0) == pytest.approx(0.2, rel=0.03)
    assert cool.prony.loss_factor(20.0) == pytest.approx(0.1, rel=0.03)
    with pytest.raises(CaseError, match="several temperatures, 20.2 degC, 40 degC; loss_temperature"):
        damping_of(case_of(loss_data=file), "CR")
    with pytest.raises(CaseError, match="30 degC is asked for, but it holds 20.2 degC, 40 degC alone"):
        damping_of(case_of(loss_data=file, loss_temperature="30 degC"), "CR")


def test_a_temperature_that_creeps_is_not_one(tmp_path):
    creeping = 20.0 + 0.9 * np.arange(len(FREQUENCY))
    head = "frequency [Hz], tan delta, temperature [degC]"
    file = written(tmp_path / "t.csv", head, FREQUENCY, np.full(len(FREQUENCY), 0.1), creeping)
    with pytest.raises(CaseError, match="several temperatures, 20.9 degC, 23.6 degC.*; loss_temperature"):
        damping_of(case_of(loss_data=file), "CR")
    file = written(tmp_path / "t.csv", head, FREQUENCY, np.full(len(FREQUENCY), 0.1), 20.0 + 0.9 * np.sin(FREQUENCY))
    assert damping_of(case_of(loss_data=file), "CR").prony.loss_factor(20.0) == pytest.approx(0.1, rel=0.03)


# -- tables that are refused

F = "0.5, 0.1\n5, 0.1\n50, 0.1\n500, 0.1\n"
BAD_TABLES = {
    "frequency backwards": ("frequency [Hz], tan delta\n1, 0.1\n10, 0.1\n5, 0.1\n", "5 Hz follows 10 Hz"),
    "nothing": ("", "holds no numbers"),
    "header alone": ("frequency [Hz], tan delta\n", "holds no numbers"),
    "no unit": ("frequency, tan delta\n" + F, "no unit is given; write frequency .UNIT. with one of Hz, mHz, kHz"),
    "unit of another kind": ("frequency [s], tan delta\n" + F, "'s' is not known"),
    "angular frequency in Hz": ("omega [Hz], tan delta\n" + F, "angular frequency is in rad/s"),
    "modulus in mm": ("frequency [Hz], E' [mm], E'' [MPa]\n1, 2, 3\n2, 3, 4\n", "'mm' is not known"),
    "no frequency": ("time [s], tan delta\n" + F, "no column frequency"),
    "no tan delta": ("frequency [Hz], storage modulus [MPa]\n" + F, "tan delta, or columns storage modulus"),
    "a column twice": ("frequency [Hz], tan delta, loss factor\n1, 0.1, 0.1\n2, 0.1, 0.1\n", "tan delta appears twice"),
    "a cell of text": ("frequency [Hz], tan delta\n0.5, 0.1\n5, high\n50, 0.1\n", "line 3 holds 'high'"),
    "a temperature without a unit": (
        "frequency [Hz], tan delta, temperature\n0.5, 0.1, 20\n500, 0.1, 20\n",
        "no unit of temperature",
    ),
    "narrower than the band": ("frequency [Hz], tan delta\n2, 0.1\n20, 0.1\n90, 0.1\n", "damping.band.*2 to 90 Hz"),
}


@pytest.mark.parametrize("text, words", BAD_TABLES.values(), ids=BAD_TABLES.keys())
def test_a_bad_table_is_refused_in_a_sentence(tmp_path, text, words, refused):
    (tmp_path / "t.csv").write_text(text)
    with refused(CaseError, match=words) as caught:
        relaxation_from_case(case_of(loss_data=str(tmp_path / "t.csv")), "CR")
    assert str(caught.value).startswith("materials.CR.loss_data cannot be used: ") and "t.csv" in str(caught.value)


CELL = st.one_of(
    st.floats(allow_nan=True), st.floats(0.01, 300.0), st.sampled_from(["", "high", "-", "0,1", "1e400", "'", '"'])
)
TITLE = st.sampled_from(
    ["frequency [Hz]", "f [kHz]", "omega [rad/s]", "tan delta", "eta [%]", "E' [MPa]", "E'' [Pa]", "x"]
)


@pytest.mark.slow
@settings(max_examples=20)
@given(
    titles=st.lists(TITLE | st.text(max_size=8), max_size=4),
    rows=st.lists(st.lists(CELL, max_size=4), max_size=8),
    separator=st.sampled_from([",", ";", "\t", " "]),
)
def test_random_tables_are_read_or_refused_in_a_sentence(tmp_path, one_sentence, titles, rows, separator):
    lines = [separator.join(str(cell) for cell in row) for row in [titles, *rows]]
    (tmp_path / "t.csv").write_text("\n".join(lines), encoding="utf-8", errors="surrogatepass")
    for key in ("loss_data", "relaxation_data"):
        try:
            found = relaxation_from_case(case_of(**{key: str(tmp_path / "t.csv")}), "CR")
        except CaseError as error:
            assert one_sentence(str(error)), str(error)
        else:
            assert min(found.strengths) >= 0


@settings(max_examples=25)
@given(
    values=st.lists(st.floats(0.011, 1.9), min_size=2, max_size=12),
    inner=st.lists(st.floats(1.1, 199.0), min_size=12, max_size=12, unique_by=lambda f: round(f, 6)),
)
def test_random_tables_that_cover_the_band_give_series(tmp_path, values, inner):
    frequency = [0.9, *sorted(inner)[: len(values) - 2], 201.0]
    file = written(tmp_path / "t.csv", "frequency [Hz], tan delta", frequency, values)
    try:
        found = damping_of(case_of(loss_data=file), "CR")
    except CaseError as error:
        assert "branches misses it by" in str(error)
        return
    assert min(found.prony.strengths) >= 0 and np.isfinite(found.fit.error).all()
    assert (found.prony.loss_factor(np.geomspace(1e-3, 1e5, 60)) >= 0).all()


@pytest.mark.parametrize(
    "text, words",
    [
        ("time [Hz], modulus [Pa]\n1, 3\n2, 2\n", "no unit of time"),
        ("time [s], modulus [Pa]\n1, 3\n2, -2\n", "must be greater than 0"),
        ("time [s], modulus [Pa]\n2, 3\n1, 2\n", "1 s follows 2 s"),
        ("time [s], modulus [Pa]\n1, 3\n2, 2\n4, 1.5\n", "damping.band"),
        ("frequency [Hz], modulus [Pa]\n1, 3\n2, 2\n", "no column time"),
    ],
)
def test_a_bad_relaxation_table_is_refused_in_a_sentence(tmp_path, text, words, refused):
    (tmp_path / "r.csv").write_text(text)
    with refused(CaseError, match=words):
        relaxation_from_case(case_of(relaxation_data=str(tmp_path / "r.csv")), "CR")


def test_files_that_are_gone_are_told(tmp_path, refused):
    gone = thesis_case().from_dict(case_of(loss_data=str(tmp_path / "gone.csv")).to_dict())
    with refused(CaseError, match="gone.csv cannot be read"):
        relaxation_from_case(gone, "CR")
    with pytest.raises(CaseError, match="'teflon' is no material"):
        relaxation_from_case(case_of(loss_factor=0.1), "teflon")


# -- Rayleigh's constants


def test_table_5_1_of_the_thesis():
    """Its alpha is reproduced; its beta, 0.002 and 0.02, is 0.00145 and 0.0145 by its own Eq. 5.5."""
    for ratio, alpha, beta, printed in ((0.05, 0.57, 0.00145, 0.002), (0.5, 5.7, 0.0145, 0.02)):
        found = rayleigh_constants((ratio, ratio), (1.0, 10.0))
        assert found[0] == pytest.approx(alpha, rel=3e-3) and found[1] == pytest.approx(beta, rel=3e-3)
        assert printed / found[1] == pytest.approx(1.38, rel=0.01)
        np.testing.assert_allclose(rayleigh_ratio([1.0, 10.0], *found), ratio, rtol=1e-12)


def test_any_two_ratios_are_met():
    found = rayleigh_constants((0.1, 0.3), (5.0, 40.0))
    np.testing.assert_allclose(rayleigh_ratio([5.0, 40.0], *found), (0.1, 0.3), rtol=1e-12)
    assert rayleigh_ratio(41.0, 0.0, 0.003) == pytest.approx(0.386, abs=1e-3)
    for bad in ((5.0, 5.0), (0.0, 5.0), (5.0, np.inf)):
        with pytest.raises(MaterialError, match="two different frequencies"):
            rayleigh_constants((0.1, 0.1), bad)


# -- the report


def test_the_report_halves_the_loss_factor_and_counts_the_factor_on_all():
    report = describe_damping(case_of(loss_factor=0.2).replace({"damping.loss_factor": 0.5}))
    assert [m.name for m in report.materials] == ["CR", "SBR", "fibre", "EPDM"]
    assert report.material_ratio(report.materials[0], 20.0) == pytest.approx(0.05, rel=0.03)
    summary = report.summary((5.0, 40.0))
    match = summary["matches"][0]
    np.testing.assert_allclose(rayleigh_ratio([5.0, 40.0], match["alpha"], match["beta"]), match["ratios"], rtol=1e-12)
    assert summary["frequencies"][0] == 1.0 and summary["frequencies"][-1] == 200.0 and 20.0 in summary["frequencies"]


def test_a_factor_that_a_material_does_not_reach_is_refused_and_a_fair_one_is_told(refused):
    case = case_of(loss_factor=0.35).replace({"damping.loss_factor": 5.0})
    first = describe_damping(case).materials[0]
    assert first.missed == pytest.approx(0.34, abs=0.02) and first.fit.largest_error < 0.05
    assert "CR: with damping.loss_factor the series misses tan delta by up to" in first.note
    with refused(CaseError, match="materials.CR cannot be used: The loss factor .* 8 times its own, up to 2.8") as told:
        describe_damping(case.replace({"damping.loss_factor": 8.0}))
    assert told.value.key == "damping.loss_factor"
    wall = WallRelaxation.of(build_section(case))
    assert wall.highest(5.0, 10.0) == pytest.approx(5.9, abs=0.6) and wall.highest(1.0, 3.0) == 3.0


def test_under_rayleigh_damping_a_material_may_say_nothing():
    layers = [{"material": "A", "thickness": 0.01}]
    own = {"kind": "neo-hookean", "shear_modulus": 1e6, "density": 1000}
    case = thesis_case({"materials.A": own, "layers": layers})
    report = describe_damping(case)
    assert report.materials == () and "alpha = 5 1/s" in report.lines()[0]
    assert report.rayleigh(41.0) == pytest.approx(rayleigh_ratio(41.0, 5.0, 0.003))


def test_frequencies_outside_the_band_are_told(one_sentence):
    case = thesis_case(LOSS)
    assert outside_band(case, [1.0, 40.0, 200.0, 0.0, np.nan]) is None
    assert outside_band(thesis_case(), [0.1]) is None
    told = outside_band(case, [0.5, 40.0])
    assert told.startswith("0.5 Hz lies outside damping.band, 1 to 200 Hz") and one_sentence(told)
    assert outside_band(case, [0.1, 0.2, 0.3, 250, 10]).startswith("4 of 5 frequencies, between 0.1 and 250 Hz")
    layers = [{"material": "CR", "thickness": 0.01}]
    assert outside_band(case_of(prony=[[0.1, 0.01]]).replace({"layers": layers}), [0.5]) is None


@pytest.mark.parametrize("given", ["5", "5,5", "5,x", "5,40,50", "-1,5", "5 s,40 s", "5,inf", ""])
def test_two_frequencies_are_asked_for(given, refused):
    with refused(CaseError, match="--at is given as"):
        read_frequencies(given)


def test_frequencies_with_units():
    assert read_frequencies("40 Hz, 0.005 kHz") == (5.0, 40.0)
