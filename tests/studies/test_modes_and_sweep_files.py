"""Result files, ParaView files and figures of modes and sweeps."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest
from PIL import Image
from scipy.signal import lfilter

import dbvfiv
from dbvfiv.errors import CaseError
from dbvfiv.record.vtkhdf import faces
from dbvfiv.studies.modes.search import drawn_amplitude

FLUTTER = {"density": 10, "alpha": 0}


@pytest.fixture(scope="module")
def modes(coarse_run):
    return coarse_run.states[0].modes(count=5, **FLUTTER)


@pytest.fixture(scope="module")
def stored(modes, tmp_path_factory):
    return dbvfiv.load_result(modes.save(tmp_path_factory.mktemp("modes") / "modes.h5"))


@pytest.fixture(scope="module")
def sweep(coarse_run):
    return coarse_run.states[0].sweep("density=1:1000:7:log", count=4, alpha=0)


@pytest.fixture(scope="module")
def stored_sweep(sweep, tmp_path_factory):
    return dbvfiv.load_result(sweep.save(tmp_path_factory.mktemp("sweep") / "sweep.h5"))


def test_modes_come_back(modes, stored):
    assert stored.summary() == modes.summary() and stored.lines() == modes.lines()
    assert stored.complete and stored.stable is False and stored.notes == modes.notes
    for ours, theirs in zip(stored.modes, modes.modes, strict=True):
        for name in ("shape", "area", "pressure", "inlet_velocity"):
            assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name
    assert np.array_equal(stored.certificate.phase, modes.certificate.phase)
    assert np.array_equal(stored.state.nodal, modes.state.nodal)


def test_the_case_of_the_file_gives_the_modes_again(stored):
    assert stored.case.fluid.density == 10 and stored.case.damping.alpha == 0 and stored.case.drive.pressure == 6e3
    again = dbvfiv.load(stored.case).modes(count=2)
    assert again.modes[0].eigenvalue == pytest.approx(stored.modes[0].eigenvalue, rel=1e-6)


def test_numbers_carry_units(stored):
    with h5py.File(stored.path) as file:
        assert (
            file["tables/modes/growth_rate"].attrs["units"] == "1/s" and file["tables/modes/shape"].attrs["description"]
        )
        assert (
            file["tables/state/pressure"].attrs["units"] == "Pa"
            and file["tables/count/frequency"].attrs["units"] == "Hz"
        )


@pytest.mark.slow
def test_state_and_valve_say_the_same(coarse_valve, modes):
    other = coarse_valve.modes("6 kPa", count=5, **FLUTTER)
    assert [m.growth_rate for m in other.modes] == pytest.approx([m.growth_rate for m in modes.modes], rel=1e-6)
    assert other.state.mass_flow == pytest.approx(
        modes.state.mass_flow, rel=1e-6
    )  # of the lighter fluid, not of the state's
    storage = coarse_valve.modes("6 kPa", count=2, continuity="storage", **FLUTTER)
    assert abs(storage.modes[0].eigenvalue - modes.modes[0].eigenvalue) > 1


def test_what_cannot_be_chosen_is_told(coarse_valve, coarse_run, refused):
    for call in (
        lambda: coarse_valve.modes(rho=3),
        lambda: coarse_valve.modes(density=-1),
        lambda: coarse_valve.sweep("density=5:1:3"),
        lambda: coarse_run.states[0].modes(continuity="none"),
        lambda: coarse_run.export("x.vtkhdf", mode=1),
    ):
        with refused(CaseError):
            call()


def vtk_steps(path, numbers=None):
    """Times of a file, and (points, point data, cell data) of some steps, as VTK's own reader gives them."""
    vtk = pytest.importorskip("vtk")
    from vtk.util.numpy_support import vtk_to_numpy

    reader = vtk.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    steps = []
    for number in range(len(times)) if numbers is None else numbers:
        reader.SetStep(number)
        reader.Update()
        grid = reader.GetOutput()
        data = [
            {d.GetArrayName(i): vtk_to_numpy(d.GetArray(i)).copy() for i in range(d.GetNumberOfArrays())}
            for d in (grid.GetPointData(), grid.GetCellData())
        ]
        steps.append((vtk_to_numpy(grid.GetPoints().GetData()).copy(), *data))
    return times, steps


