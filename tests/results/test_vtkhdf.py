"""VTKHDF files, read back by VTK itself."""

import shutil

import numpy as np
import pytest

import dbvfiv
from dbvfiv.errors import CaseError
from dbvfiv.record.mesh import WholeValve
from dbvfiv.studies.steady.study import SteadyResult

vtk = pytest.importorskip("vtk")
from vtk.util.numpy_support import vtk_to_numpy  # noqa: E402


class Reader:
    """VTK's own reader, one step at a time."""

    def __init__(self, path):
        self.reader = vtk.vtkHDFReader()
        self.reader.SetFileName(str(path))
        self.reader.UpdateInformation()
        self.times = self.reader.GetOutputInformation(0).Get(vtk.vtkStreamingDemandDrivenPipeline.TIME_STEPS())

    def step(self, number):
        self.reader.SetStep(number)
        self.reader.Update()
        grid = self.reader.GetOutput()
        assert grid.IsA("vtkUnstructuredGrid")
        return grid


def array(data, name):
    return vtk_to_numpy(data.GetArray(name))


def test_vtk_reads_what_was_written(tmp_path, coarse_run):
    path = dbvfiv.load_result(coarse_run.path).export(tmp_path / "whole.vtkhdf")
    reader, whole = Reader(path), WholeValve.of(coarse_run.mesh)
    assert reader.times == (6e3, 18e3, 36e3)
    for number, state in enumerate(coarse_run.states):
        grid = reader.step(number)
        points, cells = grid.GetPointData(), grid.GetCellData()
        assert np.array_equal(vtk_to_numpy(grid.GetPoints().GetData()), whole.points)
        assert np.array_equal(vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(-1, 4), whole.quads)
        assert {grid.GetCellType(i) for i in range(grid.GetNumberOfCells())} == {vtk.VTK_QUAD}
        shift = np.linalg.norm(array(points, "displacement"), axis=1)
        assert shift.max() == state.max_displacement
        assert np.allclose(np.linalg.norm(array(points, "director"), axis=1), 1)
        assert points.HasArray("rotation")
        assert np.array_equal(array(cells, "thickness"), np.tile(coarse_run.mesh.thickness, 4))
        along = 0.5 * (state.station_pressure[1:] + state.station_pressure[:-1])
        assert np.array_equal(array(cells, "pressure").reshape(4, 16, 8), np.broadcast_to(along[:, None], (4, 16, 8)))
        for layer, name in enumerate(("1_CR", "2_SBR", "3_fibre", "4_fibre", "5_EPDM")):
            assert np.array_equal(array(cells, f"von_mises_{name}"), np.tile(state.layers.von_mises[:, layer], 4))


def test_points_move_if_asked(tmp_path, coarse_run):
    path = coarse_run.export(tmp_path, quarter=True, deformed=True)
    assert path == tmp_path / "dbv12-steady.vtkhdf"
    reader, mesh = Reader(path), coarse_run.mesh
    for number in (2, 0):
        moved = mesh.nodes + coarse_run.states[number].nodal[:, :3]
        assert np.allclose(vtk_to_numpy(reader.step(number).GetPoints().GetData()), moved, atol=1e-15)


def test_pyvista_shows_it(tmp_path, coarse_run):
    pyvista = pytest.importorskip("pyvista")
    grid = pyvista.read(coarse_run.states[0].export(tmp_path / "one.vtkhdf"))
    warped = grid.warp_by_vector("displacement")
    assert grid.n_cells == 512 and warped.length > 0.5


def test_states_in_any_order_become_increasing_times(tmp_path, coarse_run):
    first, second, _ = coarse_run.states
    path = coarse_run.only(second, first).export(tmp_path / "two.vtkhdf")
    assert Reader(path).times == (6e3, 18e3)


def test_nothing_to_export_is_a_sentence(tmp_path, coarse_run, refused):
    empty: SteadyResult = coarse_run.only()
    with refused(CaseError):
        empty.export(tmp_path)


def test_only_earlier_exports_are_overwritten(tmp_path, coarse_run, refused, monkeypatch):
    own = tmp_path / "run.vtkhdf"
    shutil.copy(coarse_run.path, own)
    result = dbvfiv.load_result(own)
    with refused(CaseError, match="run.vtkhdf' exists and is no VTKHDF file"):
        result.export(own)
    assert len(dbvfiv.load_result(own).states) == 3
    path = result.export(tmp_path / "fields.vtkhdf", quarter=True)
    assert result.only(*result.states[:2]).export(path) == path and Reader(path).times == (6e3, 18e3)
    monkeypatch.setattr("dbvfiv.record.vtkhdf._write_steps", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        result.export(path)
    assert Reader(path).times == (6e3, 18e3) and {file.name for file in tmp_path.iterdir()} == {own.name, path.name}
