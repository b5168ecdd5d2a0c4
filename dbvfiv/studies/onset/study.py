"""Run of the onset study: finds onsets along one parameter and keeps them in a record."""

from __future__ import annotations

from dataclasses import replace

from ...errors import CaseError
from ...observer import Observers
from ...record.record import GrowingRecord
from ..case import Case
from ..session import Session
from ..stability.classes import NOTE as CLASS
from ..stability.classes import classes_to_look_at
from ..stability.laws import other_law, require_two_laws
from ..stability.walk import StabilityWalk
from ..study import Study
from .classes import note_of_class
from .other_law import NOTE, note_of
from .result import OnsetResult
from .rows import KeepItems, known_items, tables_of
from .run import run_onset
from .search import OnsetOptions


def run(session: Session, record: GrowingRecord) -> None:
    """Onsets along `onset.over` of the case, under both continuity laws where that is asked for; every sample and point
    of its own law is kept as it is found.
    """
    both = session.case.onset.continuity == "both"
    if both:
        _require_two_laws(session.case)
    walk = StabilityWalk(session.case, record, session.model)
    found = run_onset(
        session.case,
        observer=Observers(KeepItems(record), record),
        known=known_items(record, session.case),
        walk=walk,
    )
    for sentence in found.failures:
        record.fail(sentence)
    if found.interrupted:
        raise KeyboardInterrupt
    _look_at_classes(session, record, walk)
    if both and not record.notes(NOTE):
        record.progress("the other continuity law")
        other = session.replace({"fluid.continuity": other_law(session.case)})
        found = run_onset(other.case, walk=StabilityWalk(other.case, record, other.model))
        if found.interrupted:
            raise KeyboardInterrupt
        record.note(NOTE, **note_of(found))


def _look_at_classes(session: Session, record: GrowingRecord, walk: StabilityWalk) -> None:
    """Onsets in the other classes of motion, where they are asked for. Cycles that leave the symmetry have normal forms
    of their own, which are not looked for.
    """
    for symmetry in classes_to_look_at(record, session.case.onset.symmetry, session.case.part):
        options = replace(OnsetOptions.of(session.case), normal_form=False, symmetry=symmetry.name)
        found = run_onset(session.case, options, walk=walk.in_class(symmetry))
        for sentence in found.failures:
            record.fail(f"In class {symmetry.name}: {sentence}")
        for sentence in found.warnings:
            record.warn(f"In class {symmetry.name}: {sentence}")
        if found.interrupted:
            raise KeyboardInterrupt
        record.note(CLASS, **note_of_class(found))


def _require_two_laws(case: Case) -> None:
    """Refuse to compare laws along their own blend, and without any at work.

    Raises
    ------
    CaseError
    """
    require_two_laws(case, "onset")
    if case.onset.axis.parameter == "storage":
        raise CaseError(
            "onset.continuity is given as 'both', but onset.over moves the continuity law itself; it must be 'case' "
            "then.",
            key="onset.continuity",
        )


STUDY = Study("onset", tables_of, run, OnsetResult)
