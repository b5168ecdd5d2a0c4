"""Force, tangent and head-discharge curve of the 12-inch valve against a numeric LU refactorisation of its tangent."""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile

import numpy as np

from dbvfiv.model import ValveModel
from dbvfiv.model.equilibria import LoadPath, find_equilibrium
from dbvfiv.studies.case import thesis_case
from eigen.factor import DirectFactor

from .registry import Row, benchmark, medians, seconds

MESHES = ((14, 24), (28, 48), (56, 96))
CURVE = np.linspace(3e3, 36e3, 12)


def model_of(around: int, along: int) -> ValveModel:
    return ValveModel(thesis_case({"mesh.around": around, "mesh.along": along}))


def refactorisation(model: ValveModel, q: np.ndarray) -> DirectFactor:
    """The tangent of shell and stops, factored once."""
    factor = DirectFactor(*model.shell.dofs.pattern)
    factor.values[:] = model.structure(q)[1]
    factor.refactor()
    return factor


def assembly(model: ValveModel, rounds: int = 15) -> tuple[dict[str, float], np.ndarray]:
    q = find_equilibrium(model, 6e3).q
    factor = refactorisation(model, q)
    times = medians(
        {
            "force": lambda: model.shell.force(q),
            "tangent": lambda: model.shell.force_and_tangent(q),
            "coupled": lambda: model.tangent(q, 6e3),
            "lu": factor.refactor,
            "solve": lambda: factor.solve(q),
        },
        rounds,
    )
    return times, q


@benchmark("force-and-tangent")
def force_and_tangent():
    """28 x 48, ten layer points, one thread."""
    times, _ = assembly(model_of(28, 48))
    lu = times["lu"]
    yield Row("numeric LU refactorisation of the tangent, 28 x 48", 1e3 * lu, "ms")
    yield Row("force and tangent over one LU refactorisation", times["tangent"] / lu, target=3.0)
    yield Row("force alone over one LU refactorisation", times["force"] / lu, target=0.8)
    yield Row("coupled residual and tangent over one LU refactorisation", times["coupled"] / lu)
    yield Row("one solve over one LU refactorisation", times["solve"] / lu)


@benchmark("head-discharge")
def head_discharge():
    """Twelve pressures at 28 x 48, rest to 36 kPa, and how cost grows with the mesh."""
    for around, along in MESHES:
        model = model_of(around, along)
        times, _ = assembly(model, 5)
        unit = len(CURVE) * 4 * (times["tangent"] + times["lu"])
        spent, result = seconds(lambda: [path.go_to(pressure) for path in [LoadPath(model)] for pressure in CURVE])
        iterations = sum(state.iterations for state in result)
        target = 8.0 if (around, along) == (28, 48) else None
        yield Row(
            f"{around} x {along}: 12 pressures over 12 x 4 (assembly + LU)",
            spent / unit,
            target=target,
            note=f"{spent:.2f} s, {iterations} Newton steps",
        )
        yield Row(
            f"{around} x {along}: force and tangent",
            1e3 * times["tangent"],
            "ms",
            note=f"LU {1e3 * times['lu']:.1f} ms, {model.size} unknowns",
        )
    yield Row("largest memory of this process", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, "MiB")


@benchmark("first-call")
def first_call():
    """A process with an empty compilation cache, and one after it."""
    code = "import dbvfiv; print(dbvfiv.load('cases/dbv12.toml').steady(pressure=6e3).mass_flow)"
    with tempfile.TemporaryDirectory() as cache:
        environment = os.environ | {"DBVFIV_CACHE": cache}
        for variable in ("NUMBA_CACHE_DIR", "JAX_COMPILATION_CACHE_DIR"):
            environment.pop(variable, None)
        for what, target in (
            ("first process, compilation included", 30.0),
            ("later process, from the compilation cache", 10.0),
        ):
            spent, _ = seconds(
                lambda: subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True)
            )
            yield Row(f"{what}: one steady state at 28 x 48", spent, "s", target)
