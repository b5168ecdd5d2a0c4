"""Impossible settings are refused in sentences; settings cannot be changed later."""

import dataclasses

import pytest

from continuation import ContinuationOptions, NewtonOptions, OrbitOptions

BAD = [
    (NewtonOptions, {"tolerance": 0.0}),
    (NewtonOptions, {"max_iterations": 0}),
    (ContinuationOptions, {"step": 1.0, "max_step": 0.5}),
    (ContinuationOptions, {"min_step": 0.0}),
    (ContinuationOptions, {"max_points": 0}),
    (ContinuationOptions, {"direction": 0}),
    (ContinuationOptions, {"max_angle": 2.0}),
    (ContinuationOptions, {"state_scale": -1.0}),
    (ContinuationOptions, {"eigenvalues": -1}),
    (ContinuationOptions, {"parameter_scales": {"p": 0.0}}),
    (ContinuationOptions, {"limits": {"p": (1.0, 0.0)}}),
    (ContinuationOptions, {"location_tolerance": 0.0}),
    (OrbitOptions, {"harmonics": 0}),
    (OrbitOptions, {"harmonics": 20, "max_harmonics": 10}),
    (OrbitOptions, {"tail": 0.0}),
    (OrbitOptions, {"tolerance": 1.0}),
    (OrbitOptions, {"exponents": -1}),
]


@pytest.mark.parametrize(("kind", "values"), BAD)
def test_bad_values_are_refused_in_a_sentence(kind, values):
    with pytest.raises(ValueError) as error:
        kind(**values)
    text = str(error.value)
    assert text[0].isupper() and text.endswith(".")


@pytest.mark.parametrize("kind", [NewtonOptions, ContinuationOptions, OrbitOptions])
def test_frozen_and_documented_field_by_field(kind):
    options = kind()
    for field in dataclasses.fields(kind):
        assert field.name in kind.__doc__
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(options, field.name, None)
