"""Maps of 64 x 64 cells over pressure and density at 28 x 48: every cell with its certificate, against that many
independent eigenvalue solves; and whole maps with their exact onset curves.
"""

from __future__ import annotations

import multiprocessing
import resource
import time

import numpy as np

from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.map.column import MapPlan
from dbvfiv.studies.session import Session
from dbvfiv.studies.stability.walk import StabilityWalk
from eigen import Workspace, leading_modes

from .registry import Row, benchmark, seconds

CELLS = 64
SAMPLE = 20
WORKERS = 2


@benchmark("map")
def stability_map():
    """Two processes, their start included; the direct way on a sample of cells of the same map, the sparsity pattern
    analysed once as the map does, steady states and linearisations left out of its time.
    """
    case = thesis_case(
        [
            "mesh.around=28",
            "mesh.along=48",
            "damping.alpha=0",
            "damping.beta=0.003",
            f"map.x=pressure=500:50000:{CELLS}",
            f"map.y=density=1:1000:{CELLS}:log",
            "map.curve=false",
            "map.refine=0",
            "map.checks=0",
        ]
    )
    plan, walk = MapPlan(case), StabilityWalk(case)
    random = np.random.default_rng(1)
    picks = sorted((int(i), int(j)) for i, j in random.integers(0, CELLS, (SAMPLE, 2)))
    direct, each, workspace = [], [], Workspace()
    for part in (picks[: SAMPLE // 2], None, picks[SAMPLE // 2 :]):
        if part is None:  # in the middle, so that a slow spell of the machine meets both
            started, before = time.perf_counter(), _processor()
            result = Session(case).perform("map", workers=WORKERS)
            taken = time.perf_counter() - started
            work = _processor() - before
            continue
        for i, j in part:
            place = plan.place(plan.x.values[i], plan.y.values[j], plan.laws[0])
            family = walk.family(place)
            begun, own = time.perf_counter(), time.process_time()
            spectrum = leading_modes(family.at(place), 6, family.search(place), workspace=workspace)
            each.append((time.perf_counter() - begun, time.process_time() - own))
            direct.append((i, j, complex(spectrum.eigenvalues[0]), spectrum.unstable_count))
    one, one_work = np.median(each, axis=0)
    growth, frequency, unstable = (result.grid(name)[0] for name in ("growth_rate", "frequency", "unstable"))
    error = max(
        abs(complex(growth[j, i], 2 * np.pi * frequency[j, i]) - value) / abs(value) for i, j, value, _ in direct
    )
    processor = sum(column.seconds for column in result.columns)
    yield Row(
        f"map of {CELLS} x {CELLS} cells, 2 workers, over {CELLS**2} independent solves",
        taken / (CELLS**2 * one),
        target=1 / 60,
        note=(
            f"1/{CELLS**2 * one / taken:.0f}; {taken:.0f} s, {processor / CELLS:.2f} s of one core a "
            f"column, one solve {one:.2f} s"
        ),
    )
    yield Row(
        "the same in processor time, that of the map shared by its workers",
        float(work / WORKERS / (CELLS**2 * one_work)),
        note=(
            f"1/{CELLS**2 * one_work * WORKERS / work:.0f}; {work:.0f} s with starts, one solve "
            f"{one_work:.2f} s; for machines that do other things as well"
        ),
    )
    yield Row(
        f"largest relative difference of {SAMPLE} sampled cells from the full pencil",
        float(error),
        unit="",
        target=1e-6,
    )
    wrong = sum(int(unstable[j, i] != count) for i, j, _, count in direct)
    yield Row("sampled cells with another number of unstable eigenvalues", wrong, unit="", target=0)
    yield Row(
        "cells without a certificate",
        int((~result.grid("certified")[0]).sum()),
        unit="",
        target=0,
        note=f"{int((result.grid('how') == 1).sum())} solved directly",
    )


#: Changes of the case, and seconds that a map with its curves may take, by its damping.
DAMPINGS = {
    "beta 3 ms": (["damping.alpha=0", "damping.beta=0.003"], 60.0),
    "beta 0.4 ms": (["damping.alpha=0", "damping.beta=0.0004"], 120.0),
    "loss factors": (["damping.model='loss factor'"], None),
}
#: Time of a map with loss factors over that with the lightest Rayleigh damping.
LOSS_RATIO = 2.0
#: Points of curves solved again with the full pencil.
POINTS = 12


@benchmark("curves")
def maps_with_curves():
    """The whole map, both continuity laws, with its exact curves; points of the curves against the full pencil."""
    works = {}
    for damping, (changes, target) in DAMPINGS.items():
        case = thesis_case(
            [
                "mesh.around=28",
                "mesh.along=48",
                *changes,
                f"map.x=pressure=500:50000:{CELLS}",
                f"map.y=density=1:1000:{CELLS}:log",
                "map.continuity=both",
            ]
        )
        before = _processor()
        taken, result = seconds(lambda case=case: Session(case).perform("map", workers=WORKERS))
        works[damping] = work = _processor() - before
        exact = sum(curve.exact for curve in result.curves)
        added = sum(column.level > 0 for column in result.columns)
        name = f"map of {CELLS} x {CELLS} cells with curves, both laws, {damping}"
        note = f"{exact} of {len(result.curves)} curves exact, {added} columns put in, {work:.0f} s of processor"
        if target is None:
            yield Row(f"{name}, over beta 0.4 ms, processor", work / works["beta 0.4 ms"], target=LOSS_RATIO, note=note)
        else:
            yield Row(name, taken, unit="s", target=target, note=note)
        yield Row("the same, largest |growth| over |eigenvalue| on its curves", _off(result), "", 1e-6)


def _off(result) -> float:
    """How far points of exact curves are from neutral, by the full pencil."""
    plan, walk = result.plan, StabilityWalk(result.plan.case)
    points = [(c.law, *p) for c in result.curves if c.exact for p in zip(c.x, c.y, c.frequency)]
    worst = 0.0
    for law, x, y, frequency in points[:: max(1, len(points) // POINTS)]:
        values = walk.spectrum(plan.place(x, y, plan.laws[law])).eigenvalues
        nearest = values[int(np.argmin(np.abs(values - 2j * np.pi * frequency)))]
        worst = max(worst, abs(nearest.real) / abs(nearest))
    return float(worst)


def _processor() -> float:
    """Processor time of this process and of its children that have ended, s."""
    for child in multiprocessing.active_children():
        child.join()
    kinds = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(usage.ru_utime + usage.ru_stime for usage in kinds)
