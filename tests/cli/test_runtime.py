"""The surroundings that importing the package sets."""

import shutil
import subprocess
import sys
from pathlib import Path

from dbvfiv import runtime

CODE = """
import os
{before}
import dbvfiv, jax, jax.numpy as jnp
print(jnp.zeros(1).dtype, jax.config.jax_compilation_cache_dir)
print(os.environ["NUMBA_CACHE_DIR"], os.environ["OMP_NUM_THREADS"])
"""


def run(before: str = "", **environment: str) -> list[str]:
    import os

    clean = {k: v for k, v in os.environ.items() if not k.startswith(("JAX_", "NUMBA_", "OMP_", "DBVFIV"))}
    done = subprocess.run(
        [sys.executable, "-c", CODE.format(before=before)],
        capture_output=True,
        text=True,
        env=clean | environment,
        check=True,
    )
    return done.stdout.split()


def test_double_precision_and_caches(tmp_path):
    precision, jax, numba, threads = run(DBVFIV_CACHE=str(tmp_path))
    assert (precision, jax, threads) == ("float64", str(tmp_path / "jax"), "1")
    assert Path(numba).parent == tmp_path / "numba"


def test_changed_sources_are_compiled_anew(tmp_path, monkeypatch):
    """Also those of what a compiled loop calls, which Numba's own check does not see."""
    package = tmp_path / "dbvfiv"
    shutil.copytree(Path(runtime.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(runtime, "__file__", str(package / "runtime.py"))
    before = runtime.kernel_directory()
    assert runtime.kernel_directory() == before
    called = package / "shell" / "kernel_rubber.py"
    called.write_text(called.read_text() + "# changed\n")
    assert runtime.kernel_directory() != before


def test_also_when_jax_was_there_first(tmp_path):
    assert run("import jax", DBVFIV_CACHE=str(tmp_path))[:2] == ["float64", str(tmp_path / "jax")]


def test_what_the_user_set_stays(tmp_path):
    assert run(DBVFIV_CACHE=str(tmp_path), OMP_NUM_THREADS="3")[3] == "3"
