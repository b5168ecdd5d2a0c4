"""Result files: opening, naming and locking with one writer, signals deferred until a write is complete; the header of
each, kind, case with the files that it names, versions and completeness of the run.
"""

from __future__ import annotations

import errno
import fcntl
import hashlib
import json
import os
import platform
import shlex
import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from time import sleep
from types import FrameType, TracebackType
from typing import Any

import h5py
import numpy as np

from .. import __version__
from ..case.distribution import samples_file
from ..case.model import Case
from ..case.write import case_toml
from ..errors import CaseError, as_path
from ..runtime import cache_directory
from ..texts import shortly
from .table import LAYOUT

_HELD = (signal.SIGINT, signal.SIGTERM)


class DeferredSignals:
    """Context that defers Ctrl-C (SIGINT) and SIGTERM until it is left; not to be nested or shared.

    Python handles signals in its main thread alone, so in other threads the context does nothing. Nor does it for
    signals that this process ignores or that end it without a Python handler.
    """

    def __init__(self):
        self._before: dict[int, object] = {}
        self._heard: list[tuple[int, FrameType | None]] = []

    def __enter__(self) -> None:
        if threading.current_thread() is not threading.main_thread():
            return
        for number in _HELD:
            before = signal.getsignal(number)
            if callable(before):
                self._before[number] = before
                signal.signal(number, self._hear)

    def _hear(self, number: int, frame: FrameType | None) -> None:
        self._heard.append((number, frame))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        before, self._before = self._before, {}
        for number, handler in before.items():
            signal.signal(number, handler)
        heard, self._heard = self._heard, []
        for number, frame in heard[:1]:
            before[number](number, frame)


#: Readers that ask whether a file is being written hold it for an instant: so often a writer tries, s apart.
_LOCK_TRIES, _LOCK_PAUSE = 5, 0.02
#: What a file system says that knows no files without a name.
_NO_NAMELESS = (errno.EOPNOTSUPP, errno.EISDIR, errno.EINVAL, errno.ENOENT)


class WriterLock:
    """The right to write a result of some name, held by this process until it is released or the process ends. Raises
    CaseError if another process holds it, or the folder cannot be written.

    An empty file takes the name where there was none. The lock sits on the file that has the name, so it moves to the
    new file when that takes the old one's place (`move`).
    """

    def __init__(self, path: Path):
        self.path = path
        self._descriptor = self._taken()

    def _taken(self) -> int:
        while True:
            try:
                descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
            except OSError as error:
                raise unwritable(self.path, error) from None
            try:
                _lock(descriptor, self.path)
                if os.path.samestat(os.stat(self.path), os.fstat(descriptor)):
                    return descriptor
            except FileNotFoundError:  # replaced or removed meanwhile
                pass
            except BaseException:
                os.close(descriptor)
                raise
            os.close(descriptor)

    def move(self, new: Path) -> None:
        """Let a finished file take the name, and hold it instead."""
        descriptor = os.open(new, os.O_RDWR)
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.replace(new, self.path)
        os.close(self._descriptor)
        self._descriptor = descriptor

    def release(self) -> None:
        """Let others write; an empty file that only held the name goes."""
        if self._descriptor < 0:
            return
        try:
            if os.fstat(self._descriptor).st_size == 0 and self.path.exists():
                self.path.unlink()
        finally:
            os.close(self._descriptor)
            self._descriptor = -1


def check_folder(folder: Path) -> None:
    """Try a file without a name in a folder, or in the nearest that there is: nothing can stay behind of it."""
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, f"{str(folder)!r} is not a folder")
    try:
        os.close(os.open(folder, os.O_TMPFILE | os.O_RDWR, 0o600))
    except OSError as error:
        if error.errno not in _NO_NAMELESS:
            raise
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES)) from None


def _lock(descriptor: int, path: Path) -> None:
    for left in reversed(range(_LOCK_TRIES)):
        try:
            return fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if not left:
                raise CaseError(
                    f"{str(path)!r} is being written by another process; wait for it or choose another name."
                ) from None
            sleep(_LOCK_PAUSE)


def unwritable(path: Path, error: OSError) -> CaseError:
    """Error for a result file that cannot be written."""
    return CaseError(f"The result file {str(path)!r} cannot be written ({error.strerror}).")


