"""Part of the report on the damping of the wall."""

from __future__ import annotations

from ...drawing.damping import damping_figure
from ...errors import CaseError
from ...materials.damping_report import describe_damping
from ..content import Part, picture
from ..gather import Gathered


def part(found: Gathered) -> Part | None:
    """Part on the damping of the case, on which every verdict on vibration rests."""
    try:
        report = describe_damping(found.case)
    except CaseError as error:
        return Part("damping", "Damping", (str(error),))
    frequencies = [m.frequency for m in found.modes.modes if m.frequency > 0] if found.modes else []
    lines = tuple(report.lines(None))
    caption = "Damping ratio of the wall over frequency."
    if frequencies:
        caption += f" The modes above lie between {min(frequencies):.3g} and {max(frequencies):.3g} Hz."
    return Part(
        "damping", "Damping", pictures=(picture("damping", caption, lambda: damping_figure(report)),), listing=lines
    )
