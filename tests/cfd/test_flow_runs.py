"""Runs of OpenFOAM: what is read back from fields that are known, folders, failures, and one run from end to end."""

import json
import re
from dataclasses import replace

import h5py
import numpy as np
import pytest

from dbvfiv.cfd import foam
from dbvfiv.cfd.comparison import FlowComparison, draw
from dbvfiv.cfd.foam import FlowCase, FlowFields, read_fields
from dbvfiv.drawing.style import draw_figures
from dbvfiv.errors import CaseError, SolveError


def flow_case(state, fineness=0.35):
    return FlowCase("dbv12", state.results.mesh, state, 1000.0, 0.33, fineness)


@pytest.fixture
def state(coarse_run):
    return coarse_run.states[-1]


def law_fields(case, factor=1.0, recovered=5e3):
    """What a run would leave in which the law held, with `factor` times its pressures."""
    mesh, state = case.cells, case.state
    z = mesh.centres[:, 2]
    inside = np.interp(z, case.domain.rows, state.station_pressure)
    behind = recovered * np.clip((case.domain.rows[0] - 0.5 - z) / 1.0, 0.0, 1.0)
    pressure = np.where((mesh.part < 2) & (z > case.domain.rows[0]), inside, behind) + 700.0  # over that at the outlet
    velocity = np.zeros((len(z), 3))
    velocity[:, 2] = -np.interp(z, case.domain.rows, state.station_velocity)
    return FlowFields(factor * pressure / 1000.0, velocity, 10, np.column_stack([np.arange(10), np.full(10, 36.0)]))


def test_a_flow_that_obeys_the_law_is_read_as_the_law(state):
    case = flow_case(state)
    found = FlowComparison(case, law_fields(case))
    assert found.back == pytest.approx(700.0)
    assert found.flange == pytest.approx(36e3, rel=1e-3)
    rows = found.rows
    assert np.allclose(rows["net"], rows["law"], atol=450.0)  # steps of the coarse mesh
    assert np.mean(np.abs(rows["net"] - rows["law"])) < 150.0
    s = found.summary
    assert s["mass_flow_at_that_pressure"] == pytest.approx(state.mass_flow, rel=1e-3)
    area, pipe = s["lip_area"], 0.25 * np.pi * 0.33**2
    assert area == pytest.approx(state.outlet_area, rel=0.01)
    head = 500.0 * (state.volume_flow / area) ** 2
    assert s["recovery"] == pytest.approx(5e3 / head, rel=1e-6)
    assert s["loss"] == pytest.approx(1 - (area / pipe) ** 2 - 5e3 / head, rel=1e-6)
    assert s["settled"]
    # pressure times the area of the inner face, which is smaller than the mid-surface that the law's acts on
    assert 0.9 < s["opening_force"] / s["law_opening_force"] < 1.0


def test_pressures_scale_out(state):
    case = flow_case(state)
    once, twice = (FlowComparison(case, law_fields(case, factor)) for factor in (1.0, 2.0))
    assert np.allclose(once.rows["net"], twice.rows["net"]) and np.allclose(once.rows["force"], twice.rows["force"])
    ratio = twice.summary["mass_flow_at_that_pressure"] / once.summary["mass_flow_at_that_pressure"]
    assert ratio == pytest.approx(np.sqrt(0.5))


def test_force_is_pressure_times_the_area_of_the_mouth(state):
    """Unit pressure on the inner face alone: the y force on a quarter is the area of the passage seen along y."""
    case = flow_case(state)
    z = case.cells.centres[:, 2]
    ones = np.where((case.cells.part < 2) & (z > case.domain.rows[0]), 1.0, 0.0)
    fields = FlowFields(ones, np.zeros((len(z), 3)), 1, np.array([[0, 1.0], [1, 1.0]]))
    force = FlowComparison(case, fields)._by_row("layer", -1, "inner")[1].sum() / 1000.0
    inner = case.faces.inner
    seen = getattr(np, "trapezoid", getattr(np, "trapz", None))(inner[:, -1, 0], inner[:, -1, 2])
    assert force == pytest.approx(seen, rel=0.02)  # less the tip that the mesh leaves out


def write_fields(folder, fields):
    here = folder / str(fields.iterations)
    here.mkdir()
    head = "FoamFile {{ version 2.0; format ascii; class vol{0}Field; object {1}; }}\n dimensions [0 2 -2 0 0 0 0];\n"
    body = 'internalField nonuniform List<{0}> {1}\n(\n{2}\n)\n;\nboundaryField {{ ".*" {{ type zeroGradient; }} }}\n'
    numbers = "\n".join(f"{value:.10g}" for value in fields.pressure)
    vectors = "\n".join("({:.10g} {:.10g} {:.10g})".format(*value) for value in fields.velocity)
    count = len(fields.pressure)
    (here / "p").write_text(head.format("Scalar", "p") + body.format("scalar", count, numbers))
    (here / "U").write_text(head.format("Vector", "U") + body.format("vector", count, vectors))
    history = folder / "postProcessing" / "inletPressure" / "0"
    history.mkdir(parents=True)
    (history / "surfaceFieldValue.dat").write_text("# Time p\n1 30.0\n2 36.0\n3 36.1\n")


