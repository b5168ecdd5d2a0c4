"""The same results with a PETSc built for complex numbers, in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = """
import numpy as np
from petsc4py import PETSc
assert np.dtype(PETSc.ScalarType).kind == "c"
from eigen import SearchOptions, leading_modes, certified_spectrum
from tests.systems.plate_over_channel import plate_over_channel
from tests.systems.random_pencils import dense_eigenvalues, leading_of, random_pencil
for m, b in ((0, 0), (4, 0), (4, 1), (4, 2)):
    pencil = random_pencil(np.random.default_rng(m + b), 30, m, b)
    for shifts in (None, (0.5 + 2j, 8.0)):
        modes = leading_modes(pencil, 5, SearchOptions(left=True, method="krylov", max_frequency=10.0, shifts=shifts))
        expected = leading_of(dense_eigenvalues(pencil), 5)
        assert np.abs(modes.eigenvalues - expected).max() < 1e-9 * np.abs(expected).max()
        assert modes.biorthogonality < 1e-8 and modes.residual.max() < 1e-8
pencil = plate_over_channel(5, 10, inlet_velocity=6.0)
search = SearchOptions(max_frequency=40.0)
values = leading_modes(pencil, 4, search).eigenvalues
other = leading_modes(pencil, 4, SearchOptions(max_frequency=40.0, shifts=(60 + 150j, 250.0))).eigenvalues
assert np.abs(values - other).max() < 1e-8 * np.abs(values).max()
assert certified_spectrum(pencil, 4, search).agrees
print("agrees")
"""


def complex_packages() -> list[str]:
    """Folders of a complex petsc4py and slepc4py: named by PETSC_COMPLEX_PATH, or Debian's."""
    named = os.environ.get("PETSC_COMPLEX_PATH")
    if named:
        return named.split(os.pathsep)
    found = [
        next(Path("/usr/lib").glob(f"{kind}dir/*/x86_64-linux-gnu-complex/lib/python3/dist-packages"), None)
        for kind in ("petsc", "slepc")
    ]
    return [str(f) for f in found] if all(found) else []


@pytest.mark.skipif(not complex_packages(), reason="no PETSc with complex numbers is installed")
def test_complex_scalars_give_the_same():
    paths = complex_packages() + [str(ROOT)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=environment, cwd=ROOT, capture_output=True, text=True, timeout=300
    )
    assert run.returncode == 0, run.stderr[-2000:]
    assert run.stdout.strip().endswith("agrees")
