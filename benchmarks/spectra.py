"""Coupled eigenvalues of the 28 x 48 valve against one real LU refactorisation."""

from __future__ import annotations

from itertools import product

import numpy as np

from dbvfiv.case.parameters import Mu
from dbvfiv.model import ValveModel, linearise, select_search
from dbvfiv.model.equilibria import find_equilibrium
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.stability.walk import StabilityWalk
from eigen import Relaxation, SearchOptions, Workspace, certified_spectrum, leading_modes, lowest_frequencies

from .registry import Row, benchmark, medians, seconds
from .statics import model_of, refactorisation

#: Light stiffness damping, so that ten modes lie right of the limit point at -1/beta, and the reference damping, where
#: six do.
LIGHT = Mu(density=10.0, alpha=5.0, beta=3e-4)
REFERENCE = Mu(density=10.0, alpha=0.0, beta=3e-3)


@benchmark("modes")
def modes():
    """Ten leading coupled pairs at one state, linearisation included but for the assembly of the tangent."""
    model = model_of(28, 48)
    q = find_equilibrium(model, 6e3).q
    factor = refactorisation(model, q)
    workspace = Workspace()

    def solve(conditions):
        pencil = linearise(model, q, 6e3).pencil(conditions)
        return leading_modes(pencil, 10, SearchOptions(limit_point=-1 / conditions.beta), workspace=workspace)

    times = medians(
        {
            "lu": factor.refactor,
            "assembly": lambda: model.shell.force_and_tangent(q),
            "light": lambda: solve(LIGHT),
            "reference": lambda: solve(REFERENCE),
        },
        5,
    )
    unit = times["lu"]
    for name, conditions in (("light", LIGHT), ("reference", REFERENCE)):
        found = solve(conditions)
        yield Row(
            f"leading modes, ten asked for, beta {conditions.beta:g} s, over one LU refactorisation",
            (times[name] - times["assembly"]) / unit,
            target=30.0,
            note=f"{1e3 * times[name]:.0f} ms, {len(found)} found, residual {found.residual.max():.0e}",
        )


#: A line that eight elements resolve up to 200 Hz.
LINE = {"upstream.length": 20.0, "upstream.loss": 0.5, "fluid.continuity": "storage"}


@benchmark("modes-line")
def modes_behind_a_line():
    """Ten leading coupled pairs behind an elastic line against those behind its rigid column, water at 18 kPa, in the
    band that the line resolves; the certificate likewise.
    """
    conditions, times, found = Mu(density=1000.0, alpha=0.0, beta=4e-4), {}, {}
    for name, keys in (("rigid", {}), ("elastic", {"upstream.wave_speed": 1000.0})):
        model = ValveModel(thesis_case(LINE | keys))
        pencil = linearise(model, find_equilibrium(model, 18e3).q, 18e3).pencil(conditions)
        options, workspace = SearchOptions(200.0, limit_point=-1 / conditions.beta), Workspace()
        solves = {
            "leading modes": lambda p=pencil, o=options, w=workspace: leading_modes(p, 10, o, workspace=w),
            "certificate": lambda p=pencil, o=options, w=workspace: certified_spectrum(p, 10, o, workspace=w),
        }
        times[name], found[name] = medians(solves, 3), certified_spectrum(pencil, 10, options)
    for what, ours in times["elastic"].items():
        yield Row(
            f"{what}, elastic line of eight elements, over the rigid column",
            ours / times["rigid"][what],
            note=f"{1e3 * ours:.0f} ms, agrees {found['elastic'].agrees}, {found['elastic'].spectrum.applications} "
            f"applications against {found['rigid'].spectrum.applications}",
        )


#: Two materials that share the stiffness, four branches each: loss factors near 0.2 and 0.1 over three decades.
SHARES = (0.6, 0.4)
STRENGTHS = ((0.15, 0.15, 0.15, 0.15), (0.07, 0.07, 0.07, 0.07))
TIMES = (0.1, 0.01, 1e-3, 1e-4)


