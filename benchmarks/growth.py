"""Growth of time and memory with the mesh, in processor time, and which BLAS the factorisation stands on."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from dbvfiv.model.equilibria import find_equilibrium

from .registry import Row, benchmark
from .statics import MESHES, model_of, refactorisation

_ONE_EQUILIBRIUM = """
import json, sys
import dbvfiv
from dbvfiv.studies.case import thesis_case
from dbvfiv.model import ValveModel
from dbvfiv.model.equilibria import find_equilibrium
def peak():  # getrusage would count what the parent process held when it started this one
    return int(next(line for line in open("/proc/self/status") if line.startswith("VmHWM")).split()[1]) / 1024
before = peak()
model = ValveModel(thesis_case({"mesh.around": int(sys.argv[1]), "mesh.along": int(sys.argv[2])}))
find_equilibrium(model, 18e3)
print(json.dumps({"before": before, "peak": peak()}))
"""


def processor_medians(functions: dict, rounds: int) -> dict[str, float]:
    """Median processor seconds of functions that take turns: other programs on the machine slow them, but are not
    counted.
    """
    taken = {name: [] for name in functions}
    for turn in range(rounds + 1):
        for name, function in functions.items():
            start = time.process_time()
            function()
            if turn:
                taken[name].append(time.process_time() - start)
    return {name: float(np.median(times)) for name, times in taken.items()}


def slow_blas() -> bool:
    """Whether this process has loaded the plain reference BLAS: factorisations then take several times longer and every
    ratio to them looks too good.
    """
    try:
        lines = Path("/proc/self/maps").read_text().splitlines()
    except OSError:
        return False
    return any("/blas/libblas" in line for line in lines)


@benchmark("growth")
def growth():
    """Force, tangent and LU from 14 x 24 to 56 x 96, processor time; the LU without the solve that detects its
    breakdown.
    """
    yield Row("plain reference BLAS in use (0 no, 1 yes: install libopenblas0-pthread)", float(slow_blas()), "", 0.0)
    found = []
    for (around, along), rounds in zip(MESHES, (25, 15, 7)):
        model = model_of(around, along)
        q = find_equilibrium(model, 18e3).q
        factor = refactorisation(model, q)
        times = processor_medians(
            {
                "force": lambda: model.shell.force(q),
                "force and tangent": lambda: model.shell.force_and_tangent(q),
                "refactor": factor.refactor,
                "solve": lambda: factor.solve(q),
            },
            rounds,
        )
        times["LU"] = times.pop("refactor") - times.pop("solve")
        found.append(times | {"unknowns": model.size})
        reference = (around, along) == (28, 48)
        for name, target in (("force and tangent", 3.0), ("force", 0.8)):
            note = f"{1e3 * times[name]:.1f} over {1e3 * times['LU']:.1f} ms"
            yield Row(
                f"{around} x {along}: {name} over LU",
                times[name] / times["LU"],
                target=target if reference else None,
                note=note,
            )
    for name in ("unknowns", "force", "force and tangent", "LU"):
        yield Row(f"{name}: 56 x 96 over 14 x 24", found[-1][name] / found[0][name])


@benchmark("memory")
def memory():
    """Peak memory of a process that finds one equilibrium from rest, on three grids; Linux only."""
    if not Path("/proc/self/status").exists():
        return
    above = []
    for around, along in MESHES:
        command = [sys.executable, "-c", _ONE_EQUILIBRIUM, str(around), str(along)]
        done = subprocess.run(command, env=os.environ.copy(), check=True, capture_output=True, text=True)
        found = json.loads(done.stdout.splitlines()[-1])
        above.append(found["peak"] - found["before"])
        yield Row(
            f"{around} x {along}: peak memory", found["peak"], "MiB", note=f"{above[-1]:.0f} MiB above the imports"
        )
    yield Row("memory above the imports: 56 x 96 over 14 x 24", above[-1] / above[0])