def test_vtk_reads_the_modes(stored, tmp_path):
    times, steps = vtk_steps(stored.export(tmp_path / "modes.vtkhdf"))
    assert times == (1, 2, 3, 4, 5)
    for mode, (points, fields, cells) in zip(stored.modes, steps, strict=True):
        shape = fields["mode_real"] + 1j * fields["mode_imag"]
        assert fields["mode_amplitude"].max() == pytest.approx(1) and np.linalg.norm(
            shape.real, axis=1
        ).max() == pytest.approx(1)
        lip = np.isclose(points[:, 2], 0) & np.isclose(points[:, 0], 0)
        up, down = shape[lip & (points[:, 1] > 0)][0], shape[lip & (points[:, 1] < 0)][0]
        assert np.allclose(up * [1, -1, 1], down)  # all quarters, mirrored
        assert np.allclose(up, mode.shape[stored.mesh.rows[0, 0], :3])
        assert cells["growth_rate"][0] == pytest.approx(mode.growth_rate)
        moved = np.linalg.norm(fields["displacement"], axis=1).max()
        assert moved == pytest.approx(stored.state.max_displacement)


def test_vtk_reads_one_cycle(stored, tmp_path):
    mode = stored.modes[0]
    times, steps = vtk_steps(stored.export(tmp_path, mode=1, deformed=True), (0, 12, 24))
    assert len(times) == 25 and times[-1] == pytest.approx(1 / mode.frequency)
    swing = [fields["oscillation"] for _, fields, _ in steps]
    amplitude = drawn_amplitude(stored.state, mode)
    assert np.linalg.norm(swing[0], axis=1).max() == pytest.approx(amplitude, rel=1e-6)
    assert np.allclose(swing[0], swing[2], atol=1e-9) and np.allclose(swing[0], -swing[1], atol=1e-9)
    assert np.allclose(steps[0][0] - steps[1][0], swing[0] - swing[1], atol=1e-6)
    with pytest.raises(CaseError):
        stored.export(tmp_path, mode=9)


def test_sweep_comes_back(sweep, stored_sweep):
    assert stored_sweep.summary() == sweep.summary() and stored_sweep.lines() == sweep.lines()
    assert stored_sweep.complete and stored_sweep.certified
    assert stored_sweep.case.sweep.over == "density=1:1000:7:log" and stored_sweep.case.damping.alpha == 0


@pytest.mark.slow
def test_crossing_is_where_growth_vanishes(coarse_run, sweep):
    """Interpolated between samples half a decade apart, and better between closer ones."""
    left = []
    for found in (sweep, coarse_run.states[0].sweep("density=1:1000:13:log", count=4, alpha=0)):
        (crossing,) = found.crossings()
        assert not crossing.to_unstable and crossing.branch == 1
        modes = coarse_run.states[0].modes(count=2, density=crossing.value, alpha=0).modes
        flutter = max(modes, key=lambda m: m.growth_rate)
        left.append(abs(flutter.growth_rate))
    assert (
        left[0] < 3
        and left[1] < min(2, 0.6 * left[0])
        and flutter.frequency == pytest.approx(crossing.frequency, rel=0.02)
    )


def test_a_missing_branch_is_null(sweep):
    summary = sweep.summary()
    assert set(summary["branches"][0]) == {"id", "growth_rate", "frequency", "confidence"}
    missing = [branch for branch in summary["branches"] if None in branch["growth_rate"]]
    assert missing
    for branch in missing:
        places = [i for i, v in enumerate(branch["growth_rate"]) if v is None]
        assert all(branch[name][i] is None for name in ("frequency", "confidence") for i in places)


def test_figures(stored, stored_sweep):
    assert set(stored.figures(only=["eigenvalues", "winding", "centre-line-1"])) == {
        "eigenvalues",
        "winding",
        "centre-line-1",
    }
    assert set(stored.figures(mode=2, only=["mode-shape-2", "centre-line-2"])) == {"mode-shape-2", "centre-line-2"}
    assert set(stored_sweep.figures()) == {"sweep", "root-locus"}
    with pytest.raises(CaseError):
        stored.figures(mode=17)


