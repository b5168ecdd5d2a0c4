"""Locating a Hopf point near a guess, and describing it."""

from __future__ import annotations

import numpy as np

from continuation.conditions import HopfCondition, null_pair
from continuation.errors import ContinuationError, DerivativeMissing
from continuation.here import Here
from continuation.locate import companion, special_at
from continuation.normal_form import hopf_normal_form
from continuation.problem import correct


def hopf_borders(linear, omega, vector):
    """Left and right vectors near the null vectors of ``A - i omega B``."""
    shifted = linear.shifted(1j * omega)
    q = np.asarray(vector, complex)
    p = linear.mass_matvec(q)
    if np.linalg.norm(p) <= 1e-12 * np.linalg.norm(q):
        p = q
    for _ in range(2):
        _, q, p, _ = null_pair(shifted, p / np.linalg.norm(p), q / np.linalg.norm(q))
    return p, q


def solve_hopf(tracer, guess, omega, vector):
    """Newton on ``F = 0, g = 0`` in state, parameter and frequency."""
    p, q = hopf_borders(guess.local.linear, omega, vector)
    augmented = companion(tracer, HopfCondition(p, q))
    frame = augmented.frame(guess.tangent[:, None])
    result = correct(
        augmented, np.append(guess.z, omega), frame, tracer.options.newton, None, tracer.options.location_tolerance
    )
    if not result.converged:
        return f"Newton's method on the augmented system: {result.reason}"
    if not result.z[-1] > 0:
        return "Newton's method went to a frequency that is not positive"
    return result


def describe_hopf(tracer, result, tangent, index):
    """The special point with frequency, normal form and a check of the eigenpair."""
    problem, value = tracer.problem, result.local.condition
    omega = float(result.z[-1])
    linear, q = value.linear, value.v / np.linalg.norm(value.v)
    aq, bq = linear.matvec(q), linear.mass_matvec(q)
    defect = np.linalg.norm(aq - 1j * omega * bq) / max(np.linalg.norm(aq), 1e-300)
    values = {"omega": omega, "iterations": result.iterations, "eigen_residual": float(defect)}
    vectors = {"right": q, "left": value.w}
    try:
        form = hopf_normal_form(problem.system, result.local.u, result.local.mu, omega, q, value.w, problem.names[0])
        values.update(
            first_lyapunov_coefficient=form.l1,
            c1_real=form.c1.real,
            c1_imag=form.c1.imag,
            crossing_real=form.crossing.real,
            crossing_imag=form.crossing.imag,
            criticality=form.criticality,
            amplitude_coefficient=form.amplitude_coefficient(),
        )
        vectors["left"] = form.p
    except (DerivativeMissing, ContinuationError) as error:
        values["normal_form"] = str(error)
    here = Here(result.z[:-1], tangent, result.local)
    return special_at(tracer, "hopf", here, index, True, "", values, vectors)
