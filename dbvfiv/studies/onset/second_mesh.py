"""The uncertainty that the mesh leaves in an onset, from a second, coarser one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...errors import SolveError
from ...observer import Observer
from ..case import Case
from ..stability.crossings import locate
from .point import COARSE, OnsetPoint
from .search import OnsetOptions, OnsetSearch

#: Order at which results of the four-node shell converge with the mesh size.
ORDER = 2.0
#: Ratio of mesh widths below which a second mesh says nothing.
LEAST_RATIO = 1.15
#: Relative accuracy of onsets on the second mesh.
LOCATED = 1e-6
#: Largest relative difference of frequencies of one onset on two meshes.
ALIKE = 0.25


def coarse_case(case: Case, share: float) -> tuple[Case, float]:
    """The case on fewer elements, and the ratio of mesh widths."""
    mesh = case.mesh
    around, along = (max(6, int(round(share * n))) for n in (mesh.around, mesh.along))
    return case.replace({"mesh.around": around, "mesh.along": along}), float(
        np.sqrt(mesh.around * mesh.along / (around * along))
    )


def with_uncertainty(
    case: Case, options: OnsetOptions, points: list[OnsetPoint], observer: Observer, warnings: list[str], known=()
) -> list[OnsetPoint]:
    """Onsets again on a coarser mesh, matched by frequency and direction; Richardson's rule with the order of the
    element.

    Parameters
    ----------
    observer : Observer
        Told of the samples on that mesh, and again of each point.
    known : iterable of OnsetSample and OnsetPoint
        Of an interrupted run.
    """
    coarse, ratio = coarse_case(case, options.coarse_mesh)
    if ratio < LEAST_RATIO:
        warnings.append("The mesh is too coarse for a second one, so onsets carry no uncertainty.")
        return points
    size = f"{coarse.mesh.around} x {coarse.mesh.along}"
    observer.progress(f"second mesh, {size}")
    search = OnsetSearch(coarse, replace(options, normal_form=False), observer, known=known, mesh=COARSE)
    found = []
    for crossing in search.scan.run(options.values):
        try:
            value = locate(search.scan, crossing, LOCATED)
            expected = complex(search.scan.within(value).eigenvalues[crossing.index])
            eigenvalue = search.critical(search.place(value), expected).eigenvalue
        except SolveError:
            continue
        found.append((value, abs(eigenvalue.imag) / (2 * np.pi), crossing.high.unstable > crossing.low.unstable))
    done = []
    for point in points:
        alike = [
            c for c in found if c[2] == point.gains and abs(c[1] - point.frequency) <= ALIKE * max(point.frequency, 1.0)
        ]
        if alike:
            value = min(alike, key=lambda c: abs(c[0] - point.value))[0]
            found = [c for c in found if c[0] != value]
            point = replace(point, coarse_value=value, uncertainty=abs(point.value - value) / (ratio**ORDER - 1.0))
        else:
            sentence = f"The mesh of {size} has no onset like it, so its uncertainty is unknown."
            point = replace(point, note=point.note if sentence in point.note else f"{point.note} {sentence}".strip())
        observer.item(point)
        done.append(point)
    return done