def test_centre_line_shows_the_cycle(stored):
    """Ten phases about the steady state, each of them the inner face of the equilibrium plus the swing of the mode."""
    figure = stored.figures(only=["centre-line-1"])["centre-line-1"]
    lines = figure.axes[0].get_lines()
    state, mode = stored.state, stored.modes[0]
    row = stored.mesh.rows[:, 0]
    expected = faces(stored.mesh, state.nodal + drawn_amplitude(state, mode) * mode.shape.real)[0][row]
    assert np.allclose(lines[0].get_ydata(), 1e3 * expected[:, 1]) and np.allclose(
        lines[0].get_xdata(), 1e3 * expected[:, 2]
    )
    assert all(line.get_ydata().min() > -0.5 for line in lines[:10])  # drawn without crossing the closing plane


def test_animation(stored, tmp_path):
    path = stored.animate(tmp_path / "a" / "mode.gif", mode=1, frames=3)
    with Image.open(path) as picture:
        assert picture.n_frames == 3
    with pytest.raises(CaseError):
        stored.animate(tmp_path / "mode.gif", frames=1)
    (tmp_path / "file").write_text("")
    with pytest.raises(CaseError):
        stored.animate(tmp_path / "file" / "mode.gif", frames=2)


def test_a_damaged_file_is_told(stored, tmp_path, refused):
    path = tmp_path / "broken.h5"
    path.write_bytes(stored.path.read_bytes())
    with h5py.File(path, "a") as file:
        del file["tables/modes/shape"]
    with refused(CaseError):
        dbvfiv.load_result(path)


def test_a_measured_record_is_laid_beside_modes(modes, stored, tmp_path, command_line):
    time = np.arange(0.0, 4.0, 1e-3)
    noise = 0.02 * np.random.default_rng(5).standard_normal(len(time))
    flutter = next(mode for mode in modes.modes if mode.growth_rate > 0)
    damped = min((mode for mode in modes.modes if 0 < mode.damping_ratio < 0.9), key=lambda mode: mode.damping_ratio)
    ring = np.exp(damped.growth_rate * time) * np.cos(damped.angular_frequency * time)
    line = 0.3 * np.cos(flutter.angular_frequency * time)
    np.savetxt(
        tmp_path / "record.csv",
        np.column_stack([time, line + noise, ring + noise, np.cos(2 * np.pi * 250.0 * time) + noise]),
        delimiter=",",
        header="time [s],flutter,ring,far",
        comments="",
    )
    files = tmp_path / "record.csv", stored.path, "-o", tmp_path / "beside.png", "--within", "2"
    told = command_line("compare", *files, "--json")
    document = json.loads(told.out)
    says = {one["signal"]: one for one in document["measured"]}
    assert says["flutter"]["says"] == f"It is mode {flutter.number}."
    assert says["ring"]["matches"][0]["name"] == f"mode {damped.number}"
    assert says["ring"]["matches"][0]["share"] > 0.9 and says["ring"]["matches"][0]["distance"] < 0.5
    assert says["far"]["says"].startswith("None of them")
    assert (tmp_path / "beside.png").stat().st_size > 10_000
    assert f"It is mode {flutter.number}." in command_line("compare", *files).out
    pole, white = np.exp(damped.eigenvalue * 2e-3), np.random.default_rng(5).standard_normal(30_000)
    moved = lfilter([1.0], [1.0, -2 * pole.real, abs(pole) ** 2], white)
    table = np.column_stack([np.arange(30_000) * 2e-3, moved / moved.std()])
    np.savetxt(tmp_path / "noise.csv", table, delimiter=",", header="time [s],noise", comments="")
    under = json.loads(command_line("compare", tmp_path / "noise.csv", *files[1:], "--json").out)["measured"]
    assert [one["called"] for one in under] == ["resonance"]
    assert under[0]["matches"][0]["name"] == f"mode {damped.number}" and under[0]["matches"][0]["share"] > 0.9
    alone = command_line("compare", tmp_path / "record.csv")
    assert alone.status == 2 and "compared with one result" in alone.err
