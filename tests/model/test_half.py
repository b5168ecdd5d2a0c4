"""The half of a symmetric valve against its quarter: steady state, matrices, spectra, and the factors to the whole."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from continuation.normal_form import Motion
from dbvfiv.case.parameters import Mu
from dbvfiv.case.part import HALF, QUARTER
from dbvfiv.exchange.bodies import WallFaces, shape_of
from dbvfiv.exchange.files import triangulated
from dbvfiv.model.classes import linearise_class
from dbvfiv.model.forms import ValveForms
from dbvfiv.model.sizes import ValveSizes
from dbvfiv.model.symmetry import HALF_SYMMETRIES, SYMMETRIES
from dbvfiv.motion.start import steady_positions
from dbvfiv.record.mesh import MeshData, WholeValve
from eigen.search import leading_modes
from tests.differences import difference
from tests.model.test_coupled_tangent import direction_of
from tests.model.test_flow_laws import MU
from tests.model.test_residual_forms import check, motions
from tests.model.test_residual_forms import difference as mixed_difference
from tests.small_valves import find_open_state, make_valve

PRESSURE = 12e3
#: Classes of the quarter that a class of the half is made of.
UNION = {"S": ("SS", "AS"), "A": ("SA", "AA")}
#: What a vector and the rotations do in a mirror image at x = 0; the second frame vector is a cross product.
MIRRORED = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def quarter():
    return make_valve()


@pytest.fixture(scope="module")
def half():
    return make_valve({"mesh.part": "half"})


@pytest.fixture(scope="module")
def state(quarter, half):
    """The quarter's state, some of whose stops are made to touch, and its two sides on the half."""
    q = find_open_state().copy()
    q[quarter.stops.unknowns[::2]] = -1e-7
    return q, half.shell.dofs.restrict(lifted(quarter, half, quarter.nodal(q)))


def lifted(quarter, half, nodal, parity=1.0):
    """Nodal unknowns of the half from those (nn, c) of the quarter, as they are and as their mirror image."""
    out = np.zeros(half.shell.dofs.free.shape)
    centre = half.mesh.part.centre(half.mesh.rows.shape[1])
    at = nodal[quarter.mesh.rows]
    out[half.mesh.rows[:, : centre + 1]] = parity * MIRRORED[: nodal.shape[1]] * at[:, ::-1]
    out[half.mesh.rows[:, centre:]] = at
    return out


def basis(quarter, half, symmetry, of_half):
    """(n, k) motions of a class of the half from the unknowns of a class of the quarter."""
    free, of_half = (own.free_unknowns(x.mesh) for x, own in ((quarter, symmetry), (half, of_half)))
    columns = []
    for node, which in zip(*np.nonzero(free)):
        nodal = np.zeros(free.shape)
        nodal[node, which] = 1.0
        columns.append(lifted(quarter, half, nodal, symmetry.signs[0])[of_half])
    return sp.csr_matrix(np.array(columns).T)


def test_sections_of_a_half_are_twice_those_of_the_quarter(quarter, half):
    assert (quarter.mesh.part, half.mesh.part) == (QUARTER, HALF)
    for name in ("rest_area", "wall_deduction", "perimeter"):
        assert getattr(half.mesh, name) == pytest.approx(2 * getattr(quarter.mesh, name), rel=1e-14)
    assert np.array_equal(half.mesh.z, quarter.mesh.z)


def test_sizes_of_a_half_are_those_of_the_quarter(quarter, half, flat):
    one, other = ValveSizes.of(quarter), ValveSizes.of(half)
    assert other.lines() == one.lines() and other.bill_height == pytest.approx(one.bill_height, rel=1e-9)
    sizes, lip = ValveSizes.of(flat), flat.mesh.nodes[flat.mesh.rows[0]]
    assert sizes.bill_width == pytest.approx(np.ptp(lip[:, 0]) + flat.mesh.thickness[0])


def test_the_steady_state_is_that_of_the_quarter(quarter, half):
    q, h = find_open_state(), steady_positions(half, PRESSURE)
    found, expected = half.nodal(h), lifted(quarter, half, quarter.nodal(q))
    for part in (slice(0, 3), slice(3, 5)):
        assert np.abs(found - expected)[:, part].max() < 1e-8 * np.abs(expected[:, part]).max()
    flows = [model.mass_flow(model.rows.areas(model.nodal(x)), PRESSURE) for model, x in ((half, h), (quarter, q))]
    assert flows[0] == pytest.approx(flows[1], rel=1e-8)