@benchmark("modes-relaxing")
def modes_that_relax():
    """Ten leading coupled pairs with four branches of relaxation in two materials against light Rayleigh damping,
    linearisation left out of both; the certificate likewise.
    """
    model = model_of(28, 48)
    for pressure in (6e3, 20e3):
        linear = linearise(model, find_equilibrium(model, pressure).q, pressure)
        relaxation = Relaxation([share * linear.structure for share in SHARES], STRENGTHS, TIMES)
        structure = linear.pencil(Mu(density=10.0, alpha=0.0, beta=0.0), fluid=False).replace(relaxation=relaxation)
        workspaces = Workspace(), Workspace()

        def band():
            low = Mu(density=10.0, alpha=0.0, beta=0.0, loss_factor=1.0)
            return select_search(
                SearchOptions(), low, lambda n: lowest_frequencies(structure, n, workspaces[1]), 10
            ).options

        searches = SearchOptions(limit_point=-1 / LIGHT.beta), band()
        for density, (law, storage) in product((10.0, 1000.0), LAWS.items()):
            pencils = (
                linear.pencil(Mu(density=density, alpha=LIGHT.alpha, beta=LIGHT.beta, storage=storage)),
                linear.pencil(Mu(density=density, alpha=0.0, beta=0.0, storage=storage)).replace(relaxation=relaxation),
            )

            def solve(i, solver=leading_modes):
                return solver(pencils[i], 10, searches[i], workspace=workspaces[i])

            times = medians(
                {
                    "rayleigh": lambda: solve(0),
                    "relaxing": lambda: solve(1),
                    "rayleigh certified": lambda: solve(0, certified_spectrum),
                    "relaxing certified": lambda: solve(1, certified_spectrum),
                    "band": band,
                },
                3,
            )
            found = solve(1)
            yield Row(
                f"leading modes with four branches, {pressure:g} Pa, {density:g} kg/m3, {law}, over Rayleigh damping",
                times["relaxing"] / times["rayleigh"],
                target=2.0,
                note=(
                    f"{1e3 * times['relaxing']:.0f} ms, {len(found)} found up to {searches[1].max_frequency:.0f} Hz, "
                    f"{found.applications} applications, residual {found.residual.max():.0e}; with certificate "
                    f"{times['relaxing certified'] / times['rayleigh certified']:.2f}; finding the band "
                    f"{times['band'] / times['rayleigh']:.2f}"
                ),
            )


#: From the reference damping down to none, in water and in a light fluid, under both continuity laws.
BETAS = (3e-3, 3e-4, 3e-5, 0.0)
DENSITIES = (1000.0, 10.0)
LAWS = {"storage": 1.0, "quasi-steady": 0.0}


@benchmark("modes-any-state")
def modes_at_any_state():
    """Ten leading coupled pairs at one state under light and heavy damping and fluid, linearisation left out."""
    model = model_of(28, 48)
    q = find_equilibrium(model, 6e3).q
    linear, factor, workspace = linearise(model, q, 6e3), refactorisation(model, q), Workspace()
    structure = linear.pencil(REFERENCE, fluid=False)

    def solve(conditions, storage):
        search = select_search(SearchOptions(), conditions, lambda n: lowest_frequencies(structure, n, workspace), 10)
        pencil = linear.pencil(conditions.at(storage=storage))
        return leading_modes(pencil, 10, search.options, workspace=workspace)

    for density in DENSITIES:
        for law, storage in LAWS.items():
            for beta in BETAS:
                conditions = Mu(density=density, alpha=0.0, beta=beta)
                times = medians({"lu": factor.refactor, "search": lambda: solve(conditions, storage)}, 3)
                found = solve(conditions, storage)
                yield Row(
                    f"leading modes, {density:g} kg/m3, {law}, beta {1e3 * beta:g} ms, over one LU refactorisation",
                    times["search"] / times["lu"],
                    target=30.0,
                    note=(
                        f"{len(found)} found, {found.status}, {found.applications} applications, "
                        f"residual {found.residual.max():.0e}"
                    ),
                )


@benchmark("density-sweep")
def density_sweep():
    """A hundred densities at one pressure on one reduced-order model, against single solves; the direct way on a
    sample.
    """
    model = model_of(28, 48)
    state = linearise(model, find_equilibrium(model, 6e3).q, 6e3)
    options = SearchOptions(limit_point=-1 / REFERENCE.beta)
    workspace = Workspace()

    def at(density):
        return state.pencil(Mu(density=density, alpha=REFERENCE.alpha, beta=REFERENCE.beta))

    single = medians({"one": lambda: leading_modes(at(10.0), 6, options, workspace=workspace)}, 5)["one"]
    densities = np.geomspace(1.0, 1000.0, 100)
    place = Mu.of(model.case).at(pressure=6e3, alpha=REFERENCE.alpha, beta=REFERENCE.beta)
    walk = StabilityWalk(model.case, model=model)
    walk.give(place, find_equilibrium(model, 6e3).q)
    places = [place.at(density=float(density)) for density in densities]

    def column():
        found = walk.column(places, 6, edges=True, count=6)
        return found, found.cells

    spent, (result, _) = seconds(column)
    yield Row(
        "100-point density sweep over one such solve",
        spent / single,
        target=10.0,
        note=f"{spent:.2f} s, error {result.error:.0e}",
    )
    direct, _ = seconds(lambda: [leading_modes(at(d), 6, options, workspace=workspace) for d in densities[::20]])
    yield Row("the direct way, 100 solves, from a sample of 5", direct * 20 / single)
