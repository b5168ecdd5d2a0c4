"""Public face: documented names, short texts of all objects."""

import numpy as np
import pytest

import continuation
from continuation import (
    ContinuationOptions,
    Event,
    NotConverged,
    Observer,
    OrbitOptions,
    Reason,
    continue_branch,
    equilibrium,
    hopf_normal_form,
    orbit_at,
    orbits_from_hopf,
)
from tests.continuation.known import bautin, cusp


def test_public_functions_have_arguments_and_an_example():
    for name in continuation.__all__:
        text = getattr(continuation, name).__doc__
        assert text, name
        if name.islower():
            assert ">>>" in text or name in ("orbit_at", "special_orbit"), name


def test_texts_of_objects_are_short_and_say_how_they_ended():
    system, limits = bautin(), {"mu": (-1.0, 0.3)}
    options = ContinuationOptions(eigenvalues=2, limits=limits)
    branch = continue_branch(system, [0, 0], {"mu": -0.5, "nu": 1.0}, "mu", options)
    (hopf,) = branch.special
    orbits = orbits_from_hopf(system, hopf, "mu", ContinuationOptions(limits=limits, max_points=3))
    form = hopf_normal_form(system, hopf.u, hopf.mu, hopf.values["omega"], hopf.vectors["right"], "mu")
    with pytest.raises(NotConverged) as error:
        equilibrium(cusp(), np.array([5.0]), {"a": np.nan, "b": 1.0})
    spectrum = system.spectrum(hopf.u, hopf.mu, 2)
    shown = [system, branch, hopf, branch.points[0], orbits, orbit_at(system, orbits, 0), form, spectrum, options]
    shown += [OrbitOptions(), Event("zero", min), Observer(), system.linear(hopf.u, hopf.mu), error.value.result]
    for one in shown:
        text = repr(one)
        assert len(text.splitlines()) <= 10 and len(text) < 1200 and "array(" not in text, text
    assert "ended on the limit mu = 0.3" in repr(branch) and "located" in repr(hopf)
    assert Reason.NOT_FINITE.value in repr(error.value.result) and "used up its points" in repr(orbits)
