"""Run of the onset study: finds onsets along one parameter and keeps them in a record."""

from __future__ import annotations

from dataclasses import replace

from ...errors import CaseError
from ...model.symmetry import Symmetry
from ...observer import Observers
from ...record.record import GrowingRecord
from ..case import Case
from ..session import Session
from ..stability.dimensions import LAW, add_classes, other_law, require_two_laws
from ..stability.walk import StabilityWalk
from ..study import Study
from .line import FoundOnsets
from .point import KeepItems, known_items, tables_of
from .result import OnsetResult
from .search import OnsetOptions, run_onset


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

    def find(symmetry: Symmetry) -> FoundOnsets:
        # cycles that leave the symmetry have normal forms of their own, which are not looked for
        options = replace(OnsetOptions.of(session.case), normal_form=False, symmetry=symmetry.name)
        return run_onset(session.case, options, walk=walk.in_class(symmetry))

    add_classes(record, session.case.onset.symmetry, session.case.part, find)
    if both and not record.notes(LAW):
        record.progress("the other continuity law")
        other = session.replace({"fluid.continuity": other_law(session.case)})
        found = run_onset(other.case, walk=StabilityWalk(other.case, record, other.model))
        if found.interrupted:
            raise KeyboardInterrupt
        record.note(LAW, continuity=other.case.fluid.continuity, **found.note())


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
