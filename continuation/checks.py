"""Arguments that callers hand over, checked once; what does not fit is answered by a sentence."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from continuation.options import KINDS, NotABifurcation, NotAParameter, require


def shown(thing) -> str:
    """Short text of an argument, for a sentence that refuses it."""
    text = " ".join(repr(thing).split())
    return text if len(text) <= 60 else f"{text[:50]}..." if text[0] == "<" else type(thing).__name__


def options_of(kind, given):
    """Options of a kind; its defaults for None."""
    if given is not None and not isinstance(given, kind):
        raise TypeError(f"Options are given as {kind.__name__}(...), not as {shown(given)}.")
    return kind() if given is None else given


def number_of(value, what: str) -> float:
    """A real number as a float."""
    try:
        return float("" if isinstance(value, str) else value)
    except (TypeError, ValueError):
        raise TypeError(f"The {what} must be a number, not {shown(value)}.") from None


def parameters_of(mu) -> dict[str, float]:
    """All parameters as floats."""
    if not isinstance(mu, Mapping):
        raise TypeError(f"Parameters are given by name, such as {{'a': 1.0}}, not as {shown(mu)}.")
    return {name: number_of(value, f"parameter {name!r}") for name, value in mu.items()}


def numbers_of(values, what: str, shape: tuple) -> np.ndarray:
    """Array of real numbers; None in the shape stands for any length."""
    try:
        array = np.asarray(values)
        array = array.astype(complex if np.iscomplexobj(array) else float)
    except (TypeError, ValueError):
        raise TypeError(f"The {what} must hold real numbers, not {shown(values)}.") from None
    if np.iscomplexobj(array):
        raise TypeError(f"The {what} must hold real numbers, not complex ones.")
    if len(array.shape) != len(shape) or any(n not in (None, m) for n, m in zip(shape, array.shape)):
        needed = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"
        raise ValueError(f"The {what} has shape {array.shape}; the system needs {needed}.")
    return array


def system_of(system):
    """A system as it is, which has a size and a residual."""
    if not isinstance(getattr(system, "size", None), (int, np.integer)) or not hasattr(system, "residual"):
        raise TypeError(f"The first argument is a System, such as JaxSystem(residual, size), not {shown(system)}.")
    return system


def special_of(special, use: str):
    """A special point as it is."""
    if not hasattr(special, "kind") or not hasattr(special, "vectors"):
        raise NotABifurcation(f"{use} a special point of a branch, such as branch.special[0], not {shown(special)}.")
    return special


def spectrum_of(spectrum):
    """A function that gives spectra, or None for that of the system."""
    if spectrum is not None and not callable(spectrum):
        raise TypeError(f"The spectrum is a function (u, mu, count, near), not {shown(spectrum)}.")
    return spectrum


def require_names(options, mu: Mapping[str, float], freed=()) -> None:
    """Refuse options that name no parameter, and a start outside the limits of the freed parameters."""
    for name in (*freed, *options.limits, *options.parameter_scales):
        if name not in mu:
            raise NotAParameter.named(name, mu)
    for name in freed:
        low, high = options.limits.get(name, (-np.inf, np.inf))
        outside = mu[name] < low or mu[name] > high
        require(not outside, f"The start {name} = {mu[name]:g} is outside its limits {low:g} to {high:g}.")


def require_kinds(options, kinds) -> None:
    """Refuse a kind of special points to stop at that a run with these options does not look for."""
    for kind in options.stop_at:
        known = ", ".join(sorted(kinds)) or "nothing"
        require(kind in kinds, f"This branch cannot stop at {kind!r}; it looks for: {known}.")


def events_of(events) -> tuple:
    """Events as a tuple; one may stand alone."""
    events = (events,) if hasattr(events, "function") or callable(events) else tuple(events)
    for event in events:
        if not callable(getattr(event, "function", None)):
            raise TypeError(f"Events are given as Event(name, function), not as {shown(event)}.")
        require(event.name not in KINDS, f"An event needs a name of its own, not {event.name!r}.")
    return events
