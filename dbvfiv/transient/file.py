"""The result file of a run, written while it goes on and never broken by being killed.

The file is in HDF5's single-writer mode: whatever has been written, in whatever order the process ends, can be read.
All its datasets exist from the start, as nothing can be added in that mode. Two restart slots are written in turn, each
with a checksum, so that one of them is whole at any time.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from time import monotonic
from typing import Any

import h5py
import numpy as np

from ..errors import CaseError
from ..model import ValveModel
from ..observer import Observer
from ..record.files import create, reading, refuse_foreign
from ..record.header import Header, write_header
from ..record.layout import Column, read_texts, replace_texts
from ..record.mesh import MeshData, write_mesh
from .assess import RunVerdict
from .history import PROFILES, SCALARS
from .run import TransientRun
from .state import MotionState

#: Full states.
STATES = (
    Column("time", "s", "Time"),
    Column("nodal", "m, rad", "Displacements ux uy uz and two rotations of each node"),
    Column("nodal_rate", "m/s, rad/s", "Their rates"),
    Column("station_pressure", "Pa", "Pressure at each row"),
    Column("station_area", "m^2", "Flow area of a quarter at each row"),
    Column("inlet_velocity", "m/s", "Velocity at the flange"),
)
_VERDICT_BYTES = 65536
_CHUNK = 512


class TransientFile(Observer):
    """Keeps a run (`dbvfiv.transient.run.Keeper`); a context manager.

    Parameters
    ----------
    path : path
    model : ValveModel
    header : Header, optional
    seconds : float
        The history is written out at least this often, for whoever watches.

    Raises
    ------
    CaseError
        If the file cannot be written.
    """

    def __init__(self, path: str | Path, model: ValveModel, header: Header | None = None, seconds: float = 5.0):
        self.model, self.path, self.seconds = model, Path(path), seconds
        self._warnings: list[str] = []
        self._slot = 0
        header = header or Header.of("transient", model.case)
        if header.kind != "transient":
            raise ValueError("A transient file needs a header of kind 'transient'.")
        refuse_foreign(self.path)
        # under another name until all datasets are there: before that, being killed would leave half a file
        new = self._beside(self.path, "new")
        try:
            with create(new, single_writer=True) as file:
                _write_empty(file, model, replace(header, complete=False))
            os.replace(new, self.path)
        finally:
            new.unlink(missing_ok=True)
        self._open()

    @staticmethod
    def _beside(path: Path, use: str) -> Path:
        return path.with_name(f".{path.name}.{os.getpid()}.{use}")

    def _open(self) -> None:
        self._written = monotonic()
        self._file = h5py.File(self.path, "r+", libver="latest")
        self._file.swmr_mode = True
        self._history, self._states = self._file["history"], self._file["states"]

    # -- what a run tells
    # ----

    def rows(self, columns: Mapping[str, np.ndarray]) -> None:
        _append(self._history, columns)
        self._file.flush()
        self._written = monotonic()

    def due(self) -> bool:
        """Whether rows have been held back long enough."""
        return monotonic() - self._written > self.seconds

    def state(self, state: MotionState, row: Mapping[str, Any]) -> None:
        model = self.model
        values = {
            "time": state.time,
            "nodal": model.nodal(state.q),
            "nodal_rate": model.nodal(state.v),
            "station_pressure": row["station_pressure"],
            "station_area": row["station_area"],
            "inlet_velocity": row["inlet_velocity"],
        }
        _append(self._states, {name: np.asarray(value, float)[None] for name, value in values.items()})

    def restart(self, numbers: np.ndarray, rows: int) -> None:
        self._file.flush()  # what came before is in the file before the slot says so
        slot = self._file[f"restart/{self._slot % 2}"]
        slot[:] = _sealed(numbers, self._slot + 1, rows, len(self._states["time"]))
        self._file.flush()
        self._slot += 1

    def verdict(self, verdict: RunVerdict) -> None:
        text = json.dumps(verdict.summary()).encode()
        self._file["verdict"][()] = np.bytes_(text.ljust(1, b" ")[:_VERDICT_BYTES])

    def warn(self, sentence: str) -> None:
        if sentence not in self._warnings:
            self._warnings.append(sentence)

    # -- the end
    # ----

    def conclude(self, run: TransientRun) -> None:
        """Note how the run ended."""
        self.close()
        with h5py.File(self.path, "r+", libver="latest") as file:
            replace_texts(file["messages"], "warnings", [w for w in self._warnings if w not in run.failures])
            replace_texts(file["messages"], "failures", run.failures)
            file.attrs["complete"] = not run.interrupted and not run.failures

    def close(self) -> None:
        if self._file:
            self._file.close()

    def __enter__(self) -> TransientFile:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    # -- going on
    # ----

    @classmethod
    def reopen(
        cls, path: str | Path, model: ValveModel, header: Header, seconds: float = 5.0
    ) -> tuple[TransientFile, Restart]:
        """Open the file of an earlier run at its last restart point.

        The file is copied up to there and then replaced, so that being killed meanwhile does no harm either.

        The file must have a restart point.
        """
        path = Path(path)
        restart = read_restart(path)
        copy = cls._beside(path, "resuming")
        try:
            with reading(path) as old, h5py.File(copy, "w", libver="latest") as new:
                _write_empty(new, model, replace(header, complete=False))
                _copy(old["history"], new["history"], restart.rows)
                _copy(old["states"], new["states"], restart.states)
                for slot in ("0", "1"):
                    new[f"restart/{slot}"][:] = old[f"restart/{slot}"][:]
                # sentences on the part that is done are made anew at the end
                warnings = [
                    text for text in read_texts(old, "messages/warnings") if not text.startswith("Pressures fall")
                ]
            os.replace(copy, path)
        finally:
            copy.unlink(missing_ok=True)
        self = cls.__new__(cls)
        self.model, self.path, self.seconds = model, path, seconds
        self._warnings, self._slot = list(warnings), restart.sequence
        self._open()
        return self, restart


class Restart:
    """A restart point.

    Attributes
    ----------
    sequence : int
        Restart points written so far.
    rows, states : int
        Rows of the history and full states up to it.
    numbers : array
        See `dbvfiv.transient.run.Progress`.
    """

    def __init__(self, sealed: np.ndarray):
        self.sequence, self.rows, self.states = (int(value) for value in sealed[:3])
        self.numbers = np.array(sealed[4:])


def read_restart(path: str | Path) -> Restart | None:
    """Last whole restart point of a file; None if the run was killed before its first.

    Raises
    ------
    CaseError
        If the file is no transient run.
    """
    with reading(path) as file:
        if str(file.attrs["dbvfiv_kind"]) != "transient":
            raise CaseError(
                f"{str(path)!r} holds a result of kind {str(file.attrs['dbvfiv_kind'])!r}; only transient "
                f"runs can be resumed."
            )
        slots = [file[f"restart/{slot}"][:] for slot in ("0", "1")]
    whole = [slot for slot in slots if _whole(slot)]
    return Restart(max(whole, key=lambda slot: slot[0])) if whole else None


def _sealed(numbers: np.ndarray, *head: int) -> np.ndarray:
    body = np.concatenate([[float(value) for value in head], [0.0], numbers])
    body[3] = zlib.crc32(np.delete(body, 3).tobytes())
    return body


def _whole(slot: np.ndarray) -> bool:
    return slot[0] > 0 and slot[3] == zlib.crc32(np.delete(slot, 3).tobytes())


def _write_empty(file: h5py.File, model: ValveModel, header: Header) -> None:
    """All groups and datasets of a run that has not begun."""
    from .run import Progress

    write_header(file, header)
    write_mesh(file, MeshData.of(model))
    messages = file.create_group("messages")
    replace_texts(messages, "warnings", ())
    replace_texts(messages, "failures", ())
    stations, nodes = model.stations, len(model.mesh.nodes)
    history = file.create_group("history")
    for column in (*SCALARS, *PROFILES):
        _empty(history, column, (stations,) if column in PROFILES else (), _CHUNK)
    states = file.create_group("states")
    shapes = {
        "nodal": (nodes, 5),
        "nodal_rate": (nodes, 5),
        "station_pressure": (stations,),
        "station_area": (stations,),
    }
    for column in STATES:
        _empty(states, column, shapes.get(column.name, ()), 1 if column.name.startswith("nodal") else 64)
    zero = np.zeros(model.size)
    still = MotionState(0.0, 0.0, zero, zero, zero, zero, zero, zero, np.zeros(stations), np.zeros(stations))
    length = len(_sealed(Progress(still).pack(), 0, 0, 0))
    for slot in ("0", "1"):
        file.create_dataset(f"restart/{slot}", data=np.zeros(length))
    file.create_dataset("verdict", data=np.bytes_(b"{}"), dtype=f"S{_VERDICT_BYTES}")


def _empty(group: h5py.Group, column: Column, shape: tuple[int, ...], chunk: int) -> None:
    dataset = group.create_dataset(
        column.name, (0, *shape), column.dtype, maxshape=(None, *shape), chunks=(chunk, *shape)
    )
    column.mark(dataset)


def _append(group: h5py.Group, columns: Mapping[str, np.ndarray]) -> None:
    """Add rows; the time comes last, and rows count only once it has them."""
    for name in sorted(columns, key=lambda name: name == "time"):
        values, dataset = columns[name], group[name]
        if len(values):
            before = len(group["time"])
            dataset.resize(before + len(values), axis=0)
            dataset[before:] = values


def _copy(old: h5py.Group, new: h5py.Group, rows: int, block: int = 256) -> None:
    for start in range(0, rows, block):
        stop = min(rows, start + block)
        _append(new, {name: old[name][start:stop] for name in new})