@pytest.mark.parametrize("name", list(UNION))
def test_matrices_fall_into_two_classes_of_the_quarter(quarter, half, state, name):
    """Blocks are twice those of the quarter; areas are too, and displacements of the centroids the same."""
    q, h = state
    assert quarter.stops.touching(q) > 3
    whole = linearise_class(half, h, PRESSURE, HALF_SYMMETRIES[name])
    parts = {own: linearise_class(quarter, q, PRESSURE, SYMMETRIES[own]) for own in UNION[name]}
    bases = {own: basis(quarter, half, SYMMETRIES[own], HALF_SYMMETRIES[name]) for own in parts}
    assert np.linalg.matrix_rank(sp.hstack(list(bases.values())).toarray()) == whole.mass.shape[0]
    for matrix in ("mass", "structure", "stiffness"):
        size = abs(getattr(whole, matrix)).max()
        for own, right in bases.items():
            for other, left in bases.items():
                expected = 2 * getattr(parts[own], matrix).toarray() if own == other else 0.0
                block = (left.T @ getattr(whole, matrix) @ right).toarray()
                assert np.abs(block - expected).max() < 1e-11 * size, (matrix, own, other)
    slope = {own: (whole.slope @ found).toarray() for own, found in bases.items()}
    coupled, still = UNION[name]
    factor = 2.0 if name == "S" else 1.0
    assert slope[coupled] == pytest.approx(factor * parts[coupled].slope.toarray(), abs=1e-12 * abs(whole.slope).max())
    assert np.abs(slope[still]).max() < 1e-12 * abs(whole.slope).max()


@pytest.mark.slow
def test_the_spectrum_is_the_union_of_two_classes_of_the_quarter(quarter, half):
    """Motions sideways with the fluid."""
    q = find_open_state()
    h = half.shell.dofs.restrict(lifted(quarter, half, quarter.nodal(q)))
    conditions = Mu(density=10.0, alpha=0.0, beta=0.003)
    union = np.concatenate(
        [
            leading_modes(linearise_class(quarter, q, PRESSURE, SYMMETRIES[own]).pencil(conditions), 8).eigenvalues
            for own in UNION["A"]
        ]
    )
    found = leading_modes(linearise_class(half, h, PRESSURE, HALF_SYMMETRIES["A"]).pencil(conditions), 8).eigenvalues
    assert len(found) == 8
    gaps = np.abs(found[:, None] - union)
    assert np.all(gaps.min(axis=1) < 1e-8 * np.abs(found))
    assert len(set(np.argmin(gaps, axis=1))) == 8
    assert {int(i >= 8) for i in np.argmin(gaps, axis=1)} == {0, 1}


@pytest.mark.parametrize("lips, pipe", [("closed", None), ("open", 0.4)])
def test_water_around_a_half_is_that_around_two_classes_of_the_quarter(lips, pipe):
    """Impedances of its panels, in both of its classes."""
    keys = {"outside.fluid": "same", "outside.lips": lips} | ({"outside.pipe_diameter": pipe} if pipe else {})
    quarter, half = make_valve(keys), make_valve(keys | {"mesh.part": "half"})
    q = 0.5 * find_open_state()
    h = half.shell.dofs.restrict(lifted(quarter, half, quarter.nodal(q)))
    centres = [x.outside.panels(y).centres[: len(x.shell.mesh.quads)] for x, y in ((quarter, q), (half, h))]
    there = [np.argmin(np.linalg.norm(centres[1] - c * [s, 1, 1], axis=1)) for s in (1, -1) for c in centres[0]]
    right, left = np.split(np.array(there), 2)
    for name, (even, odd) in UNION.items():
        whole = half.outside.impedance(h, symmetry=name).matrix()
        for sign, own in ((1.0, even), (-1.0, odd)):
            sides = whole[np.ix_(right, right)] + sign * whole[np.ix_(right, left)]
            expected = quarter.outside.impedance(q, symmetry=own).matrix()
            assert np.abs(sides - expected).max() < 1e-8 * np.abs(expected).max(), (name, own)


