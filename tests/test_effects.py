"""Keys that mend warnings: a case that warns, the key that the warning names set, and the warning is gone."""

from tempfile import NamedTemporaryFile

import pytest

from dbvfiv.effects import EFFECTS, explained
from dbvfiv.errors import CaseError
from dbvfiv.fit import outside_band
from dbvfiv.model import ValveModel
from dbvfiv.model.closed import ClosedValve
from dbvfiv.model.equilibria import model_warnings
from dbvfiv.studies.case import load_case, oddities
from dbvfiv.studies.response.study import left_out
from dbvfiv.studies.session import Session
from tests.small_valves import SMALL


def of_model(case):
    return model_warnings(ValveModel(case))


def of_spectrum(case):
    """Share left out of root mean squares, of a power that falls by half up to 50 Hz and to nothing at 60 Hz."""
    with NamedTemporaryFile("w", suffix=".csv") as file:
        file.write("10, 4\n50, 2\n60, 0\n")
        file.flush()
        return left_out(case.replace({"response.spectrum": file.name}))


def test_noise_without_power_within_the_frequencies_is_refused():
    for most, count in (("9 Hz", 16), ("100 kHz", 16)):
        with pytest.raises(CaseError, match="has no power between"):
            of_spectrum(load_case(None, [f"response.max_frequency={most}", f"response.count={count}"]))


def of_closed(case):
    return ClosedValve(case).start_warnings()


def of_study(kind):
    return lambda case: Session(case).perform(kind).warnings


def beyond_settled(case):
    """Steady states of a session whose strain levels were settled at lower pressures."""
    return Session(case).replace({"steady.pressures": [50e3]}).perform("steady").warnings


#: Words of a warning -> where it is found, keys that bring it on, and the value of the key that mends it.
MENDED = {
    "exceeds the radius of the mid-surface": (of_model, ["valve.lip_radius=6.19 mm"], "20 mm"),
    "too few for a row on every step": (
        of_model,
        ['valve.patches=[{end="60 mm", extra="1 mm"}, {end="75 mm", extra="1 mm"}, {end="90 mm", extra="1 mm"}]'],
        "48",
    ),
    "too few for a column on every edge": (
        of_model,
        ['valve.patches=[{end="100 mm", around_from=0.83, extra="1 mm"}]', "mesh.around=4"],
        "12",
    ),
    "inner face starts beyond the closing plane": (of_closed, ["valve.lip_radius=5 mm"], "20 mm"),
    "outside damping.band": (lambda case: filter(None, [outside_band(case, [0.1])]), [], '["0.05 Hz", "50 Hz"]'),
    "constants are unstable": (
        of_study("steady"),
        ["materials.constants=published", "materials.strain_level=10 %", "drive.pressure=36 kPa"],
        "stable",
    ),
    "settled at the largest pressures": (beyond_settled, ["drive.pressure=1 kPa"], "30 %"),
    "growth rates do not order the modes": (
        of_study("sweep"),
        ["materials.strain_level=10 %", "sweep.over=density=900:1000:2"],
        "40 Hz",
    ),
    "Gravity has no part": (
        of_study("closure"),
        ["gravity.direction=-z", "materials.strain_level=10 %", "closure.pressures=[100]"],
        "none",
    ),
    "lie beyond it": (
        of_study("closure"),
        ["valve.thickness_factor=0.25", "materials.strain_level=20 %", "closure.arclength=false"]
        + ["closure.rated_pressure=1 kPa"],
        "400 Pa",
    ),
    "half the diameter is its radius": (oddities, ["valve.flange_radius=12 in"], "139 mm"),
    "more than any that is sold": (oddities, ["valve.scale=12"], "1"),
    "says in which pipe the valve stands": (
        oddities,
        ["downstream.pipe_diameter=330 mm", "outside.fluid=same"],
        "330 mm",
    ),
    "it is half the width of the bill": (oddities, ["valve.lip_half_width=250 mm"], "125 mm"),
    "the thicknesses of valve.wall_map": (oddities, ["valve.wall_thickness=5 mm"], "uniform"),
    "before a valve of": (oddities, ["upstream.length=3 m", "upstream.diameter=45 mm"], "300 mm"),
    "and its jet of": (oddities, ["fluid.density=1"], "343 m/s"),
    "a gas, of which": (oddities, ["fluid.density=1", "drive.pressure=1 m"], "1 mH2O"),
    "is above transient.local_error": (
        of_study("transient"),
        ["transient.adaptive=true", "transient.duration=4 ms", "transient.step=1 ms", "transient.smallest_step=1"],
        "0.001",
    ),
    "held shut by its supports": (of_closed, ["closure.supports=held-lips"], "contact"),
    "of its power below": (of_spectrum, ["response.max_frequency=20 kHz", "response.count=16"], "400"),
    "of its power above": (of_spectrum, ["response.max_frequency=40 Hz"], "60 Hz"),
    "asks for all symmetry classes": (of_closed, ["closure.supports=held-lips", "closure.symmetry=all"], "SS"),
}


def test_every_key_that_mends_is_tested():
    assert set(MENDED) == {words for words, (_, key) in EFFECTS.items() if key != "-"}


@pytest.mark.parametrize("words", MENDED)
def test_the_key_that_is_named_removes_the_warning(words):
    warnings_of, keys, value = MENDED[words]
    case = load_case(None, [*(f"{key}={n}" for key, n in SMALL.items()), *keys])
    said = [warning for warning in warnings_of(case) if words in warning]
    assert said
    key = explained(said[0])[1]
    mended = load_case(None, [*(f"{key}={n}" for key, n in SMALL.items()), *keys, f"{key}={value}"])
    assert not [warning for warning in warnings_of(mended) if words in warning]