def is_being_written(path: Path) -> bool:
    """True where a process holds the right to write a file."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False


#: A file that is being written is tried this often, s apart.
_TRIES, _PAUSE = 40, 0.02
#: What broken or foreign HDF5 files make h5py and the readers raise.
_BROKEN = (OSError, KeyError, RuntimeError, ValueError, TypeError, IndexError, AttributeError, MemoryError)


@contextmanager
def reading(path: str | Path) -> Iterator[h5py.File]:
    """An open result file; also one that another process is still writing. Raises CaseError if there is no such file,
    it is no result of this program, comes from a newer version, or is damaged.
    """
    path = as_path(path, "A result file")
    if path.is_dir():
        raise CaseError(f"{str(path)!r} is a folder and not a result file.")
    if not path.exists():
        raise CaseError(f"The result file {str(path)!r} does not exist.")
    _refuse_empty(path)
    try:
        file = _opened(path)
    except PermissionError:
        raise CaseError(f"The result file {str(path)!r} may not be read by this user.") from None
    except _BROKEN as error:
        if "truncated" in str(error):
            raise CaseError(f"{str(path)!r} is cut short, so nothing can be read from it.") from error
        if h5py.is_hdf5(path):
            raise CaseError(
                f"The result file {str(path)!r} cannot be opened; it is damaged or open for writing in this process."
            ) from error
        raise CaseError(f"{str(path)!r} is not a result file, because it is not HDF5.") from error
    with file:
        try:
            kind, layout = str(file.attrs["dbvfiv_kind"]), int(file.attrs["layout"])
        except _BROKEN as error:
            raise CaseError(f"{str(path)!r} is an HDF5 file but not a result of dbvfiv.") from error
        if layout > LAYOUT:
            raise CaseError(
                f"{str(path)!r} has file layout {layout} and this version reads up to {LAYOUT}; "
                f"it was written by {file.attrs.get('program', 'a newer program')}."
            )
        if layout < LAYOUT:
            raise older_program(path, file)
        try:
            yield file
        except CaseError:
            raise
        except _BROKEN as error:
            detail = " ".join(str(error).split())[:120].rstrip(".")
            raise CaseError(
                f"The {kind} result {str(path)!r} is damaged or cut short ({type(error).__name__}: {detail})."
            ) from error


def older_program(path: Path, file: h5py.File) -> CaseError:
    """Error for a result of an earlier version, which has other tables."""
    command = file.attrs.get("command", f"dbvfiv {file.attrs['dbvfiv_kind']}")
    return CaseError(
        f"{str(path)!r} was written by an older program ({file.attrs.get('program', 'unknown')}) and this "
        f"version cannot read it; make it anew with '{command}'."
    )


def _refuse_empty(path: Path) -> None:
    """An empty file holds the name of a run that has not begun."""
    if path.stat().st_size:
        return
    if is_being_written(path):
        raise CaseError(f"{str(path)!r} holds nothing yet, because its run is about to begin.")
    raise CaseError(
        f"{str(path)!r} is empty: if it is of a run, that was stopped before it began; a new run may take its name."
    )


def kind_of(path: str | Path) -> str:
    """Kind of study of a result file: "steady", "map", "transient" and so on. Raises CaseError: as `reading`."""
    with reading(path) as file:
        return str(file.attrs["dbvfiv_kind"])


def _opened(path: Path) -> h5py.File:
    """A file for reading; one in single-writer mode also while it is written, or after its writer was killed."""
    ended = False
    for _ in range(_TRIES):
        try:
            return h5py.File(path, "r", locking=False)
        except PermissionError:
            raise
        except OSError as error:
            plain = error
        if ended:
            break
        marked = _marked_as_open(path)  # reading a cut file as a growing one would never end
        if marked:
            try:
                return h5py.File(path, "r", locking=False, libver="latest", swmr=True)
            except OSError:
                pass
        # its writer may have closed it since it was tried first, so a file without one is tried once more
        ended = not marked or not is_being_written(path)
        sleep(_PAUSE)  # caught between two writes of the same instant
    raise plain


def _marked_as_open(path: Path) -> bool:
    """True where the file's superblock (version 3) says that a writer has not closed it."""
    with open(path, "rb") as file:
        head = file.read(12)
    return len(head) == 12 and head[8] == 3 and bool(head[11] & 0b101)


def check_writable(path: str | Path) -> None:
    """Make sure that a result may take this name, before anything is computed, and leave everything as it is. Raises
    CaseError if another process writes it, or the file or its folder cannot be written, or it is no result.
    """
    path = as_path(path, "A result file")
    try:
        if not path.is_dir():
            if path.exists():
                # first: a file that is being written is a result, however it reads at this instant
                descriptor = os.open(path, os.O_RDWR)
                try:
                    _lock(descriptor, path)
                finally:
                    os.close(descriptor)
            check_folder(path.absolute().parent)
    except OSError as error:
        raise unwritable(path, error) from None
    refuse_foreign(path)


