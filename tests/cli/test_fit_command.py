"""``dbvfiv fit``: what it prints, draws and refuses, and that its table can be pasted."""

import json
from pathlib import Path

import numpy as np
import pytest

from dbvfiv.fit import uniaxial_stress
from dbvfiv.fit.cards import law_from_card
from dbvfiv.fit.curves import loading_tests, read_tests
from dbvfiv.fit.report import toml_table
from dbvfiv.fit.rubber import fit_rubber, form_of
from dbvfiv.materials.shipped import published_rubber, rubber
from dbvfiv.studies.case import load_case

TRELOAR = str(Path(__file__).parents[1] / "fit" / "treloar.csv")


def test_the_table_pasted_is_the_fit_from_the_case(command_line, tmp_path):
    options = ["--law", "mooney-rivlin", "--terms", "3", "--constraint", "stable", "--stable-to", "80 %"]
    outcome = command_line("fit", TRELOAR, *options, "--name", "NR", "--json", "--plots", tmp_path)
    document = json.loads(outcome.out)
    assert outcome.err == "" and (tmp_path / "fit.png").stat().st_size > 10_000
    case = tmp_path / "my.toml"
    case.write_text(
        document["toml"]
        + f"\n[materials.same]\nkind='fit'\npath='{TRELOAR}'\nlaw='mooney-rivlin'\nterms=3\nconstraint='stable'\n"
        "stable_to='80 %'\ndensity='1300 kg/m^3'\n"
    )
    named = load_case(case).materials.named
    pasted, fitted = law_from_card(named["NR"]), law_from_card(named["same"])
    np.testing.assert_allclose(pasted.parameters, fitted.parameters, rtol=1e-9)
    assert document["chosen"]["constants"]["c11"] == pytest.approx(pasted.c11, rel=1e-9)
    assert [f["law"] for f in document["fits"]][-1] == "ogden" and document["loss_factor"] is None


@pytest.mark.parametrize("name, constants", [("yeoh", {0: 0.183027e6, 3: -1.41845e3, 4: 39.3471}), ("ogden", {})])
def test_tables_of_other_laws_make_the_law_that_was_fitted(tmp_path, name, constants):
    fitted = fit_rubber(loading_tests(read_tests(TRELOAR)), form_of(name, 3))
    case = tmp_path / "my.toml"
    case.write_text("\n".join(toml_table(fitted, "rubber", 1300.0)))
    law = law_from_card(load_case(case).materials.named["rubber"])
    np.testing.assert_allclose(law.parameters, fitted.law(1300.0).parameters, rtol=1e-11)
    assert {i: law.parameters[i] for i in constants} == pytest.approx(constants, rel=1e-5)


def test_the_softening_rubber_is_told_where_no_law_is_named(command_line, tmp_path):
    tension = tmp_path / "tension.csv"
    stretch = np.linspace(1.005, 1.4, 40)
    stress = uniaxial_stress(published_rubber("EPDM", 0.4), stretch)
    rows = "".join(f"{s!r},{p!r}\n" for s, p in zip(stretch.tolist(), stress.tolist()))
    tension.write_text("stretch [-],nominal_stress [Pa]\n" + rows)
    outcome = command_line("fit", str(tension))
    assert outcome.status == 0 and "Tests: uniaxial 0.5% to 40.0% in 40 points" in outcome.out
    case = tmp_path / "my.toml"
    case.write_text(outcome.out[outcome.out.index("[materials.rubber]") :])
    law = law_from_card(load_case(case).materials.named["rubber"])
    shipped = rubber("EPDM", 0.4)
    np.testing.assert_allclose([law.mu_0, law.c], [shipped.mu_0, shipped.c], rtol=0.03)
    assert law.x_0 == pytest.approx(shipped.x_0, rel=0.05)
