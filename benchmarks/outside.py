"""Water outside the 28 x 48 valve against none: its added mass, modes, a column of a map, a step in time, memory."""

from __future__ import annotations

import tracemalloc
from time import process_time

import numpy as np

from dbvfiv.case.parameters import Mu
from dbvfiv.model import ValveModel, linearise
from dbvfiv.model.equilibria import find_equilibrium
from dbvfiv.motion.control import RunOptions
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.stability.walk import StabilityWalk
from dbvfiv.studies.transient.run import Runner
from eigen import SearchOptions, Workspace, leading_modes

from .registry import Row, benchmark
from .transient import RINGING, block

WATER = {"outside.fluid": "same"}
BETA = 0.00116
#: Steps of a block, as many as lie between restart points, and blocks.
STEPS, BLOCKS = 500, 3


def _times(functions: dict, rounds: int = 3) -> dict[str, float]:
    """Least processor time of each, in turn."""
    for function in functions.values():
        function()
    taken = {name: [] for name in functions}
    for _ in range(rounds):
        for name, function in functions.items():
            start = process_time()
            function()
            taken[name].append(process_time() - start)
    return {name: min(values) for name, values in taken.items()}


@benchmark("outside-modes")
def modes():
    """Ten leading pairs at 6 kPa with their linearisation, and a column of 64 densities with its steady state."""
    models = {"dry": ValveModel(thesis_case()), "wet": ValveModel(thesis_case(WATER))}
    q = find_equilibrium(models["dry"], 6e3).q
    workspace, wet = Workspace(), models["wet"]
    structure = wet.shell.dofs.matrix(wet.structure(q)[1])

    def pairs(model):
        pencil = linearise(model, q, 6e3).pencil(Mu(density=1000.0, alpha=0.0, beta=BETA))
        return leading_modes(pencil, 10, SearchOptions(limit_point=-1 / BETA), workspace=workspace)

    def column(model):
        case = model.case.replace({"damping.alpha": 0.0, "damping.beta": BETA})
        walk, place = StabilityWalk(case, model=model), Mu.of(case).at(pressure=6e3)
        walk.equilibrium(place)
        return walk.column([place.at(density=d) for d in np.geomspace(1.0, 1000.0, 64)]).how

    times = _times(
        {
            "added": lambda: wet.outside.added_mass(q, structure),
            "operator": lambda: (wet.outside.face.fluxes(wet.nodal(q)), wet.outside.impedance(q)),
            **{f"pairs {name}": lambda m=model: pairs(m) for name, model in models.items()},
        }
    )
    tracemalloc.start()
    added = wet.outside.added_mass(q, structure)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    panels = len(wet.shell.mesh.quads)
    yield Row(
        "added mass of one state",
        times["added"],
        "s",
        target=1.0,
        note=f"of it the panels {times['operator']:.2f} s; {peak / 2**20:.0f} MiB, rank {added.rank} of {panels}",
    )
    yield Row(
        "ten leading pairs with water outside over those without, linearisation included",
        times["pairs wet"] / times["pairs dry"],
        target=3.0,
        note=f"processor time {times['pairs wet']:.2f} and {times['pairs dry']:.2f} s",
    )
    taken, found = {}, {}
    for name, model in models.items():
        column(model)
        start = process_time()
        found[name] = column(model)
        taken[name] = process_time() - start
    direct = int(np.count_nonzero(found["wet"]))
    yield Row(
        "a column of 64 cells with water outside over one without, steady state included",
        taken["wet"] / taken["dry"],
        target=3.0,
        note=f"processor time {taken['wet']:.2f} and {taken['dry']:.2f} s, {direct} cells solved directly",
    )


@benchmark("outside-steps")
def time_steps():
    """Blocks of steps with water outside and without, in turn; both with history and file."""
    models = {"dry": ValveModel(thesis_case(RINGING)), "wet": ValveModel(thesis_case(RINGING | WATER))}
    states, spent = {}, {name: [] for name in models}
    for name, model in models.items():
        warm = model.case.replace({"transient.duration": 50e-4})
        states[name] = Runner(model, RunOptions.of(warm), case=warm).start().progress.state
    for _ in range(BLOCKS):
        for name, model in models.items():
            taken, _, states[name] = block(model, states[name], STEPS)
            spent[name].append(taken)
    times = {name: 1e3 * np.median(values) / STEPS for name, values in spent.items()}
    yield Row(
        "one step with water outside over one without",
        times["wet"] / times["dry"],
        target=2.0,
        note=f"processor time {times['wet']:.2f} and {times['dry']:.2f} ms, with two added masses a block",
    )