def test_fields_come_back_from_the_files_cell_by_cell(state, tmp_path):
    case = flow_case(state, 0.3)
    folder = tmp_path / "flow"
    assert case.write(folder) is True
    wanted = law_fields(case)
    write_fields(folder, wanted)
    found = read_fields(folder, len(case.cells.cells))
    assert np.allclose(found.pressure, wanted.pressure, rtol=1e-6)
    assert np.allclose(found.velocity, wanted.velocity, rtol=1e-6)
    assert found.iterations == 10 and len(found.history) == 3
    with pytest.raises(SolveError):
        read_fields(folder, 7)


def test_a_folder_is_gone_on_with_or_refused(state, tmp_path, refused):
    case, folder = flow_case(state, 0.3), tmp_path / "flow"
    case.write(folder)
    assert case.write(folder) is False  # the same question
    with refused(CaseError):
        flow_case(state, 0.32).write(folder)
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken" / "letter.txt").write_text("mine")
    with refused(CaseError):
        case.write(tmp_path / "taken")
    assert (tmp_path / "taken" / "letter.txt").read_text() == "mine"


def test_a_folder_whose_mesh_was_not_made_is_written_anew(state, tmp_path, monkeypatch, refused):
    case, folder = flow_case(state, 0.3), tmp_path / "flow"
    failed = flow_case(state, 0.3)
    monkeypatch.setattr(foam.FlowMesh, "of", lambda domain: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        failed.write(folder)
    monkeypatch.undo()
    monkeypatch.setattr(foam, "write_mesh", lambda *given: 1 / 0)
    for _ in range(2):  # ended while it is written, and again
        with pytest.raises(ZeroDivisionError):
            case.write(folder)
    monkeypatch.undo()
    assert case.write(folder) is True and case.write(folder) is False


@pytest.mark.parametrize("iterations, end", [(50, 50), (400, 400), (450, 450), (401, 400)])
def test_fields_of_the_last_iteration_are_written(state, iterations, end):
    told = foam.case_files(replace(flow_case(state), iterations=iterations))["system/controlDict"]
    times, interval = (int(re.search(rf"{name} (\d+);", told)[1]) for name in ("endTime", "writeInterval"))
    assert times == end and times % interval == 0 and interval <= 100


@pytest.mark.parametrize(
    ("key", "value", "blamed"),
    [("gravity.direction", "-z", "gravity.direction"), ("fluid.density", 1.2, "fluid.viscosity")],
)
def test_a_state_with_gravity_or_of_a_gas_without_viscosity_is_refused(
    coarse_run, misused, tmp_path, key, value, blamed
):
    path = tmp_path / "up.h5"
    path.write_bytes(coarse_run.path.read_bytes())
    with h5py.File(path, "r+") as file:
        case, flow = coarse_run.case.replace({key: value}), file["tables/states/mass_flow"]
        del file["case/json"]
        file["case/json"] = json.dumps(case.to_dict())
        flow[...] = case.fluid.density * file["tables/states/volume_flow"][...]
    misused(blamed, "cfd", path, "--no-run", "-o", tmp_path / "flow")


def test_figures_are_drawn(state):
    case = flow_case(state)
    assert set(draw_figures(dict(draw(FlowComparison(case, law_fields(case)))), (), "flow")) == {
        "velocity",
        "pressure",
        "rows",
    }


def test_without_openfoam_the_case_stays_and_a_sentence_says_so(
    command_line, coarse_run, tmp_path, monkeypatch, misused, one_sentence
):
    monkeypatch.setattr(foam.shutil, "which", lambda name: None)
    folder = tmp_path / "flow"
    done = command_line("cfd", coarse_run.path, "--fineness", 0.3, "--pipe", "330 mm", "-o", folder)
    assert done.status == 1 and one_sentence(done.err) and "apt-get install openfoam" in done.err
    assert (folder / "constant" / "polyMesh" / "faces").exists()
    misused("", "cfd", coarse_run.path, "--pipe", "wide", "-o", tmp_path / "b")
    done = command_line("cfd", coarse_run.path, "--fineness", 0.3, "--no-run", "--json", "-o", tmp_path / "c")
    assert done.status == 0, done.err
    assert json.loads(done.out)["cells"] > 5000


@pytest.mark.slow
@pytest.mark.skipif(not foam.has_openfoam(), reason="OpenFOAM is not installed")
def test_from_a_state_to_its_flow(command_line, coarse_run, tmp_path):
    """End to end on 6 000 cells: within a tenth of what finer meshes say (docs/three-dimensions.md)."""
    folder = tmp_path / "flow"
    ask = ["cfd", coarse_run.path, "--state", "36 kPa", "--pipe", "330 mm", "--fineness", 0.3, "-o", folder, "--json"]
    done = command_line(*ask, "--iterations", 250, "--plots", tmp_path / "figures")
    found = json.loads(done.out)
    assert done.status == 0 and found["settled"]
    assert found["mass_flow_at_that_pressure"] == pytest.approx(0.94 * found["mass_flow"], rel=0.05)
    assert found["loss"] == pytest.approx(found["published_loss"], abs=0.06)
    assert "Mesh OK" in (folder / "log.checkMesh").read_text()
    assert len(list((tmp_path / "figures").iterdir())) == 3
    again = json.loads(command_line(*ask, "--iterations", 300).out)  # goes on from where it stopped
    assert again["iterations"] == 300 and (folder / "comparison.json").exists()
