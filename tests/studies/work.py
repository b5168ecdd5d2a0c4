"""Tasks of the tests of `dbvfiv.studies.workers`, in a module that workers can import."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from dbvfiv.studies.workers import Work, Workers

ROOT = Path(__file__).parents[2]
TASKS = tuple(range(1, 13))


def start(power: int) -> float:
    return 1.0 / power


def root_of(context: float, task: int) -> float:
    time.sleep(0.05)  # so that tasks are in flight when a worker dies
    return task**context


def dies(context: float, task: int) -> float:
    if task == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return root_of(context, task)


def expected() -> dict[int, float]:
    return {task: root_of(start(3), task) for task in TASKS}


def run_under_mpi(count: int, module: str, *arguments: str) -> subprocess.CompletedProcess:
    """A module run by some processes of ``mpiexec``, the first of which shares tasks among the others."""
    pytest.importorskip("mpi4py.futures")
    if shutil.which("mpiexec") is None:
        pytest.skip("mpiexec is not installed.")
    command = ["mpiexec", "--oversubscribe", "-n", str(count), sys.executable, "-m", "mpi4py.futures", "-m", module]
    # an MPI that this process or its parent has started leaves its names, and mpiexec starts no other below it
    others = ("OMPI_", "PMIX_", "PMI_", "PRTE_")
    own = {name: value for name, value in os.environ.items() if not name.startswith(others)}
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_plm": "isolated"}
    options = {"cwd": ROOT, "env": own | allowed | {"PYTHONPATH": str(ROOT)}, "timeout": 1200}
    return subprocess.run([*command, *arguments], capture_output=True, text=True, **options)


if __name__ == "__main__":
    with Workers(1, start, (3,), print) as team:
        print(sorted(team.share(TASKS, lambda task: Work(root_of, (task,)))))
