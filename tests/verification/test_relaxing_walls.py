"""Walls that relax against complex moduli: a cantilever of one layer, a sandwich, and the limit of a dashpot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from dbvfiv.case.parameters import Mu
from dbvfiv.materials.laws import IsotropicElastic
from dbvfiv.materials.prony import Prony
from dbvfiv.model import ValveModel, linearise
from dbvfiv.model.build import build_section
from dbvfiv.model.relaxing import WallRelaxation
from dbvfiv.motion.start import steady_positions
from dbvfiv.shell import Layer, Section, Shell, ShellMesh
from dbvfiv.studies.case import thesis_case
from eigen import CoupledPencil, Relaxation, SearchOptions, leading_modes
from tests.shell.structures import rectangle
from tests.verification.critical import root

SERIES = Prony((0.12, 0.15, 0.1), (4e-4, 4e-3, 4e-2))
LENGTH, WIDTH = 0.2, 0.02


def strip(section: Section, elements: int, held: str) -> Shell:
    """A strip along x that bends in x and z alone; "clamped" at one end or "pinned" at both."""
    patch = rectangle(elements, 1, LENGTH, WIDTH)
    thickness = sum(layer.thickness for layer in section.layers)
    mesh = ShellMesh.build(patch.nodes, patch.quads, thickness, material_axis=(1.0, 0.0, 0.0))
    assert np.allclose(mesh.frames[:, 0], [1.0, 0.0, 0.0])
    free = np.zeros((mesh.node_count, 5), bool)
    free[:, 2:4] = True
    if held == "clamped":
        free[patch.index[0]] = False
    else:
        free[patch.index[[0, -1]].ravel(), 2] = False
    return Shell(mesh, section, free)


def pencil_of(shell: Shell) -> CoupledPencil:
    """Small motions about rest."""
    rest, matrix = np.zeros(shell.size), shell.dofs.matrix
    relaxation = WallRelaxation.of(shell.section).stiffness(
        1.0, lambda: [matrix(values) for values in shell.relaxing_tangents(rest)]
    )
    mass, stiffness = matrix(shell.mass()), matrix(shell.force_and_tangent(rest)[1])
    return CoupledPencil(mass, 0.0 * mass, stiffness, relaxation=relaxation)


def oscillating(values: np.ndarray, count: int) -> np.ndarray:
    """The slowest of those above the real axis."""
    above = values[values.imag > 1e-6 * np.abs(values)]
    return above[np.argsort(above.imag)][:count]


def dense_modes(pencil: CoupledPencil, count: int) -> np.ndarray:
    """By the first-order form."""
    return oscillating(scipy.linalg.eig(*pencil.first_order(), right=False), count)


def test_every_mode_of_a_cantilever_of_one_layer_has_the_complex_modulus():
    """Nothing is stressed, so the whole stiffness relaxes: lambda^2 + r(lambda) omega^2 = 0 for every elastic omega."""
    section = Section((Layer(IsotropicElastic(6e6, 0.4, 1200.0), 0.012, 0.0, 5 / 6, "rubber", SERIES),))
    pencil = pencil_of(strip(section, 12, "clamped"))
    elastic = np.sqrt(scipy.linalg.eigh(pencil.K.toarray(), pencil.M.toarray(), eigvals_only=True))
    expected = np.array([root(lambda s: s * s + SERIES.modulus(s) * w * w, 1j * w) for w in elastic])
    found = dense_modes(pencil, len(elastic))
    expected = expected[np.argsort(expected.imag)]
    damping = [-x.real / np.abs(x) for x in (found, expected)]
    print(
        f"\nfrequencies {elastic[:4] / 2 / np.pi} to {found[:4].imag / 2 / np.pi} Hz, damping ratios {damping[0][:4]}"
    )
    assert np.abs(found.imag / expected.imag - 1).max() < 1e-6
    assert np.abs(damping[0] / damping[1] - 1).max() < 1e-6
    shift = found.imag / elastic - 1
    assert shift.min() > 0.01  # what relaxes also stiffens


CORE = IsotropicElastic(2e6, 0.0, 1000.0)


def sandwich(skin: IsotropicElastic, thickness: float, core: float, shear: float) -> Section:
    """A core that relaxes between skins that do not; `shear` is the skins' shear correction."""
    outer = Layer(skin, thickness, 0.0, shear, "skin")
    return Section((outer, Layer(CORE, core, 0.0, 1.0, "core", SERIES), outer))


