"""The section [damping] and the keys by which a material relaxes."""

from __future__ import annotations

from dbvfiv.studies.case import Case, load_case

LOSS, RAYLEIGH = {"damping.model": "loss factor"}, {"damping.model": "rayleigh"}


def test_numbers_that_are_not_given_follow_from_the_model():
    damping = Case().damping
    assert (damping.model, damping.alpha, damping.beta, damping.loss_factor) == ("loss factor", 0.0, 0.0, 1.0)
    assert (damping.band, damping.branches) == ((1.0, 200.0), 4)
    damping = Case().replace(RAYLEIGH).damping
    assert (damping.alpha, damping.beta, damping.loss_factor) == (5.0, 0.003, 0.0)
    assert Case().replace(RAYLEIGH).replace(LOSS) == Case()
    assert Case().replace({"damping.band": ["0.1 Hz", "1 kHz"]}).damping.branches == 6


def test_what_is_given_stays():
    damping = Case().replace(LOSS | {"damping.alpha": 3, "damping.loss_factor": "1/2", "damping.branches": 6}).damping
    assert (damping.alpha, damping.loss_factor, damping.branches) == (3.0, 0.5, 6)
    assert Case().replace(LOSS | {"damping.beta": 0, "damping.loss_factor": 0}).damping.loss_factor == 0.0


def test_cases_of_earlier_versions_are_read():
    data = Case().to_dict() | {"damping": {"alpha": 5.0, "beta": 0.003}}
    assert Case.from_dict(data).damping.model == "rayleigh"


A = "[materials.A]\nkind='neo-hookean'\nshear_modulus=1e6\ndensity=1000\n"
ON = "[damping]\nmodel='loss factor'\n"


def test_materials_that_no_layer_uses_need_say_nothing(tmp_path):
    (tmp_path / "good.toml").write_text(ON + A)
    assert load_case(tmp_path / "good.toml").damping.relaxes


def test_parameters_that_the_model_lacks():
    rayleigh = Case().replace(RAYLEIGH)
    assert rayleigh.damping.lacks("beta") is None and Case().damping.lacks("loss_factor") is None
    assert "damping.model = 'rayleigh'" in rayleigh.damping.lacks("loss_factor")
    assert "damping.model = 'loss factor'" in Case().damping.lacks("beta")
