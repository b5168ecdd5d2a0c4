"""The process's surroundings: double precision, caches, threads, MPI without ``mpiexec``.

Everything goes through environment variables that the libraries read when they
are first imported, and never overwrites what the user has set.
"""

from __future__ import annotations

import ctypes
import hashlib
import importlib.util
import os
import sys
from pathlib import Path


def cache_directory() -> Path:
    """Folder of compiled code: ``$DBVFIV_CACHE``, or the platform's user cache."""
    chosen = os.environ.get("DBVFIV_CACHE")
    if chosen:
        return Path(chosen).expanduser()
    import platformdirs

    return Path(platformdirs.user_cache_dir("dbvfiv"))


def kernel_directory() -> Path:
    """Folder of compiled element loops, another one for other sources.

    Numba looks at the file of a loop alone, not at those of the functions and constants that it compiles into it.
    """
    package = Path(__file__).parent
    digest = hashlib.sha256()
    for source in sorted((package / "shell").glob("*.py")):
        digest.update(source.read_bytes())
    return cache_directory() / "numba" / digest.hexdigest()[:16]


def prepare() -> None:
    """Set the surroundings; safe to call again, also after JAX was imported.

    Double precision in JAX is not optional: Newton's method stops at 1e-8.
    """
    cache = cache_directory()
    settings = {
        "JAX_PLATFORMS": "cpu",
        "JAX_COMPILATION_CACHE_DIR": str(cache / "jax"),
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.2",
        "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
        "NUMBA_CACHE_DIR": str(kernel_directory()),
        # element loops and the small factorisations here lose time to threads
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
        # Open MPI: one process without mpiexec, as root too, without noise
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_plm": "isolated",
        "OMPI_MCA_ess_singleton_isolated": "1",  # no daemon beside, which takes half a second to start
        "OMPI_MCA_btl_base_warn_component_unused": "0",
        "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
        "PRTE_MCA_plm_ssh_agent": "false",
    }
    core = blas_core(_processor())
    if core:
        settings["OPENBLAS_CORETYPE"] = core
    if _numpy_is_of_pypi():
        # it would multiply complex numbers with fused instructions or without, by how far apart they lie in memory
        settings["NPY_DISABLE_CPU_FEATURES"] = "FMA3"
    for name, value in settings.items():
        os.environ.setdefault(name, value)
    os.environ["JAX_ENABLE_X64"] = "true"
    # PETSc's handlers turn Ctrl-C's neighbours and a closed pipe into an abort of MPI; Python's own are wanted
    petsc = os.environ.get("PETSC_OPTIONS", "")
    if "-no_signal_handler" not in petsc.split():
        os.environ["PETSC_OPTIONS"] = f"{petsc} -no_signal_handler".strip()
    if "jax" in sys.modules:
        config = sys.modules["jax"].config
        config.update("jax_enable_x64", True)
        config.update("jax_compilation_cache_dir", os.environ["JAX_COMPILATION_CACHE_DIR"])
    if importlib.util.find_spec("petsc4py") is None:
        sys.path += debian_petsc()
    if mpi_size() > 1:
        _petsc_of_its_own()


def _numpy_is_of_pypi() -> bool:
    """True for a wheel of PyPI, whose kernels serve any processor; a build for one processor may need fused
    multiplications and refuses to start without them.
    """
    numpy = importlib.util.find_spec("numpy")
    wheels = Path(numpy.origin).parents[1].glob("numpy-*.dist-info/WHEEL") if numpy and numpy.origin else ()
    return any("manylinux" in wheel.read_text(encoding="utf-8") for wheel in wheels)


def debian_petsc(root: str = "/usr/lib") -> list[str]:
    """Folders in which Debian and Ubuntu keep petsc4py and slepc4py for this Python, real scalars before complex ones.

    They are on no path, so that a virtual environment finds them by name only.
    """
    library = f"*cpython-{sys.version_info.major}{sys.version_info.minor}-*.so"
    for kind in ("real", "complex"):
        found = [
            max(Path(root).glob(f"{name}dir/{name}[0-9]*/*-{kind}/lib/python3/dist-packages"), default=None)
            for name in ("petsc", "slepc")
        ]
        if None not in found and next(found[0].glob(f"petsc4py/**/{library}"), None):
            return [str(folder) for folder in found]
    return []


def blas_core(processor: str) -> str | None:
    """Kernels that OpenBLAS is to take, by the instructions that a processor has; None leaves the choice to it.

    A copy that is older than the processor does not know the model and takes kernels for any, with a fifth of the
    speed in dense products and factorisations.

    Parameters
    ----------
    processor : str
        As Linux describes it in /proc/cpuinfo.

    Examples
    --------
    >>> blas_core("flags : fpu sse2 avx avx2 fma")
    'Haswell'
    """
    lines = (line.partition(":") for line in processor.splitlines())
    has = next((set(value.split()) for name, _, value in lines if name.strip() == "flags"), set())
    for core, needed in _CORES.items():
        if needed <= has:
            return core
    return None


#: Kernels of OpenBLAS and the instructions that they are made of, the fastest first.
_CORES = {"SkylakeX": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"}, "Haswell": {"avx2", "fma"}}


def _processor() -> str:
    try:
        return Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace")
    except OSError:
        return ""


def free_memory() -> None:
    """Free what other valves have left in this process, on Linux.

    Memory that is free goes back to the system: glibc keeps what large factorisations leave between smaller arrays, 20
    GB after thirty studies of some thousand elements. The programs that JAX holds are dropped where they fill half the
    memory maps that a process is granted: a valve of another structure compiles programs of its own, of some hundreds
    of maps; where no map is left, the process ends without a word.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim is not None:
        trim(0)
    try:
        granted = int(Path("/proc/sys/vm/max_map_count").read_text(encoding="ascii"))
        held = Path("/proc/self/maps").read_bytes().count(b"\n")
    except (OSError, ValueError):
        return
    if held > granted // 2 and "jax" in sys.modules:
        sys.modules["jax"].clear_caches()


def mpi_size() -> int:
    """Processes started by ``mpiexec``, 1 without it."""
    for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS"):
        if os.environ.get(name, "").isdigit():
            return int(os.environ[name])
    return 1


def _petsc_of_its_own() -> None:
    """Start PETSc for this process alone: by itself it would wait for the others, which wait for columns of a map."""
    try:
        import petsc4py
        from mpi4py import MPI
    except ImportError:
        return
    petsc4py.init(comm=MPI.COMM_SELF)