def compare(section: Section, determinant, count: int, tolerance: float, elements: int) -> None:
    """Modes of a pinned strip against the zeros of a determinant of half waves and eigenvalue."""
    found = dense_modes(pencil_of(strip(section, elements, "pinned")), count)
    for number, value in enumerate(found, start=1):
        expected = root(lambda s: determinant(number * np.pi / LENGTH, s), value)
        ratios = [-x.real / abs(x) for x in (value, expected)]
        print(f"mode {number}: {value.imag / 2 / np.pi:.5g} Hz, by {expected.imag / 2 / np.pi:.5g}; damping {ratios}")
        assert value.imag == pytest.approx(expected.imag, rel=tolerance)
        assert ratios[0] == pytest.approx(ratios[1], rel=tolerance)
        # less than the core has, and not nothing
        assert 1e-4 < ratios[0] < 0.5 * SERIES.loss_factor(value.imag / 2 / np.pi)


def test_a_sandwich_with_thin_skins_is_that_of_ross_kerwin_and_ungar():
    """Skins that stretch and slide over a core that shears.

    They do so by a shear of the core of its own, while a first-order layered shell has one director for all layers: its
    shear is the same in skins and core. Both are one as the skins become thin, if the skins' own shear, which has
    nothing to do there, is left without stiffness.
    """
    modulus, thin, core = 20e9, 5e-5, 1e-2
    skin = IsotropicElastic(modulus, 0.0, 1500.0)
    mass, between = 1500.0 * 2 * thin + 1000.0 * core, core + thin

    def determinant(k, s):
        y = 2 * 1e6 * SERIES.modulus(s) / (modulus * thin * core * k * k)
        stiffness = modulus * thin**3 / 6 + 0.5 * modulus * thin * between**2 * y / (1 + y)
        return mass * s * s + stiffness * k**4

    compare(sandwich(skin, thin, core, 1e-9), determinant, 3, 0.02, 32)


@pytest.mark.slow
def test_a_sandwich_with_thick_skins_is_the_beam_with_one_rotation_for_all_layers():
    """Where skins are thick the shell cannot slide them; the reference is the independent solution of the same theory:
    a Timoshenko beam with complex section constants.
    """
    modulus, thick, core = 70e6, 2e-3, 8e-3
    skin, total = IsotropicElastic(modulus, 0.0, 1500.0), 2 * thick + core
    inner = core**3 / 12
    outer = total**3 / 12 - inner
    mass, rotary = 1500.0 * 2 * thick + 1000.0 * core, 1500.0 * outer + 1000.0 * inner

    def determinant(k, s):
        r = SERIES.modulus(s)
        bending = modulus * outer + r * 2e6 * inner
        shear = 0.1 * 0.5 * modulus * 2 * thick + r * 1e6 * core
        return (shear * k * k + mass * s * s) * (bending * k * k + shear + rotary * s * s) - (shear * k) ** 2

    compare(sandwich(skin, thick, core, 0.1), determinant, 4, 0.02, 60)


@pytest.fixture(scope="module")
def pressed():
    """A small valve at 6 kPa whose layers all relax by one series."""
    case = thesis_case({"mesh.around": 6, "mesh.along": 12, "damping.alpha": 0.0, "damping.beta": 0.0})
    plain = build_section(case)
    layers = tuple(replace(layer, relaxation=SERIES) for layer in plain.layers)
    model = ValveModel(case, Section(layers, plain.points_per_layer))
    return linearise(model, steady_positions(model, 6e3), 6e3)


@pytest.mark.parametrize("fluid", [False, True], ids=["in vacuo", "with fluid"])
def test_a_branch_that_relaxes_at_once_is_a_dashpot(pressed, fluid):
    """g tau = beta as tau tends to zero: C = beta K, of the material part alone in both."""
    beta, tau, search = 1e-3, 1e-10, SearchOptions(max_frequency=60.0)
    (material,) = pressed.relaxing
    plain = pressed.pencil(Mu(density=10.0, alpha=0.0, beta=0.0), fluid)
    dashpot = plain.replace(C=beta * material)
    branch = plain.replace(relaxation=Relaxation([material], [[beta / tau]], [tau]))
    whole = plain.replace(C=beta * pressed.structure)
    values = [oscillating(leading_modes(p, 6, search).eigenvalues, 3) for p in (dashpot, branch, whole)]
    off = np.abs(values[1] / values[0] - 1)
    geometric = np.abs(values[2] / values[0] - 1)
    print(f"\n{values[0]}: branch off by {off}, with the geometric part damped as well by {geometric}")
    assert off.max() < 1e-6
    assert len(values[0]) == 3
