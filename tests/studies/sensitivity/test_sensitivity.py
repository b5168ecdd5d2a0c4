"""The study sensitivity: command, file, Python, figure."""

import json

import numpy as np
import pytest

import dbvfiv
from dbvfiv.errors import CaseError, NotValidError
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.stability.walk import StabilityWalk
from tests.observers import Stop
from tests.small_valves import load_small, settings

CHANGES = {"mesh.around": 8, "mesh.along": 14, "damping.alpha": 0, "fluid.density": 10, "drive.pressure": 6e3}
NAMES = ["pressure", "beta", "layer 3 angle", "alpha", "damping.alpha"]


@pytest.fixture(scope="module")
def valve():
    return dbvfiv.load(thesis_case(), CHANGES)


@pytest.fixture(scope="module")
def found(valve, tmp_path_factory):
    return valve.sensitivity(NAMES, output=tmp_path_factory.mktemp("sensitivity") / "s.h5")


@pytest.mark.slow
def test_the_eigenvalue_is_that_of_modes_and_changes_as_said(valve, found):
    modes = valve.modes(count=2).modes
    assert found.growth_rate == pytest.approx(modes[0].growth_rate, rel=1e-7)
    assert found.frequency == pytest.approx(modes[0].frequency, rel=1e-7)
    (first, *_) = found.sensitivities
    near = valve.modes(6e3 * 1.001, count=1).modes[0], valve.modes(6e3 * 0.999, count=1).modes[0]
    assert [s.parameter for s in found.sensitivities] == NAMES
    assert first.growth_rate == pytest.approx((near[0].growth_rate - near[1].growth_rate) / 12.0, rel=1e-4)
    assert first.frequency == pytest.approx((near[0].frequency - near[1].frequency) / 12.0, rel=1e-4)


def test_a_key_at_its_end_has_the_derivatives_of_its_parameter(found):
    """The mass damping is 0, and nothing below."""
    by_name, by_key = found.sensitivities[3:]
    assert by_key.value == 0 and by_key.derivative == pytest.approx(by_name.derivative, rel=1e-5)


def test_a_flow_that_is_not_there_changes_by_no_per_cent():
    keys = {"mesh.around": 6, "mesh.along": 8, "drive.kind": "uniform", "drive.pressure": 100.0}
    found = dbvfiv.load(thesis_case(), keys).sensitivity(["pressure"])
    shares = found.summary()["sensitivities"][0]["per_cent_per_cent"]
    assert shares["flow"] is None and shares["opening"] > 0 and found.lines()[-1].count(" - ") >= 1


def test_the_density_sets_a_flow_without_inertia():
    found = load_small({"fluid.unsteady": False, "drive.pressure": 6e3}).sensitivity(["density"])
    assert found.summary()["sensitivities"][0]["per_cent_per_cent"]["flow"] == pytest.approx(-0.5, rel=1e-6)


def test_another_mode_and_a_state(valve, found):
    second = valve.sensitivity("density", mode=2)
    assert second.number == 2 and second.growth_rate < found.growth_rate
    state = valve.steady(pressure=6e3)
    again = state.sensitivity("pressure")
    assert again.sensitivities[0].derivative == pytest.approx(found.sensitivities[0].derivative, rel=1e-6)


def test_the_file_says_the_same_and_draws(found, tmp_path):
    stored = dbvfiv.load_result(found.path)
    assert stored.complete and stored.summary() == found.summary() and stored.lines() == found.lines()
    assert stored.sensitivities == found.sensitivities
    (drawn,) = stored.figures().values()
    named = [label.get_text() for label in drawn.axes[0].get_yticklabels()]
    largest = sorted(found.sensitivities, key=lambda s: -abs(s.relative))
    assert named == [s.parameter for s in largest if s.value] and "alpha" not in named  # of nothing there is no percent
    widths = [bar.get_width() for bar in drawn.axes[0].patches]
    assert widths == pytest.approx([s.growth_rate * s.value / 100 for s in largest if s.value])


def test_an_interrupted_run_goes_on_with_the_same_digits(valve, found, tmp_path):
    path = tmp_path / "s.h5"
    part = valve.sensitivity(NAMES, output=path, observer=Stop(2))
    assert not part.complete and len(dbvfiv.load_result(path).sensitivities) == 2
    assert dbvfiv.resume(path).sensitivities == found.sensitivities


def test_command(command_line, found):
    given = {key: value for key, value in CHANGES.items() if key[:5] not in ("drive", "fluid")}
    options = settings(given)
    asked = [word for name in NAMES for word in ("--of", name)]
    outcome = command_line("sensitivity", *options, "-p", "6 kPa", "--density", 10, *asked, "--json")
    assert outcome.status == 0, outcome.err
    document = json.loads(outcome.out)
    assert document["mode"]["growth_rate"] == found.growth_rate and document["mode"]["symmetry"] == "SS"
    assert "mode 1 of class SS alone (both lips open and close)" in found.lines()[0]
    rows = {row["parameter"]: row for row in document["sensitivities"]}
    assert set(rows) == set(NAMES) and rows["layer 3 angle"]["unit"] == "deg"
    assert rows["beta"]["growth_rate_per_percent"] == pytest.approx(0.003 / 100 * rows["beta"]["growth_rate"])


def test_misuse(valve, monkeypatch):
    with pytest.raises(CaseError, match="layer 9 angle"):
        valve.sensitivity("layer 9 angle")
    assert np.isfinite(valve.sensitivity(["storage"]).sensitivities[0].derivative)
    monkeypatch.setattr(StabilityWalk, "refusal", lambda self, place: "The constants of CR are unstable.")
    with pytest.raises(NotValidError, match="unstable"):
        valve.sensitivity("pressure")
