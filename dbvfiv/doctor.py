"""Check of this machine: features, missing parts, and the command that mends each."""

from __future__ import annotations

import importlib
import importlib.util
import os
import platform
import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from . import __version__, runtime

_NEEDED = ("numpy", "scipy", "jax", "numba", "h5py", "matplotlib", "pydantic", "pint", "typer", "tqdm", "platformdirs")
_NEEDED += ("pyvista", "plotly", "jinja2")
_FOR_TESTS = ("pytest", "hypothesis", "felupe")
# SuperLU_DIST is left out: used a few times in one process, Debian's 8.1 corrupts the heap
_SOLVERS = ("mumps", "superlu", "umfpack", "petsc")
#: False for an installed wheel, which has no `make setup`.
_IN_SOURCES = (Path(__file__).parents[1] / "Makefile").exists()


@dataclass(frozen=True)
class Problem:
    """Something that is missing or unfit."""

    #: what and remedy: a sentence, and a command or an action.
    what: str
    remedy: str
    fatal: bool = True  #: Whether the solvers cannot work because of it.


@dataclass(frozen=True)
class Report:
    """Features found on this machine."""

    dbvfiv: str
    python: str
    executable: str
    platform: str
    cores: int
    packages: dict[str, str | None]
    petsc: dict[str, Any]
    cache: dict[str, Any]
    problems: list[Problem] = field(default_factory=list)

    @property
    def healthy(self) -> bool:
        """True where every solver can work."""
        return not any(problem.fatal for problem in self.problems)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for JSON."""
        return asdict(self) | {"healthy": self.healthy}

    def lines(self) -> list[str]:
        """The report for people."""
        petsc = self.petsc
        rows = [
            ("dbvfiv", self.dbvfiv),
            ("Python", f"{self.python} ({self.executable})"),
            ("platform", f"{self.platform}, {self.cores} cores"),
            ("PETSc", f"{petsc['petsc'] or 'missing'}, {petsc['scalar'] or 'unknown'} scalars"),
            ("SLEPc", petsc["slepc"] or "missing"),
            ("direct solvers", ", ".join(petsc["solvers"]) or "none"),
            *((name, version or "missing") for name, version in self.packages.items()),
            ("cache", f"{self.cache['folder']} ({self.cache['bytes'] / 1e6:.1f} MB)"),
        ]
        rows += [("missing" if p.fatal else "note", f"{p.what} Remedy: {p.remedy}") for p in self.problems]
        all_here = "Everything that is needed is here." if self.healthy else "Something that is needed is missing."
        return [*(f"{name:<16}{value}" for name, value in rows), all_here]


def examine() -> Report:
    """Look at packages, PETSc and SLEPc, the cache folder and the cores."""
    problems: list[Problem] = []
    packages = {name: _version(name, problems) for name in _NEEDED}
    if _IN_SOURCES:
        packages |= {name: _version(name, problems, fatal=False) for name in _FOR_TESTS}
    return Report(
        dbvfiv=__version__,
        python=platform.python_version(),
        executable=sys.executable,
        platform=platform.platform(),
        cores=processors(),
        packages=packages,
        petsc=_petsc(problems),
        cache=_cache(problems),
        problems=problems,
    )


def _version(name: str, problems: list[Problem], fatal: bool = True) -> str | None:
    try:
        return str(getattr(importlib.import_module(name), "__version__", "unknown"))
    except Exception as error:  # a broken binary raises more than ImportError
        detail = " ".join(str(error).split())[:120]
        role = "" if fatal else " (only the tests need it)"
        remedy = "make setup" if _IN_SOURCES else f"pip install {name}"
        problems.append(Problem(f"{name} cannot be imported{role}: {detail}.", remedy, fatal))
        return None


def _petsc(problems: list[Problem]) -> dict[str, Any]:
    """Versions, scalar type and direct solvers of PETSc and SLEPc."""
    found: dict[str, Any] = {"petsc": None, "slepc": None, "scalar": None, "integer_bits": None, "solvers": []}
    if importlib.util.find_spec("petsc4py") is None or importlib.util.find_spec("slepc4py") is None:
        problems.append(Problem("PETSc and SLEPc for Python (petsc4py, slepc4py) are missing.", petsc_remedy()))
        return found
    try:
        import petsc4py

        petsc4py.init(["dbvfiv"])
        import numpy as np
        from petsc4py import PETSc
        from slepc4py import SLEPc
    except Exception as error:
        detail = " ".join(str(error).split())[:160]
        # petsc4py belongs to the numpy it was built with
        remedy = "pip install 'numpy<2'" if "numpy" in detail.lower() else petsc_remedy()
        problems.append(Problem(f"PETSc or SLEPc is installed but cannot be imported: {detail}.", remedy))
        return found
    found["petsc"] = ".".join(map(str, PETSc.Sys.getVersion()))
    found["slepc"] = ".".join(map(str, SLEPc.Sys.getVersion()))
    found["scalar"] = "complex" if np.dtype(PETSc.ScalarType).kind == "c" else "real"
    found["integer_bits"] = np.dtype(PETSc.IntType).itemsize * 8
    found["solvers"] = [name for name in _SOLVERS if _factors(PETSc, name)]
    found["blas"] = _reference_blas()
    if found["blas"] == "reference":
        problems.append(
            Problem(
                "PETSc runs on the reference BLAS, which makes factorisations several times slower.",
                "apt-get install libopenblas0-pthread (as root or with sudo)",
                fatal=False,
            )
        )
    if np.dtype(PETSc.RealType).itemsize < 8:
        problems.append(Problem("PETSc works in single precision.", petsc_remedy()))
    if "mumps" not in found["solvers"]:
        problems.append(
            Problem("PETSc has no MUMPS, so factorisations are slower.", petsc_remedy(), fatal=not found["solvers"])
        )
    return found


def _reference_blas() -> str:
    """Tell "reference" if the loaded libblas is the plain one, "optimised" if another, "unknown" where nothing says."""
    try:
        with open("/proc/self/maps") as maps:
            loaded = {line.split()[-1] for line in maps if "libblas" in line}
    except OSError:
        return "unknown"
    return "reference" if any("/blas/libblas" in path for path in loaded) else "optimised"


def _factors(PETSc: Any, name: str) -> bool:
    """True where PETSc factors a small unsymmetric matrix with this package."""
    PETSc.Sys.pushErrorHandler("ignore")
    try:
        matrix = PETSc.Mat().createAIJ((2, 2), nnz=2, comm=PETSc.COMM_SELF)
        matrix.setValues([0, 1], [0, 1], [[2.0, 1.0], [0.5, 3.0]])
        matrix.assemble()
        solver = PETSc.KSP().create(PETSc.COMM_SELF)
        solver.setOperators(matrix)
        solver.setType("preonly")
        solver.getPC().setType("lu")
        solver.getPC().setFactorSolverType(name)
        solver.setUp()
        return True
    except PETSc.Error:
        return False
    finally:
        PETSc.Sys.popErrorHandler()


def petsc_remedy() -> str:
    """The command that brings PETSc and SLEPc to this kind of machine."""
    if os.environ.get("CONDA_PREFIX"):
        return "conda install -c conda-forge petsc4py slepc4py"
    if os.path.exists("/etc/debian_version"):
        packages = "apt-get install python3-petsc4py-real python3-slepc4py-real libopenblas0-pthread"
        return f"make setup (as root or with sudo: {packages})" if _IN_SOURCES else f"{packages} (as root or with sudo)"
    then = ", then make setup" if _IN_SOURCES else ""
    return f"conda env create -f environment.yml, or load your cluster's petsc4py and slepc4py modules{then}"


def _cache(problems: list[Problem]) -> dict[str, Any]:
    folder = runtime.cache_directory()
    size = 0
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / f".probe-{os.getpid()}"
        probe.write_bytes(b"")
        probe.unlink()
        writable = True
        size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    except OSError:
        writable = False
        problems.append(
            Problem(
                f"The cache folder {folder} is not writable, so every run compiles anew.",
                "export DBVFIV_CACHE=/a/folder/you/may/write",
                fatal=False,
            )
        )
    return {"folder": str(folder), "writable": writable, "bytes": size}


def processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
