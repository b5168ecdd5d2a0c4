"""A branch of limit cycles at 28 x 48 against the run in time that finds one of them."""

from __future__ import annotations

import resource
from time import process_time

from dbvfiv.motion.control import RunOptions
from dbvfiv.observer import Observer
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.session import Session
from dbvfiv.studies.transient.run import Runner

from .registry import Row, benchmark

#: 6 kPa, from the onset down to six densities.
BRANCH = {
    "drive.pressure": 6e3,
    "fluid.density": 45.0,
    "damping.alpha": 0.0,
    "damping.beta": 3e-3,
    "cycle.over": "density=25:60:8",
    "transient.start": "kick",
    "transient.kick_opening": 1e-3,
    "transient.step": 2.5e-4,
    "transient.duration": 2.0,
    "transient.stop_when": ["limit cycle"],
}


class _Clock(Observer):
    """Processor time at which each cycle was found."""

    def __init__(self):
        self.times, self.rows = [process_time()], []

    def item(self, result) -> None:
        self.times.append(process_time())
        self.rows.append(result)


@benchmark("cycles")
def cycles():
    """The branch with stability, and the transient from a kick of 1 mm to its verdict, steps of 0.25 ms."""
    session = Session(thesis_case(BRANCH))
    model, clock = session.model, _Clock()
    start = process_time()
    session.perform("cycle", observer=clock)
    whole = process_time() - start
    taken = [after - before for before, after in zip(clock.times[:-1], clock.times[1:])]
    orbit = next(t for t, row in zip(taken, clock.rows) if row.value == 45.0)
    start = process_time()
    run = Runner(model, RunOptions.of(session.case), case=session.case).start()
    transient = process_time() - start
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    yield Row(
        "one cycle with its stability from its neighbour over the transient that finds it",
        orbit / transient,
        target=1 / 20,
        note=(
            f"processor time {orbit:.1f} and {transient:.1f} s, {run.progress.steps} steps of 0.25 ms, "
            f"{run.verdict.name}; {memory:.2f} GiB at most"
        ),
    )
    yield Row(
        "a branch from the onset through six densities over six such transients",
        whole / (6 * transient),
        target=1 / 20,
        note=f"processor time {whole:.1f} s for {len(clock.rows)} cycles, the search for the onset included",
    )
