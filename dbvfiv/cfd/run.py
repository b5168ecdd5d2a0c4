"""OpenFOAM as a process: found, started, watched."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

from ..errors import SolveError
from ..observer import Observer

#: Where Debian's package keeps what the programs read.
_DEBIAN = Path("/usr/share/openfoam")
_STEP = re.compile(r"^Time = (\d+)", re.MULTILINE)


def has_openfoam() -> bool:
    """True where simpleFoam is on the path."""
    return shutil.which("simpleFoam") is not None


def run_openfoam(folder: str | Path, iterations: int, observer: Observer | None = None) -> None:
    """Run the case in a folder, from where it stopped if it did, to its end.

    Raises
    ------
    SolveError
        If there is no OpenFOAM, or it fails.
    """
    if not has_openfoam():
        raise SolveError(
            f"The case is in {str(folder)!r}, but there is no simpleFoam on the path to run it: 'apt-get install "
            "openfoam' brings it, or run Allrun where it is."
        )
    observer, folder = observer or Observer(), Path(folder).resolve()
    environment = dict(os.environ)
    if "WM_PROJECT_DIR" not in environment and _DEBIAN.exists():
        environment["WM_PROJECT_DIR"] = str(_DEBIAN)
    observer.begin("simpleFoam", iterations)
    process = subprocess.Popen(["./Allrun"], cwd=folder, env=environment, start_new_session=True)
    interrupted, shown = True, 0
    try:
        while process.poll() is None:
            time.sleep(0.5)
            for _ in range(shown, done := _steps(folder)):
                observer.item(None)
            shown = max(shown, done)
        interrupted = False
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGTERM)  # the script and what it runs
            process.wait()
        observer.end(interrupted)
    if process.returncode:
        raise SolveError(f"OpenFOAM failed on the case in {str(folder)!r}: {_reason(folder)}; see its log files.")


def _steps(folder: Path) -> int:
    """Iterations that the solver's log tells of."""
    try:
        with open(folder / "log.simpleFoam", "rb") as log:
            log.seek(max(0, (folder / "log.simpleFoam").stat().st_size - 4000))
            found = _STEP.findall(log.read().decode(errors="ignore"))
    except OSError:
        return 0
    return int(found[-1]) if found else 0


def _reason(folder: Path) -> str:
    """The line of a log that tells most."""
    for name in ("log.simpleFoam", "log.checkMesh"):
        path = folder / name
        lines = path.read_text(errors="ignore").splitlines() if path.exists() else []
        for number, line in enumerate(lines):
            if "FATAL" in line:
                return " ".join(" ".join(lines[number : number + 3]).split())[:200].rstrip(".")
            if "Floating point exception" in line or "sigFpe" in line:
                return "the iteration grew without bound"
    return "it gives no reason"
