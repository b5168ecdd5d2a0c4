"""Onsets and stability maps of a valve, with or without a result file, and runs that go on."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .case.model import Case
from .errors import CaseError
from .observer import Observer, Observers

if TYPE_CHECKING:
    from .results.map import MapResults
    from .results.onset import OnsetResults


def onset(
    case: Case, name: str = "case", output: str | Path | None = None, observer: Observer | None = None
) -> OnsetResults:
    """Onsets along the parameter of `case.onset`.

    Parameters
    ----------
    case : Case
    name : str
        For titles.
    output : path, optional
        Result file, written sample by sample.
    observer : Observer, optional

    Raises
    ------
    CaseError, SolveError

    Examples
    --------
    >>> from dbvfiv.case import load_case
    >>> found = onset(load_case(None, ["onset.over=density", "drive.pressure=6 kPa"]))      # doctest: +SKIP
    >>> [(p["value"], p["frequency"]) for p in found.points]                                # doctest: +SKIP
    """
    from .api import Valve
    from .record.header import Header
    from .record.mesh import MeshData
    from .results.onset import OnsetResults
    from .results.onset_file import OnsetFile
    from .studies.onset import run_onset

    observer = observer or Observer()
    model = Valve(case, name).model
    header = Header.of("onset", case, name)
    if output is None:
        return OnsetResults.of(run_onset(case, observer=observer), header, model)
    with OnsetFile(output, header, MeshData.of(model)) as file:
        result = run_onset(case, observer=Observers(file, observer))
        file.conclude(result)
    return OnsetResults.of(result, header, model)


def resume_onset(path: str | Path, observer: Observer | None = None) -> OnsetResults:
    """Go on with an interrupted or killed onset run; samples and points in its file are not solved again.

    Raises
    ------
    CaseError
        If the file holds no onset run, or one that had gone to its end.
    """
    from .api import Valve
    from .record.mesh import MeshData
    from .results.onset import OnsetResults
    from .results.onset_file import OnsetFile, known_items
    from .studies.onset import run_onset

    observer = observer or Observer()
    known, header, complete = known_items(path)
    if complete:
        raise CaseError(f"The onset run in {str(path)!r} had gone to its end; there is nothing to resume.")
    case = header.rebuildable_case()
    model = Valve(case, header.name).model
    with OnsetFile(path, header, MeshData.of(model), again=True) as file:
        result = run_onset(case, observer=Observers(file, observer), known=known)
        file.conclude(result)
    return OnsetResults.of(result, header, model)


def stability_map(
    case: Case,
    name: str = "case",
    output: str | Path | None = None,
    observer: Observer | None = None,
    workers: int | None = None,
) -> MapResults:
    """The stability map of `case.map`.

    Parameters
    ----------
    workers : int, optional
        Processes that share the columns; those of the case by default. Under ``mpiexec`` with mpi4py all its processes.

    Raises
    ------
    CaseError, SolveError
    """
    from .api import Valve
    from .record.header import Header
    from .record.mesh import MeshData
    from .results.map import MapResults
    from .results.map_file import MapFile
    from .studies.map import run_map
    from .studies.map_column import MapPlan

    observer = observer or Observer()
    mesh = MeshData.of(Valve(case, name).model)
    header = Header.of("map", case, name)
    if output is None:
        return MapResults.of(run_map(case, observer, workers), header, mesh)
    with MapFile(output, MapPlan.of(case), header, mesh) as file:
        result = run_map(case, Observers(file, observer), workers)
        file.conclude(result)
    return MapResults.of(result, header, mesh)


def resume_map(path: str | Path, observer: Observer | None = None, workers: int | None = None) -> MapResults:
    """Go on with an interrupted or killed map; finished columns are not solved again.

    Raises
    ------
    CaseError
        If the file holds no map, or one that had gone to its end.
    """
    from .api import Valve
    from .record.mesh import MeshData
    from .results.map import MapResults
    from .results.map_file import MapFile, known_columns
    from .studies.map import run_map
    from .studies.map_column import MapPlan

    observer = observer or Observer()
    known, header, complete = known_columns(path)
    if complete:
        raise CaseError(f"The map in {str(path)!r} had gone to its end; there is nothing to resume.")
    case = header.rebuildable_case()
    mesh = MeshData.of(Valve(case, header.name).model)
    with MapFile(path, MapPlan.of(case), header, mesh, again=True) as file:
        result = run_map(case, Observers(file, observer), workers, known)
        file.conclude(result)
    return MapResults.of(result, header, mesh)
