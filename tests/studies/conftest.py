import json
import os
import subprocess
import sys
import time

import pytest

from dbvfiv.model import ValveModel
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.stability.walk import StabilityWalk
from tests.studies.work import ROOT

COARSE = [
    "mesh.around=8",
    "mesh.along=16",
    "damping.alpha=0",
    "damping.beta=0.003",
    "fluid.density=10",
    "drive.pressure=6000",
]


@pytest.fixture(scope="session")
def coarse_case():
    return thesis_case(COARSE)


@pytest.fixture(scope="session")
def walk(coarse_case):
    return StabilityWalk(coarse_case)


@pytest.fixture(scope="session")
def model():
    """The 12-inch valve of the thesis on 8 x 16 elements."""
    return ValveModel(thesis_case({"mesh.around": 8, "mesh.along": 16}))


@pytest.fixture(scope="session")
def state(model):
    """Its steady state at 6 kPa."""
    return LoadPath(model).go_to(6e3)


@pytest.fixture
def cluster(tmp_path):
    """Scheduler of Dask with two workers, each a process of its own, and their pids."""
    pytest.importorskip("distributed")
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    address = tmp_path / "scheduler.json"
    command = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    options = {"env": environment, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    quiet = ["--no-dashboard", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(address)]
    started = [subprocess.Popen([*command, *quiet], **options)]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", str(address)]
    single = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(tmp_path)]
    started += [subprocess.Popen([*worker, *single], **options) for _ in range(2)]
    try:
        for _ in range(600):
            if address.exists():
                break
            time.sleep(0.05)
        from distributed import Client

        where = json.loads(address.read_text())["address"]
        with Client(where, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)
        yield where, started[1:]
    finally:
        for process in started[::-1]:
            process.kill()
            process.wait()