def refuse_foreign(path: Path) -> None:
    """Check that a result may take this name. Raises CaseError if it is the name of a folder, of a device, or of a file
    that is no result.
    """
    if path.is_dir():
        raise CaseError(f"{str(path)!r} is a folder; the result needs the name of a file.")
    if path.exists() and not path.is_file():
        raise CaseError(f"{str(path)!r} is no file that can hold a result; choose another name.")
    if path.exists() and path.stat().st_size and not _replaceable(path):
        raise CaseError(
            f"{str(path)!r} exists and is not a result of dbvfiv, so it is not overwritten; choose another name."
        )


def _replaceable(path: Path) -> bool:
    if not h5py.is_hdf5(path):
        return False
    try:
        with _opened(path) as file:
            return "dbvfiv_kind" in file.attrs
    except _BROKEN:
        return path.suffix in (".h5", ".hdf5")  # HDF5 cut short


@dataclass(frozen=True)
class Attachment:
    """A file of a case."""

    path: str  #: As the case names it.
    data: bytes  #: Its contents.

    def place(self) -> str:
        """Name of a file with these contents: the original one, or a copy in the cache folder. Where that cannot be
        written the original name stands for a file that has gone. Raises CaseError where it cannot be written, and the
        original one has other contents now.
        """
        now = _contents(Path(self.path))
        if now == self.data:
            return self.path
        digest = hashlib.sha256(self.data).hexdigest()[:16]
        copy = cache_directory() / "attachments" / digest / Path(self.path).name
        try:
            if _contents(copy) != self.data:
                copy.parent.mkdir(parents=True, exist_ok=True)
                copy.write_bytes(self.data)
        except OSError as error:
            if now is not None:
                raise CaseError(
                    f"{self.path!r} has changed since the result was made, and what it held cannot be put into "
                    f"{str(copy.parent)!r} ({error.strerror}); DBVFIV_CACHE names another folder."
                ) from None
            return self.path
        return str(copy)


def attachments_of(case: Case) -> tuple[Attachment, ...]:
    """The files that a case names, each once; results of other runs are left where they are."""
    paths = dict.fromkeys(str(path) for path in _paths(case) if not h5py.is_hdf5(path))
    found = {path: _contents(Path(path)) for path in paths}
    return tuple(Attachment(path, data) for path, data in found.items() if data is not None)


def renamed(data: Any, names: Mapping[str, str]) -> Any:
    """Plain data of a case with the names of its files replaced by others."""
    if isinstance(data, dict):
        return {name: renamed(value, names) for name, value in data.items()}
    if isinstance(data, list):
        return [renamed(value, names) for value in data]
    if not isinstance(data, str):
        return data
    samples = samples_file(data)
    there = names.get(data if samples is None else str(samples))
    return data if there is None else there if samples is None else f"samples({there})"


def refuse_read(case: Case, path: str | Path | None, what: str = "The result") -> None:
    """Refuse the name of a file that a case reads, under whatever name. Raises CaseError."""
    path = None if path is None else as_path(path, "A result file")
    if path is not None and path.exists() and any(named.exists() and path.samefile(named) for named in _paths(case)):
        raise CaseError(f"{what} is given the name {str(path)!r}, a file that the case reads; choose another.")


def _paths(value: Any) -> Iterator[Path]:
    if isinstance(value, Path):
        yield value
    elif isinstance(value, str):
        if (samples := samples_file(value)) is not None:
            yield samples
    elif hasattr(type(value), "model_fields"):
        for name in type(value).model_fields:
            yield from _paths(getattr(value, name))
    elif isinstance(value, dict):
        for item in value.values():
            yield from _paths(item)
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from _paths(item)


def _contents(path: Path) -> bytes | None:
    try:
        return path.read_bytes()
    except (OSError, ValueError):  # no name of a file
        return None


_PACKAGES = ("numpy", "scipy", "jax", "jaxlib", "numba", "h5py")


