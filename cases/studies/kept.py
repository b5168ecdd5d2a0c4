"""Transient runs kept in files, so that a study that is started again goes on where it was."""

from __future__ import annotations

from pathlib import Path

import dbvfiv
from dbvfiv.api import Valve
from dbvfiv.studies.case import thesis_case


def takes_keys(parser) -> None:
    """Let a study take `--set KEY=VALUE` as the command line does."""
    parser.add_argument(
        "--set", action="append", default=[], dest="keys", metavar="KEY=VALUE", help="a key of the case"
    )


def base_case(given):
    """The 12-inch valve with the keys given on the command line of a study."""
    return thesis_case(given.keys)


def kept_run(case, path: Path, observer=None):
    """Result of a case's run from its file, after finishing the run or making it where need be.

    Raises
    ------
    SystemExit
        If the file holds a run of another case.
    """
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        return Valve(case, path.stem).transient(output=path, observer=observer)
    result = dbvfiv.load_result(path)
    kept, wanted = result.case.to_dict(), case.to_dict()
    longer = case.transient.duration > result.case.transient.duration
    for one in (kept, wanted):
        for name in (
            "start_file",
            "duration",
        ):  # paths may be written relative to another folder; runs may be carried on
            one["transient"].pop(name, None)
    if kept != wanted:
        raise SystemExit(f"{path} holds a run of another case; move it away or choose another folder.")
    ended = result.complete and not (longer and result.verdict["verdict"] not in case.transient.stop_when)
    return (
        result
        if ended or result.failures
        else dbvfiv.resume(
            path, duration=max(case.transient.duration, result.case.transient.duration), observer=observer
        )
    )
