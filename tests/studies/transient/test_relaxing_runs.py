"""Runs of a valve whose materials relax: energy, coupling."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.errors import CaseError
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.studies.session import load_result
from dbvfiv.studies.transient.run import Runner

from .runs import SHORT, transient

LOSSY = {"damping.model": "loss factor", "drive.pressure": 6e3, "fluid.density": 50.0}


def test_a_loss_factor_of_zero_is_an_undamped_wall(valve):
    fast = SHORT | {"transient.duration": 0.01, "drive.pressure": 6e3}
    zero = Runner(valve(fast | {"damping.model": "loss factor", "damping.loss_factor": 0.0})).start()
    plain = Runner(valve(fast | {"damping.alpha": 0.0, "damping.beta": 0.0})).start()
    for name in ("lip_displacement", "mass_flow", "balance"):
        assert np.array_equal(zero.history[name], plain.history[name])


def test_a_start_from_a_run_says_what_its_states_do_not_hold(valve, tmp_path):
    short = {"transient.duration": 2e-3, "drive.pressure": 6e3}
    again = {"transient.start": "state", "transient.start_file": str(tmp_path / "run.h5")}
    for changes, said in ((LOSSY | short, "what its relaxing layers remember"), (short, "")):
        (tmp_path / "run.h5").unlink(missing_ok=True)
        transient(valve(changes), output=tmp_path / "run.h5")
        found = [one for one in transient(valve(changes | again)).warnings if "does not hold" in one]
        assert len(found) == bool(said) and all(said in one for one in found)


@pytest.mark.slow
def test_energy_is_balanced_and_each_material_has_its_share(valve):
    """A smooth run: the pressure rises in a tenth of a second. Corrections end where they no longer show; those that
    the default tolerance leaves out do work of some 2e-7, as much as the error of a step of 0.4 ms.
    """
    changes = LOSSY | {"fluid.density": 300.0, "transient.ramp": 0.1, "transient.duration": 0.1}
    off = []
    for step in (8e-4, 4e-4):
        run = Runner(valve(changes | {"transient.step": step, "transient.tolerance": 1e-6})).start()
        h = run.history
        off.append(np.abs(h["balance"]).max() / np.abs(h["pressure_work"]).max())
    print(f"unexplained over the work of the pressure: {off}")
    assert off[-1] < 4e-7
    assert off[1] == pytest.approx(off[0] / 4, rel=0.02)
    stored, lost = h["branch_energy"][-1], h["branch_loss"][-1]
    assert (lost > 0).all() and (stored > 0).all()
    assert h["dissipation"][-1] == 0.0
    gained = sum(h[name][-1] - h[name][0] for name in ("kinetic_energy", "strain_energy", "stop_energy"))
    total = gained + stored.sum() + lost.sum()
    assert total == pytest.approx(h["pressure_work"][-1], rel=1e-6)
    assert lost.sum() > 1e-2 * h["pressure_work"][-1]


def test_figures_and_words_say_what_materials_dissipate(tmp_path, valve):
    model = valve(SHORT | LOSSY)
    transient(model, output=tmp_path / "run.h5")
    run = load_result(tmp_path / "run.h5")
    assert run.mesh.relaxing == tuple(group.name for group in model.relaxation.groups)
    lost = run.summary()["last"]["dissipated"]
    assert set(lost) == {"Rayleigh damping", *run.mesh.relaxing}
    assert all(f"J in {name}" in run.lines()[-1] for name in run.mesh.relaxing)
    energies = run.drawers()["energies"]()
    drawn = [line.get_label() for axes in energies.axes for line in axes.get_lines()]
    assert [f"lost in\n{name}" in drawn for name in run.mesh.relaxing] == [True] * len(run.mesh.relaxing)


def test_a_valve_that_was_loaded_long_ago_stays_where_it_is(valve):
    run = Runner(valve(SHORT | LOSSY | {"transient.start": "steady"})).start()
    assert np.ptp(run.history["lip_displacement"]) < 1e-9
    assert np.abs(run.progress.state.memory.branches).max() < 1e-6 * np.abs(run.progress.state.memory.slow).max()


@pytest.mark.slow
def test_staggered_coupling_has_the_same_wall(valve):
    changes = LOSSY | {
        "drive.kind": "flow",
        "fluid.density": 1000.0,
        "transient.ramp": 0.05,
        "transient.duration": 0.05,
    }
    runs = [
        Runner(valve(changes | {"transient.coupling": c, "transient.step": 5e-4})).start()
        for c in ("monolithic", "staggered")
    ]
    ends = [r.history["lip_displacement"][-1] for r in runs]
    assert not runs[1].failures and ends[1] == pytest.approx(ends[0], rel=0.05)
    losses = [r.history["branch_loss"][-1] for r in runs]
    assert losses[1] == pytest.approx(losses[0], rel=0.1)


def test_the_shifted_metric_is_refused_in_time(valve, refused):
    model = valve(LOSSY | {"shell.metric": "shifted"})
    with refused(CaseError):
        ValveMotion(model)