@shortly
@dataclass(frozen=True)
class Header:
    """Provenance of a result."""

    kind: str  #: "steady", "modes", ...; see `dbvfiv.studies.KINDS`.
    case: Case  #: Complete, its defaults included.
    name: str = "case"  #: Name of the case file, without folder and ending.
    program: str = f"dbvfiv {__version__}"  #: Name and version of the program that wrote the file.
    created: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="seconds"))  #: ISO 8601, UTC.
    command: str = field(default_factory=lambda: shlex.join(["dbvfiv", *sys.argv[1:]]))  #: Command line.
    versions: dict[str, str] = field(default_factory=lambda: versions())
    attachments: tuple[Attachment, ...] = ()  #: Files that the case names.
    complete: bool = False  #: True where the run went to its end.
    layout: int = LAYOUT

    @classmethod
    def of(cls, kind: str, case: Case, name: str = "case") -> Header:
        """Header of a run that happens now."""
        return cls(kind, case, name, attachments=attachments_of(case))

    def rebuildable_case(self) -> Case:
        """The case, with files that have gone or changed since put back from the attachments."""
        if not self.attachments:
            return self.case
        data = renamed(self.case.to_dict(), {one.path: one.place() for one in self.attachments})
        return type(self.case).from_dict(data, self.case.given)


def versions() -> dict[str, str]:
    """Versions of everything numbers depend on."""
    found = {"dbvfiv": __version__, "python": platform.python_version(), "platform": platform.platform()}
    for name in _PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    try:
        from petsc4py import PETSc
    except ImportError:
        return found
    found["petsc"] = ".".join(map(str, PETSc.Sys.getVersion()))
    found["petsc scalar type"] = "complex" if np.dtype(PETSc.ScalarType).kind == "c" else "real"
    return found


def write_header(file: h5py.File, header: Header) -> None:
    """Write a header into an empty file."""
    attributes = file.attrs
    attributes["dbvfiv_kind"] = header.kind
    attributes["layout"] = header.layout
    attributes["complete"] = header.complete
    for name in ("name", "program", "created", "command"):
        attributes[name] = getattr(header, name)
    case = file.create_group("case")
    case["toml"] = case_toml(header.case, comments=False)
    case["json"] = json.dumps(header.case.to_dict())
    case["given"] = json.dumps(header.case.given)
    files = case.create_group("files")
    for number, attachment in enumerate(header.attachments):
        dataset = files.create_dataset(str(number), data=np.frombuffer(attachment.data, "u1"))
        dataset.attrs["path"] = attachment.path
    group = file.create_group("versions")
    for name, version in header.versions.items():
        group.attrs[name] = version


def read_header(file: h5py.File, case_model: type[Case]) -> Header:
    """Read what `write_header` wrote; the case has the sections of the model given, and it and its attachments name
    files that exist.
    """
    attributes = file.attrs
    files = file["case/files"]
    attached = [Attachment(str(files[name].attrs["path"]), _bytes_of(files[name])) for name in sorted(files, key=int)]
    places = {one.path: one.place() for one in attached}
    given = json.loads(file["case/given"].asstr()[()]) if "given" in file["case"] else None  # of an earlier version
    return Header(
        kind=str(attributes["dbvfiv_kind"]),
        case=_case(renamed(json.loads(file["case/json"].asstr()[()]), places), case_model, given),
        versions={name: str(version) for name, version in file["versions"].attrs.items()},
        attachments=tuple(replace(one, path=places[one.path]) for one in attached),
        complete=bool(attributes["complete"]),
        layout=int(attributes["layout"]),
        **{name: str(attributes[name]) for name in ("name", "program", "created", "command")},
    )


def _bytes_of(attached: h5py.Dataset) -> bytes:
    """Contents of a file, which earlier versions kept as a text."""
    if h5py.check_string_dtype(attached.dtype) is not None:
        return attached.asstr()[()].encode()
    return attached[()].tobytes()


#: Keys that earlier versions wrote with every case and that no study asks for now.
GONE = {
    "closure": ("contact_depth", "penetration", "balance_tolerance", "start", "open_pressure")
    + ("reversal_time", "reversal_hold", "reversal_continuity")
}


def _case(data: dict[str, Any], model: type[Case], given: dict[str, list[str]] | None) -> Case:
    for section, names in GONE.items():
        for name in names:
            data.get(section, {}).pop(name, None)
    # keys that said nothing beside others, which earlier versions took
    model.take_along(data)
    if data.get("mesh", {}).get("rows") == "uniform":
        data["mesh"].pop("breaks", None)
    if not data.get("fluid", {}).get("unsteady", True):
        data.get("transient", {}).pop("coupling", None)
    try:
        return model.from_dict(data, given)
    except CaseError as error:  # not the user's slip but the file's
        raise ValueError(f"its case cannot be used, {error}") from error
