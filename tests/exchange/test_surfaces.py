"""Surfaces and bodies of states: watertight, symmetric, of the volume that slices of them and the law's areas say."""

import json

import numpy as np
import pytest
import pyvista
from hypothesis import given
from hypothesis import strategies as st

from dbvfiv.errors import CaseError
from dbvfiv.exchange.bodies import SHAPES, WallFaces, shape_of, trim_section
from dbvfiv.exchange.files import open_gmsh, state_name, triangulated, write_shapes, write_step


@pytest.fixture(scope="module")
def narrow(coarse_valve):
    """A state whose lips nearly touch."""
    return coarse_valve.steady(pressure=800.0)


def faces_of(state):
    return WallFaces.of(state.results.mesh, state.nodal)


def test_states_at_pressures_that_differ_have_files_of_their_own():
    names = [state_name("dbv12", pressure) for pressure in (36e3, 12341.0, 12344.0)]
    assert names == ["dbv12-36kPa", "dbv12-12.341kPa", "dbv12-12.344kPa"]


def slice_area(body, z):
    """Area of a closed body cut at z."""
    cut = body.slice(normal="z", origin=(0, 0, z))
    a, b = (cut.points[cut.lines.reshape(-1, 3)[:, i]] for i in (1, 2))
    normal = body.compute_normals(cell_normals=True, point_normals=False)
    near = np.array([normal.find_closest_cell(p) for p in 0.5 * (a + b)])
    outward = normal.cell_data["Normals"][near]
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    side = np.sign((b - a)[:, 1] * outward[:, 0] - (b - a)[:, 0] * outward[:, 1])
    return 0.5 * np.sum(cross * side)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_bodies_are_watertight_and_mirrored(coarse_run, number):
    faces = faces_of(coarse_run.states[number])
    for name in ("wall", "fluid"):
        quarter, whole = (triangulated(shape_of(faces, name, w)) for w in (False, True))
        assert quarter.is_manifold and whole.is_manifold and quarter.n_open_edges == whole.n_open_edges == 0
        assert whole.volume == pytest.approx(4 * quarter.volume, rel=1e-5)  # stored in single precision
        assert np.allclose(np.abs(whole.points).max(0), np.abs(quarter.points).max(0))


def test_lips_that_nearly_touch_leave_a_watertight_passage(narrow):
    assert narrow.lip_opening < 3.5e-3
    fluid = triangulated(shape_of(faces_of(narrow), "fluid"))
    assert fluid.is_manifold and fluid.volume > 0


@pytest.mark.parametrize("number", [1, 2])
def test_volume_of_the_fluid_is_the_integral_of_its_sections(coarse_run, number):
    state = coarse_run.states[number]
    faces = faces_of(state)
    fluid = triangulated(shape_of(faces, "fluid"))
    z = np.linspace(0.006, 0.554, 60)
    areas = np.array([slice_area(fluid, level) for level in z])
    rows = faces.inner[..., 2].mean(axis=1)
    ends = 4 * np.interp([z[0], z[-1]], rows, faces.section_areas())
    assert areas[[0, -1]] == pytest.approx(ends, rel=0.01)
    inside = fluid.clip_closed_surface("z", origin=(0, 0, z[0])).clip_closed_surface("-z", origin=(0, 0, z[-1]))
    assert inside.volume == pytest.approx(np.trapz(areas, z), rel=2e-3)
    # what the flow law takes for the area is that of the mid-surface less a wall that knows nothing of its slope
    law = 4 * np.interp(z, rows, state.station_area)
    assert inside.volume == pytest.approx(np.trapz(law, z), rel=0.03)


def test_wall_holds_the_rubber(coarse_run):
    """Volume of the wall at rest: area of the mid-surface times thickness, to second order in thickness over radius."""
    mesh = coarse_run.mesh
    middle = triangulated(shape_of(WallFaces.of(mesh, coarse_run.states[0].nodal), "middle", whole=False))
    wall = triangulated(shape_of(WallFaces.of(mesh, coarse_run.states[0].nodal), "wall", whole=False))
    cell_area = middle.compute_cell_sizes(length=False, volume=False).cell_data["Area"].sum()
    mean = np.average(mesh.thickness, weights=np.ones(len(mesh.thickness)))
    assert wall.volume == pytest.approx(cell_area * mean, rel=0.03)


