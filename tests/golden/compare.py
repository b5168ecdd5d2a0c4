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
#: Keys whose values are times, counts of work or rounding, or name a file.
VOLATILE = {"seconds", "time", "version", "case", "file", "residual", "residuals", "response_error", "work", "progress"}


def document(arguments: list[str]) -> dict:
    """What ``dbvfiv`` prints; exit status and message where it refuses."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = run(arguments)
    if status:
        return {"status": status, "message": err.getvalue().strip().splitlines()[-1:]}
    return _steady(json.loads(out.getvalue()))


def _steady(value):
    """Without what changes from run to run."""
    if isinstance(value, dict):
        return {key: _steady(own) for key, own in value.items() if key not in VOLATILE}
    return [_steady(own) for own in value] if isinstance(value, list) else value


def differences(now, then, where: str = "", scale: float = 0.0) -> Iterator[str]:
    """Places at which two documents differ."""
    if isinstance(now, dict) and isinstance(then, dict):
        for key in sorted(now.keys() | then.keys()):
            if key not in now or key not in then:
                yield f"{where}.{key} is {'missing' if key not in now else 'new'}"
            else:
                yield from differences(now[key], then[key], f"{where}.{key}")
    elif isinstance(now, list) and isinstance(then, list):
        if len(now) != len(then):
            yield f"{where} has {len(now)} entries for {len(then)}"
            return
        size = max((abs(v) for v in then if _is_number(v)), default=0.0)
        for number, (own, other) in enumerate(zip(now, then)):
            yield from differences(own, other, f"{where}[{number}]", size)
    elif _is_number(now) and _is_number(then):
        if not math.isclose(now, then, rel_tol=RTOL, abs_tol=SCALE * max(scale, 1e-4)):
            yield f"{where} is {now!r} for {then!r}"
    elif now != then:
        yield f"{where} is {str(now)[:200]!r} for {str(then)[:200]!r}"


def _is_number(value) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def path_of(name: str) -> Path:
    return DOCUMENTS / f"{name}.json"
