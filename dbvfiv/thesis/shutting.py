"""Fig. 3-21: the valve under back pressure."""

from __future__ import annotations

from dataclasses import replace

from ..report.content import pictures_of
from .entry import Entry, Number, Outcome
from .workshop import Workshop

_PRESSURES = (7e3, 14e3, 21e3, 28e3)


def back_pressure(workshop: Workshop) -> Outcome:
    """The shut valve at four back pressures, held as the thesis holds it and with contact of the inner faces."""
    told, numbers, pictures = [], [], []
    for supports, words in (("held-lips", "held as in the thesis"), ("contact", "with contact of the inner faces")):
        result = workshop.closure({"closure.pressures": list(_PRESSURES), "closure.supports": supports})
        for s in result.states:
            numbers.append(
                Number(
                    f"largest displacement at {s.pressure / 1e3:g} kPa, {words}", 1e3 * s.max_displacement, None, "mm"
                )
            )
        views = pictures_of(result, {"side-views": f"Lips {words}."})
        pictures += [replace(view, name=f"{view.name}-{supports}") for view in views]  # figures are numbered by name
        told += [f"Lips {words}: {line}" for line in result.remarks() if not line.startswith("Forces")]
    told.insert(
        0,
        "The thesis holds the duckbill shut, keeps the mid-surface of the saddle from crossing y = 0, looks at "
        "no buckling, and "
        "sees the walls of the saddle touch at about 21 kPa; it prints no numbers.",
    )
    return Outcome(tuple(told), tuple(numbers), tuple(pictures))


ENTRIES = (Entry("3-21", "back pressure", back_pressure),)
