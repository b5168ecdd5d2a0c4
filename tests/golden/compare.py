"""Run, write and compare documents."""

from __future__ import annotations

import contextlib
import io
import json
import math
from collections.abc import Iterator
from pathlib import Path

from dbvfiv.cli import run

DOCUMENTS = Path(__file__).parent / "documents"
#: Relative difference of two numbers that are the same, and what is added to it by the largest of their list.
RTOL, SCALE = 1e-6, 1e-8
#: Relative difference of Floquet exponents, which are only as good as the correction left of a cycle.
OF_CYCLES = 1e-4
#: Growth rate, 1/s, below which a state is neutral: a search for an onset ends there by rounding.
NEUTRAL = 1e-2
#: Keys that hold a growth rate, or its derivative where the dictionary has that per per cent too.
RATES = {"growth_rate", "leading_growth_rate"}
#: Keys whose values are times, counts of work or rounding, or name a file; a verdict says what ``certified`` does.
VOLATILE = {"seconds", "time", "version", "case", "file", "residual", "residuals", "response_error", "work", "progress"}
VOLATILE |= {"error", "correction", "trivial", "certified"}


def document(arguments: list[str]) -> dict:
    """JSON document that ``dbvfiv`` prints; exit status and message where it refuses."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = run(arguments)
    if status:
        return {"status": status, "message": err.getvalue().strip().splitlines()[-1:]}
    return steady(json.loads(out.getvalue()))


def steady(value):
    """Document without the values that change from run to run."""
    if isinstance(value, dict):
        neutral = set() if "growth_rate_per_percent" in value else {key for key in RATES if _is_neutral(value.get(key))}
        if "growth_rate" in neutral and "outcome" in value:  # verdict on a state of a scan
            return "neutral"
        return {k: "neutral" if k in neutral else steady(own) for k, own in value.items() if k not in VOLATILE}
    return [steady(own) for own in value if not _is_of_scan(own)] if isinstance(value, list) else value


def _size(value: dict) -> float:
    """Size of the eigenvalue, 1/s, of which a growth rate is the smaller part; rounding goes with it."""
    frequency = value.get("frequency")
    return 2 * math.pi * abs(frequency) if _is_number(frequency) else 0.0


def _is_neutral(value) -> bool:
    return _is_number(value) and abs(value) < NEUTRAL


def _is_of_scan(value) -> bool:
    """Sentence on the bands of a scan, whose last states are neutral."""
    return isinstance(value, str) and value.startswith("Verdicts hold for modes up to")


def differences(now, then, where: str = "", scale: float = 0.0) -> Iterator[str]:
    """Places at which two documents differ."""
    if isinstance(now, dict) and isinstance(then, dict):
        for key in sorted(now.keys() | then.keys()):
            if key not in now or key not in then:
                yield f"{where}.{key} is {'missing' if key not in now else 'new'}"
            else:
                yield from differences(now[key], then[key], f"{where}.{key}", _size(then) if key in RATES else 0.0)
    elif isinstance(now, list) and isinstance(then, list):
        if len(now) != len(then):
            yield f"{where} has {len(now)} entries for {len(then)}"
            return
        size = max((abs(v) for v in then if _is_number(v)), default=0.0)
        for number, (own, other) in enumerate(zip(now, then)):
            yield from differences(own, other, f"{where}[{number}]", size)
    elif _is_number(now) and _is_number(then):
        if not math.isclose(
            now, then, rel_tol=OF_CYCLES if ".exponents" in where else RTOL, abs_tol=SCALE * max(scale, 1e-4)
        ):
            yield f"{where} is {now!r} for {then!r}"
    elif now != then:
        yield f"{where} is {str(now)[:200]!r} for {str(then)[:200]!r}"


def _is_number(value) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def path_of(name: str) -> Path:
    return DOCUMENTS / f"{name}.json"