def test_images_of_a_half_are_the_whole_valve(quarter, half):
    whole = [WholeValve.of(MeshData.of(model)) for model in (quarter, half)]
    points, others = (np.round(valve.points, 12) + 0.0 for valve in whole)
    assert {tuple(p) for p in points} == {tuple(p) for p in others} and len(points) == len(others)
    assert len(whole[0].quads) == len(whole[1].quads)
    normal = [
        np.cross(v.points[v.quads[:, 2]] - v.points[v.quads[:, 0]], v.points[v.quads[:, 3]] - v.points[v.quads[:, 1]])
        for v in whole
    ]
    outwards = [np.sum(n * v.points[v.quads].mean(axis=1), axis=0) for n, v in zip(normal, whole)]
    assert outwards[1] == pytest.approx(outwards[0], rel=1e-12)


@pytest.mark.parametrize("name", ["fluid", "wall"])
def test_bodies_of_a_half_are_closed(quarter, half, name):
    """Triangles of a coarse grid depend on the way of their diagonals, sections do not."""
    nodal = quarter.nodal(find_open_state())
    whole = WallFaces.of(MeshData.of(quarter), nodal)
    faces = WallFaces.of(MeshData.of(half), lifted(quarter, half, nodal))
    assert faces.section_areas() == pytest.approx(2 * whole.section_areas(), rel=1e-12)
    both, alone = (triangulated(shape_of(faces, name, mirrored)).volume for mirrored in (True, False))
    assert both == pytest.approx(2 * alone, rel=1e-12)
    assert both == pytest.approx(triangulated(shape_of(whole, name)).volume, rel=0.03)


# -- a bill with a flat bottom


@pytest.fixture(scope="module")
def flat():
    return make_valve({"valve.bill_offset": 1.0, "valve.lip_half_width": 0.2})


def test_a_flat_bottom_runs_straight_on_from_the_pipe(flat):
    valve, mesh = flat.case.valve, flat.mesh
    places = mesh.nodes[mesh.rows][:, :, 0]
    assert places[:, 0] == pytest.approx(-valve.flange_radius, rel=1e-14)
    duckbill = mesh.z <= valve.duckbill_length
    assert places[duckbill, -1] == pytest.approx(2 * valve.lip.widest - valve.flange_radius, rel=1e-14)
    assert mesh.nodes[mesh.centre_line[0], 0] == pytest.approx(valve.bill_shift, rel=1e-14)
    symmetric = make_valve({"mesh.part": "half", "valve.lip_half_width": 0.2}).mesh
    assert mesh.rest_area == pytest.approx(symmetric.rest_area, rel=1e-12)


@pytest.fixture(scope="module")
def flat_state(flat):
    return steady_positions(flat, 4e3)


def test_a_flat_bottom_moves_its_lips_sideways(flat, flat_state):
    """No symmetry is left that would hold the middle of the lips: opening and sway in x are one motion."""
    nodal = flat.nodal(flat_state)[flat.mesh.rows]
    assert np.abs(nodal[0, flat.mesh.part.centre(nodal.shape[1]), 0]) > 1e-4
    assert np.abs(nodal[:, 0, 0] + nodal[:, -1, 0]).max() > 1e-4
    tangent = flat.tangent(flat_state, 4e3)
    assert np.linalg.norm(tangent.residual) < 1e-6 * flat.force_scale(flat_state, 4e3)


def test_tangent_of_a_flat_bottom_against_differences(flat, flat_state):
    assert flat.stops.touching(flat_state) == 0
    tangent, direction = flat.tangent(flat_state, 4e3), direction_of(flat, 2)
    distance = np.abs(flat_state[flat.stops.unknowns]).min()
    step = min(1e-3, 0.2 * distance / np.abs(direction[flat.stops.unknowns]).max())
    slope = difference(lambda x: flat.residual(x, 4e3), flat_state, direction, step)
    assert np.linalg.norm(flat.apply(tangent, direction) - slope) < 1e-7 * np.linalg.norm(slope)


@pytest.mark.slow
def test_second_derivatives_of_a_flat_bottom(flat, flat_state):
    forms = ValveForms(flat, flat_state, MU | {"inlet": 4e3, "storage": 1.0})
    # of motions ten times smaller than those of the quarter's check: the lips of this state stand nearer to their stops
    directions = [Motion(motion.rate, 0.1 * motion.vector) for motion in motions(forms, 2)]
    check(forms, forms.second(*directions).real, mixed_difference(forms, directions, forms.mu), 1e-3)