def test_shut_passage_is_a_sentence(coarse_run, refused, tmp_path):
    mesh = coarse_run.mesh
    with refused(CaseError) as caught:
        WallFaces.of(mesh, np.zeros((len(mesh.nodes), 5)))  # the saddle's thicker wall meets itself at rest
    assert "no open passage" in str(caught.value)
    with refused(CaseError):
        write_shapes(mesh, np.zeros((len(mesh.nodes), 5)), tmp_path, "shut", shapes=["outer", "fluid"])
    open_ = write_shapes(mesh, np.zeros((len(mesh.nodes), 5)), tmp_path, "shut", shapes=["outer", "middle"])
    assert [path.name for path in open_] == ["shut-outer.stl", "shut-middle.stl"]


@given(st.integers(5, 30), st.floats(0.3, 3.0), st.floats(0.01, 0.4), st.integers(0, 4), st.integers(0, 2**32 - 1))
def test_trimmed_sections_bound_what_lies_in_front_of_folds(count, ratio, depth, folds, seed):
    """An ellipse moved inwards by more than its sharpest radius folds; what is left is simple and within it."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, np.pi / 2, count)
    curve = np.column_stack([np.sin(t), ratio * np.cos(t)])
    normal = np.column_stack([ratio * np.sin(t), np.cos(t)])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    inner = np.column_stack([curve - depth * min(ratio, 1.0) * normal, rng.uniform(0, 0.01, count)])
    if folds:  # points thrown about as directors near a fold do
        inner[-folds:-1, :2] += rng.normal(0, 0.02, (folds - 1, 2))
    inner[0, 0], inner[-1, 1] = 0.0, 0.0
    path = trim_section(inner)
    assert np.array_equal(path[0], inner[0]) and path[-1, 1] == 0.0
    assert np.all(np.diff(path[:, 0]) >= 0) and np.all(path[:-1, 1] > 0)
    assert path[:, 0].max() <= inner[:, 0].max() + 1e-12


def test_sections_without_folds_stay_as_they_are(coarse_run):
    for state in coarse_run.states:
        faces, raw = faces_of(state), None
        assert np.all(np.diff(faces.inner[..., 0], axis=1) >= 0)
        raw = 2 * faces.middle - faces.outer
        assert np.allclose(faces.inner[0], raw[0]) and np.allclose(faces.inner[-4:], raw[-4:])


def needs_gmsh():
    try:
        with open_gmsh("trial"):
            return False
    except CaseError:
        return True


@pytest.mark.skipif(needs_gmsh(), reason="gmsh cannot be loaded")
@pytest.mark.parametrize("name", list(SHAPES))
def test_step_holds_the_same_shapes(coarse_run, tmp_path, name):
    faces = faces_of(coarse_run.states[-1])
    path = tmp_path / f"{name}.step"
    shape = shape_of(faces, name)
    measured = write_step(shape, path, name)
    triangles = triangulated(shape)
    assert measured["area"] == pytest.approx(triangles.area, rel=5e-3)
    with open_gmsh("again") as gmsh:
        found = gmsh.model.occ.importShapes(str(path))
        gmsh.model.occ.synchronize()
        assert {dimension for dimension, _ in found} == ({3} if shape.closed else {2})
        box = np.array(gmsh.model.getBoundingBox(-1, -1)).reshape(2, 3)
        assert np.allclose(box / 1e3, [triangles.points.min(0), triangles.points.max(0)], atol=2e-4)
        if shape.closed:
            assert gmsh.model.occ.getMass(*found[0]) / 1e9 == pytest.approx(triangles.volume, rel=0.02)


def test_missing_gmsh_is_a_sentence(monkeypatch, coarse_run, tmp_path, refused):
    monkeypatch.setitem(__import__("sys").modules, "gmsh", None)
    with refused(CaseError) as caught:
        coarse_run.states[-1].export_shapes(tmp_path, "step")
    assert "pip install gmsh" in str(caught.value)


def test_command(command_line, coarse_run, tmp_path, misused):
    done = command_line("export", coarse_run.path, "--format", "stl", "--state", "17 kPa", "-o", tmp_path, "--json")
    written = json.loads(done.out)["written"]
    assert [p.rsplit("/", 1)[1] for p in written] == [f"dbv12-18kPa-{name}.stl" for name in SHAPES]
    assert pyvista.read(written[-1]).is_manifold
    misused("", "export", coarse_run.path, "--format", "stl", "--shape", "egg")


@pytest.mark.skipif(needs_gmsh(), reason="gmsh cannot be loaded")
def test_json_stands_alone_beside_the_kernels_reports(coarse_run, tmp_path, capfd):
    from dbvfiv.cli import run

    arguments = ["export", coarse_run.path, "--format", "step", "--shape", "inner", "-o", tmp_path, "--json"]
    assert run([str(a) for a in arguments]) == 0
    assert json.loads(capfd.readouterr().out)["written"]
