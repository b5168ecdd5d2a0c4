"""Header of every result file: kind, case with the files that it names, versions and completeness of the run."""

from __future__ import annotations

import hashlib
import json
import platform
import shlex
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from .. import __version__
from ..case.model import Case
from ..case.write import case_toml
from ..errors import CaseError
from ..runtime import cache_directory
from ..texts import shortly
from .table import LAYOUT


@dataclass(frozen=True)
class Attachment:
    """A file of a case.

    Attributes
    ----------
    path : str
        As the case names it.
    text : str
        Its contents.
    """

    path: str
    text: str

    def place(self) -> str:
        """Name of a file with these contents: the original one, or a copy in the cache folder."""
        if _text(Path(self.path)) == self.text:
            return self.path
        digest = hashlib.sha256(self.text.encode()).hexdigest()[:16]
        copy = cache_directory() / "attachments" / digest / Path(self.path).name
        if _text(copy) != self.text:
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_text(self.text, encoding="utf-8", newline="")
        return str(copy)


def attachments_of(case: Case) -> tuple[Attachment, ...]:
    """The files that a case names, each once."""
    paths = dict.fromkeys(str(path) for path in _paths(case))
    texts = {path: _text(Path(path)) for path in paths}
    return tuple(Attachment(path, text) for path, text in texts.items() if text is not None)


def placed(data: Any, attachments: tuple[Attachment, ...]) -> Any:
    """Plain data of a case with the names of its files replaced by names of files that exist."""
    if isinstance(data, dict):
        return {name: placed(value, attachments) for name, value in data.items()}
    if isinstance(data, list):
        return [placed(value, attachments) for value in data]
    return next((a.place() for a in attachments if a.path == data), data) if isinstance(data, str) else data


def _paths(value: Any) -> Iterator[Path]:
    if isinstance(value, Path):
        yield value
    elif hasattr(type(value), "model_fields"):
        for name in type(value).model_fields:
            yield from _paths(getattr(value, name))
    elif isinstance(value, dict):
        for item in value.values():
            yield from _paths(item)
    elif isinstance(value, (list, tuple)):
        for item in value:
            yield from _paths(item)


def _text(path: Path) -> str | None:
    try:
        return path.read_bytes().decode("utf-8")
    except (OSError, UnicodeDecodeError):
        return None


_PACKAGES = ("numpy", "scipy", "jax", "jaxlib", "numba", "h5py")


@shortly
@dataclass(frozen=True)
class Header:
    """Provenance of a result.

    Attributes
    ----------
    kind : str
        "steady", "modes", ...; see `dbvfiv.studies.KINDS`.
    case : Case
        Complete, its defaults included.
    name : str
        Name of the case file, without folder and ending.
    program : str
        Name and version of the program that wrote the file.
    created : str
        ISO 8601, UTC.
    command : str
        Command line.
    versions : dict of str
    attachments : tuple of Attachment
        Files that the case names.
    complete : bool
        True where the run went to its end.
    layout : int
    """

    kind: str
    case: Case
    name: str = "case"
    program: str = f"dbvfiv {__version__}"
    created: str = field(default_factory=lambda: datetime.now(UTC).isoformat(timespec="seconds"))
    command: str = field(default_factory=lambda: shlex.join(["dbvfiv", *sys.argv[1:]]))
    versions: dict[str, str] = field(default_factory=lambda: versions())
    attachments: tuple[Attachment, ...] = ()
    complete: bool = False
    layout: int = LAYOUT

    @classmethod
    def of(cls, kind: str, case: Case, name: str = "case", complete: bool = False) -> Header:
        """Header of a run that happens now."""
        return cls(kind, case, name, attachments=attachments_of(case), complete=complete)

    def rebuildable_case(self) -> Case:
        """The case, with files that have gone or changed since put back from the attachments."""
        if not self.attachments:
            return self.case
        return type(self.case).from_dict(placed(self.case.to_dict(), self.attachments))


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
    files = case.create_group("files")
    for number, attachment in enumerate(header.attachments):
        dataset = files.create_dataset(str(number), data=attachment.text, dtype=h5py.string_dtype())
        dataset.attrs["path"] = attachment.path
    group = file.create_group("versions")
    for name, version in header.versions.items():
        group.attrs[name] = version


def read_header(file: h5py.File, case_model: type[Case]) -> Header:
    """Read what `write_header` wrote; the case has the sections of the model given."""
    attributes = file.attrs
    files = file["case/files"]
    attached = [files[name] for name in sorted(files, key=int)]
    return Header(
        kind=str(attributes["dbvfiv_kind"]),
        case=_case(file["case/json"].asstr()[()], case_model),
        versions={name: str(version) for name, version in file["versions"].attrs.items()},
        attachments=tuple(Attachment(str(d.attrs["path"]), d.asstr()[()]) for d in attached),
        complete=bool(attributes["complete"]),
        layout=int(attributes["layout"]),
        **{name: str(attributes[name]) for name in ("name", "program", "created", "command")},
    )


#: Keys that earlier versions wrote with every case and that no study asks for now.
GONE = {
    "closure": ("contact_depth", "penetration", "balance_tolerance", "start", "open_pressure")
    + ("reversal_time", "reversal_hold", "reversal_continuity"),
}


def _case(text: str, model: type[Case]) -> Case:
    data = json.loads(text)
    for section, names in GONE.items():
        for name in names:
            data.get(section, {}).pop(name, None)
    try:
        return model.from_dict(data)
    except CaseError as error:  # not the user's slip but the file's
        raise ValueError(f"its case cannot be used, {error}") from error
