"""Steps of the 28 x 48 valve in a limit cycle against one force evaluation and one solve."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

from dbvfiv.model import ValveModel
from dbvfiv.motion.control import RunOptions
from dbvfiv.observer import Observer
from dbvfiv.record.files import Header
from dbvfiv.record.mesh import MeshData
from dbvfiv.record.record import GrowingRecord
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.transient.history import RESTART, tables_of
from dbvfiv.studies.transient.run import Runner

from .registry import Row, benchmark

STEPS = 2000
#: 6 kPa and a fluid somewhat lighter than at the onset of flutter; the push is near the amplitude of the cycle.
CYCLE = {
    "drive.pressure": 6e3,
    "fluid.density": 50.0,
    "damping.alpha": 0.0,
    "transient.start": "kick",
    "transient.kick_opening": 4.6e-3,
    "transient.step": 5e-4,
    "transient.duration": 0.25,
}


class Unit(Observer):
    """Measures one force evaluation and one solve while a run goes on, so that a slow spell of the machine meets both,
    and its own time.
    """

    def __init__(self, every: int = 50):
        self.every, self.count, self.spent, self.wall = every, 0, 0.0, 0.0
        self.force, self.solve = [], []
        self.motion = self.q = None

    def item(self, row) -> None:
        self.count += 1
        if self.count % self.every or not self.motion.factored:
            return
        start, wall = process_time(), perf_counter()
        for kept, function in (
            (self.force, lambda: self.motion.model.shell.force(self.q)),
            (self.solve, lambda: self.motion.solve(self.q)),
        ):
            for _ in range(2):  # the first for the caches
                begin = process_time()
                function()
                taken = process_time() - begin
            kept.append(taken)
        self.spent += process_time() - start
        self.wall += perf_counter() - wall


#: Water about an open state, pushed along a slow mode: smooth, so that a step takes the same work whatever damps it.
RINGING = {
    "drive.pressure": 6e3,
    "fluid.density": 1000.0,
    "damping.alpha": 0.0,
    "transient.start": "kick",
    "transient.kick_opening": 1e-4,
    "transient.step": 1e-4,
    "modes.max_frequency": 40.0,
}
BLOCK, BLOCKS = 200, 5


def block(model: ValveModel, first, steps: int = BLOCK) -> tuple[float, int, object]:
    """Processor time and residuals of a block of steps with their history and file, and the state at its end."""
    case = model.case.replace({"transient.duration": first.time + steps * 1e-4})
    with tempfile.TemporaryDirectory() as folder:
        mesh = MeshData.of(model)
        path = Path(folder) / "run.h5"
        with GrowingRecord(Header.of("transient", case), mesh, tables_of(mesh), path) as record:
            runner = Runner(model, RunOptions.of(case), record, case)
            start = process_time()
            run = runner.start(first)
            return process_time() - start, run.stepper.residuals, run.progress.state


@benchmark("time-steps-relaxing")
def time_steps_relaxing():
    """Blocks of steps of the 28 x 48 valve with four Maxwell branches in each material, and of one with stiffness
    damping, in turn; both with history and file.
    """
    walls = {"rayleigh": {}, "loss factor": {"damping.model": "loss factor"}}
    models = {name: ValveModel(thesis_case(RINGING | more)) for name, more in walls.items()}
    states, spent, residuals = {}, {name: [] for name in walls}, {}
    for name, model in models.items():
        warm = model.case.replace({"transient.duration": 50e-4})
        states[name] = Runner(model, RunOptions.of(warm), case=warm).start().progress.state
    for _ in range(BLOCKS):
        for name, model in models.items():
            taken, residuals[name], states[name] = block(model, states[name])
            spent[name].append(taken)
    times = {name: 1e3 * np.median(values) / BLOCK for name, values in spent.items()}
    branches = states["loss factor"].memory.branches
    yield Row(
        "one step of a wall that relaxes over one of a wall with stiffness damping",
        times["loss factor"] / times["rayleigh"],
        target=1.5,
        note=(
            f"processor time {times['loss factor']:.2f} and {times['rayleigh']:.2f} ms, residuals a step "
            f"{residuals['loss factor'] / BLOCK:.2f} and {residuals['rayleigh'] / BLOCK:.2f}; {branches.shape[2]} "
            f"branches, {branches.nbytes / 2**20:.1f} MiB"
        ),
    )


@benchmark("time-steps")
def time_steps():
    """2000 steps of 0.1 ms as `dbvfiv transient` makes them: history, verdicts and the file included."""
    case = thesis_case(CYCLE)
    model = ValveModel(case)
    cycle = Runner(model).start().progress.state
    case = case.replace({"transient.step": 1e-4, "transient.duration": cycle.time + STEPS * 1e-4})
    unit = Unit()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.h5"
        mesh = MeshData.of(model)
        with GrowingRecord(Header.of("transient", case), mesh, tables_of(mesh), path, unit) as record:
            runner = Runner(model, RunOptions.of(case), record, case)
            empty = os.path.getsize(path)
            unit.motion, unit.q = runner.motion, cycle.q
            start, wall = process_time(), perf_counter()
            run = runner.start(cycle)
            spent, wall = process_time() - start - unit.spent, perf_counter() - wall - unit.wall
            record.conclude(True)
            restarts = record.rows(RESTART) * record.tables[RESTART].row_bytes
        size = os.path.getsize(path)
    force, solve = np.median(unit.force), np.median(unit.solve)
    steps = run.progress.steps
    lip = 1e3 * run.history["lip_displacement"]
    yield Row(
        "one step over one force evaluation and one solve with existing factors",
        spent / steps / (force + solve),
        target=4.0,
        note=(
            f"{steps} steps, processor time {1e3 * spent / steps:.2f} ms, force {1e3 * force:.2f} "
            f"ms, solve {1e3 * solve:.2f} ms"
        ),
    )
    yield Row(
        "residuals a step",
        run.stepper.residuals / steps,
        "",
        note=f"solves {run.stepper.solves / steps:.2f}, steps per factorisation "
        f"{steps / max(1, run.stepper.factorisations):.0f}",
    )
    yield Row(
        "steps per second of processor time",
        steps / spent,
        "1/s",
        note=f"{steps / wall:.0f} by the clock; lip between {lip.min():.2f} and {lip.max():.2f} mm",
    )
    yield Row(
        "file per 10 000 steps",
        (size - empty - restarts) / steps * 1e4 / 2**20,
        "MiB",
        note=f"and {empty / 2**20:.2f} MiB for the mesh, {restarts / 2**20:.2f} MiB for restart points",
    )
