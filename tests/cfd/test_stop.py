"""A run that is stopped leaves no process behind."""

import os
import stat
import time

import pytest

from dbvfiv.cfd.foam import run_openfoam
from dbvfiv.observer import Observer


class Stopper(Observer):
    """Ctrl-C at the first sign of life."""

    def item(self, result):
        raise KeyboardInterrupt


def test_ctrl_c_ends_the_script_and_what_it_runs(tmp_path, monkeypatch):
    program = tmp_path / "simpleFoam"
    program.write_text("#!/bin/sh\n")
    program.chmod(program.stat().st_mode | stat.S_IEXEC)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    script = tmp_path / "Allrun"
    script.write_text("#!/bin/sh\nsleep 60 &\necho $! > child\necho 'Time = 1' > log.simpleFoam\nwait\n")
    script.chmod(script.stat().st_mode | stat.S_IEXEC)
    with pytest.raises(KeyboardInterrupt):
        run_openfoam(tmp_path, 10, Stopper())
    child = int((tmp_path / "child").read_text())
    for _ in range(50):
        if not os.path.exists(f"/proc/{child}") or open(f"/proc/{child}/stat").read().split()[2] == "Z":
            return
        time.sleep(0.1)
    pytest.fail("the child of the script still runs")
