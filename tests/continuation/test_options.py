"""Impossible settings and arguments of the wrong kind are refused in sentences; settings cannot be changed later."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from continuation import (
    Branch,
    Checkpoint,
    ContinuationOptions,
    Event,
    JaxSystem,
    NewtonOptions,
    OrbitOptions,
    continue_branch,
    continue_fold,
    continue_hopf,
    continue_orbits,
    equilibrium,
    find_orbit,
    orbit_at,
    orbits_from_hopf,
    resume,
    switch_branch,
)
from tests.continuation.known import brusselator

BAD = [
    (NewtonOptions, {"tolerance": 0.0}),
    (NewtonOptions, {"tolerance": "1e-8"}),
    (NewtonOptions, {"max_iterations": 0}),
    (ContinuationOptions, {"step": 1.0, "max_step": 0.5}),
    (ContinuationOptions, {"step": "0.1"}),
    (ContinuationOptions, {"min_step": 0.0}),
    (ContinuationOptions, {"max_points": 0}),
    (ContinuationOptions, {"max_points": 10.5}),
    (ContinuationOptions, {"direction": 0}),
    (ContinuationOptions, {"max_angle": 2.0}),
    (ContinuationOptions, {"state_scale": -1.0}),
    (ContinuationOptions, {"state_scale": np.nan}),
    (ContinuationOptions, {"eigenvalues": -1}),
    (ContinuationOptions, {"eigenvalues": "all"}),
    (ContinuationOptions, {"parameter_scales": {"p": 0.0}}),
    (ContinuationOptions, {"parameter_scales": {"p": "1"}}),
    (ContinuationOptions, {"limits": {"p": (1.0, 0.0)}}),
    (ContinuationOptions, {"limits": {"p": (0.0, np.nan)}}),
    (ContinuationOptions, {"limits": {"p": 3.0}}),
    (ContinuationOptions, {"limits": {"p": ("0", "1")}}),
    (ContinuationOptions, {"limits": [(0.0, 1.0)]}),
    (ContinuationOptions, {"newton": 1e-8}),
    (ContinuationOptions, {"location_tolerance": 0.0}),
    (OrbitOptions, {"harmonics": 0}),
    (OrbitOptions, {"harmonics": 8.5}),
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


SYSTEM, MU, START = brusselator(), {"A": 1.0, "B": 1.0}, [1.0, 1.0]
OPTIONS = ContinuationOptions(eigenvalues=2, limits={"B": (0.5, 3.0)})
RING = np.stack([1 + np.cos(np.arange(20) * np.pi / 10), 2 + np.sin(np.arange(20) * np.pi / 10)], axis=1)


@pytest.fixture(scope="module")
def branch():
    return continue_branch(SYSTEM, START, MU, "B", dataclasses.replace(OPTIONS, stop_at="hopf"))


def started(system=SYSTEM, u=START, mu=MU, parameter="B", options=OPTIONS, **others):
    return lambda branch: continue_branch(system, u, mu, parameter, options, **others)


def made_of(residual, **others):
    return lambda branch: equilibrium(JaxSystem(residual, 2, **others), START, MU)


WRONG = [
    (started(options=0.1), "given as ContinuationOptions"),
    (started(options={"step": 0.1}), "given as ContinuationOptions"),
    (started(options=OrbitOptions()), "given as ContinuationOptions"),
    (started(options=ContinuationOptions(limits={"C": (0, 1)})), "'C' is not one of: A, B"),
    (started(options=ContinuationOptions(limits={"B": (2, 3)})), "start B = 1 is outside its limits 2 to 3"),
    (started(options=ContinuationOptions(stop_at="hopff")), "cannot stop at 'hopff'"),
    (started(options=ContinuationOptions(stop_at="hopf")), "cannot stop at 'hopf'; it looks for: branch point, fold"),
    (started(events=Event("fold", lambda u, mu: u[0])), "a name of its own, not 'fold'"),
    (
        lambda branch: orbits_from_hopf(SYSTEM, branch.special[0], "B", ContinuationOptions(stop_at="fold")),
        "cannot stop at 'fold'",
    ),
    (started(mu={"A": "one", "B": 1.0}), "'A' must be a number, not 'one'"),
    (started(mu={"A": np.nan, "B": 1.0}), "residual is not finite"),
    (started(mu=[1.0, 1.0]), "given by name"),
    (started(parameter=0), "0 is not one of: A, B"),
    (started(u=[1.0, np.nan]), "residual is not finite"),
    (started(u="ab"), "must hold real numbers, not 'ab'"),
    (started(u=[1.0 + 1j, 1.0]), "not complex"),
    (started(u=[START]), r"shape \(1, 2\); the system needs \(2,\)"),
    (started(system=brusselator), "first argument is a System"),
    (started(events=lambda u, mu: u[0]), "given as Event"),
    (started(observers=3), "not 3"),
    (started(spectrum=3), "not 3"),
    (made_of(lambda u, mu: u[:1]), r"residual has shape \(1,\); the state has \(2,\)"),
    (made_of(lambda u, mu: None), "returns nothing"),
    (made_of(lambda u, mu: np.array([np.sin(u[0]), u[1]])), "written with jax.numpy"),
    (made_of(lambda u, mu: u if u[0] > 0 else -u), "written with jax.numpy"),
    (made_of(lambda u, mu: mu["C"] * u), "'C' is not one of: A, B"),
    (made_of(lambda u, mu: u, mass=np.eye(3)), r"mass has shape \(3, 3\)"),
    (made_of(lambda u, mu: u, mass=lambda u, mu, v: v[:1]), r"mass has shape \(1,\)"),
    (made_of(lambda u, mu: u, sparsity=np.eye(3)), r"sparsity has shape \(3, 3\)"),
    (made_of(3), "is a function"),
    (lambda branch: JaxSystem(jnp.sin, "two"), "not 'two'"),
    (lambda branch: JaxSystem(jnp.sin, 0), "whole number from 1"),
    (lambda branch: equilibrium(SYSTEM, [1.0], MU), r"shape \(1,\)"),
    (lambda branch: equilibrium(SYSTEM, START, {"A": 1.0}), "'B' is not one of: A"),
    (lambda branch: equilibrium(SYSTEM, START, MU, 1e-8), "given as NewtonOptions"),
    (lambda branch: switch_branch(SYSTEM, branch.points[0], "B"), "special point of a branch"),
    (lambda branch: continue_hopf(SYSTEM, branch, ("A", "B")), "special point of a branch"),
    (lambda branch: continue_hopf(SYSTEM, branch.special[0], "B"), "two different parameters, not 'B'"),
    (
        lambda branch: continue_fold(SYSTEM, branch.special[0], ("A", "B")),
        "of kind fold, .*this is <SpecialPoint: hopf",
    ),
    (lambda branch: orbits_from_hopf(SYSTEM, branch, "B"), "special point of a branch"),
    (lambda branch: orbits_from_hopf(SYSTEM, branch.special[0], "B", OPTIONS, 8), "given as OrbitOptions"),
    (lambda branch: continue_orbits(SYSTEM, RING, "B"), "start at an Orbit"),
    (lambda branch: find_orbit(SYSTEM, RING, "6", MU), "period must be a number"),
    (lambda branch: find_orbit(SYSTEM, RING, -6.0, MU), "period must be positive"),
    (lambda branch: find_orbit(SYSTEM, RING.T, 6.0, MU), r"shape \(2, 20\); the system needs \(any, 2\)"),
    (lambda branch: find_orbit(SYSTEM, 0 * RING, 6.0, MU), "must vary"),
    (lambda branch: orbit_at(SYSTEM, branch, 0), "branch of orbits, not equilibria"),
    (lambda branch: resume(SYSTEM, None), "not None"),
    (lambda branch: branch.values("zz"), "no 'zz'; it has B"),
    (lambda branch: Branch.load("nothing.h5"), "no file nothing.h5"),
    (lambda branch: Checkpoint(5), "not to 5"),
]


@pytest.mark.parametrize(("use", "said"), WRONG, ids=[said for _, said in WRONG])
def test_wrong_uses_are_answered_by_a_sentence(branch, use, said):
    with pytest.raises(Exception, match=said) as error:
        use(branch)
    text = str(error.value)
    assert text[0].isupper() and text.endswith(".") and not isinstance(error.value, AttributeError)


def test_a_resumed_branch_begins_at_its_last_point(branch):
    longer = resume(SYSTEM, branch, ContinuationOptions(limits={"B": (1.5, 2.5)}))
    assert branch.mu(0)["B"] == 1.0 and longer.mu(-1)["B"] == 2.5


def test_one_event_may_stand_alone_and_end_a_branch():
    event = Event("second unknown is 1.5", lambda u, mu: u[1] - 1.5)
    stopped = started(options=dataclasses.replace(OPTIONS, stop_at=event.name), events=event)(None)
    assert stopped.mu(-1)["B"] == pytest.approx(1.5, rel=1e-8) and stopped.reason == f"stopped at: {event.name}"
