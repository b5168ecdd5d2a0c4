"""Simply supported square cross-ply plates: deflections and frequencies of first-order shear theory.

Reference values: exact Navier series with the shear correction 5/6 (rotary inertia included in the frequencies). Moduli
ratios of the classical laminate benchmarks: static E1/E2 = 25, G12 = G13 = 0.5 E2, G23 = 0.2 E2, nu12 = 0.25; dynamic
40, 0.6, 0.6, 0.5, 0.25.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.linalg import splu

from dbvfiv.materials.laws import OrthotropicPly
from dbvfiv.shell import Layer, Section, Shell, ShellMesh
from dbvfiv.shell.pressure import pressure_force
from tests.shell.structures import lowest_frequencies, rectangle, richardson

STATIC = OrthotropicPly(25.0, 1.0, 0.25, 0.5, 0.5, 0.2, 1.0)
DYNAMIC = OrthotropicPly(40.0, 1.0, 0.25, 0.6, 0.6, 0.5, 1.0)

# w' = 100 w E2 h^3 / (q0 a^4), sinusoidal and uniform load
DEFLECTIONS = {
    ((0, 90, 0), 4): (1.7758, 2.6595),
    ((0, 90, 0), 10): (0.6693, 1.0219),
    ((0, 90, 0), 100): (0.4337, 0.6697),
    ((0, 90), 4): (2.1492, 3.2709),
    ((0, 90), 10): (1.2373, 1.9469),
    ((0, 90), 100): (1.0653, 1.6980),
}
# w' = omega a^2 / h sqrt(rho / E2)
FREQUENCIES = {
    ((0, 90), 5): 8.8333,
    ((0, 90), 10): 10.4731,
    ((0, 90), 100): 11.2990,
    ((0, 90, 0), 5): 10.2895,
    ((0, 90, 0), 10): 14.7662,
    ((0, 90, 0), 100): 18.8294,
}


def quarter_plate(ply, angles, slenderness: int, n: int) -> tuple[Shell, np.ndarray]:
    """Quarter of a unit plate on n by n elements, hard simple supports that let each edge move along its normal."""
    h = 1.0 / slenderness
    patch = rectangle(n, n, 0.5, 0.5)
    section = Section(tuple(Layer(ply, h / len(angles), angle, 5 / 6) for angle in angles))
    free = np.ones((len(patch.nodes), 5), bool)
    free[np.ix_(patch.index[0], [1, 2, 4])] = False  # edge x = 0: v, w and the rotation towards y
    free[np.ix_(patch.index[:, 0], [0, 2, 3])] = False  # edge y = 0
    free[np.ix_(patch.index[-1], [0, 3])] = False  # symmetry
    free[np.ix_(patch.index[:, -1], [1, 4])] = False
    mesh = ShellMesh.build(patch.nodes, patch.quads, h, material_axis=(1.0, 0, 0))
    return Shell(mesh, section, free), patch.index


def deflections(angles, slenderness, n) -> list[float]:
    """Under sinusoidal and uniform load."""
    shell, index = quarter_plate(STATIC, angles, slenderness, n)
    x, y = shell.mesh.nodes[:, :2].T
    stiffness = splu(shell.dofs.matrix(shell.force_and_tangent(np.zeros(shell.size))[1]).tocsc())
    found = []
    for pressure in (np.sin(np.pi * x) * np.sin(np.pi * y), np.ones(len(x))):
        out = np.zeros((len(x), 5))
        pressure_force(
            shell.mesh.quads, shell.mesh.nodes, np.zeros_like(out), pressure, np.ones(shell.mesh.element_count), out
        )
        w = shell.dofs.expand(stiffness.solve(shell.dofs.restrict(out)))[index[-1, -1], 2]
        found.append(100 * w / slenderness**3)
    return found


def frequency(angles, slenderness, n) -> float:
    shell, _ = quarter_plate(DYNAMIC, angles, slenderness, n)
    stiffness = shell.force_and_tangent(np.zeros(shell.size))[1]
    return 2 * np.pi * lowest_frequencies(shell, stiffness, shell.mass(), 1)[0] * slenderness


@pytest.mark.parametrize("angles, slenderness", DEFLECTIONS, ids=str)
def test_deflection_under_load(angles, slenderness):
    """0.1 % on 32 x 32 elements of the quarter; second order; the limit within the last printed digit (0.02 %)."""
    found = np.transpose([deflections(angles, slenderness, n) for n in (8, 16, 32)])
    for load, exact, values in zip(("sinusoidal", "uniform"), DEFLECTIONS[angles, slenderness], found):
        order, limit = richardson(values)
        print(
            f"\n{angles} a/h {slenderness} {load}: {values[0]:.4f} {values[1]:.4f} {values[2]:.4f} order "
            f"{order:.2f} -> {limit:.4f}, exact {exact}"
        )
        assert values[-1] == pytest.approx(exact, rel=1e-3)
        assert limit == pytest.approx(exact, rel=2e-4)
        assert order == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("angles, slenderness", FREQUENCIES, ids=str)
def test_lowest_frequency(angles, slenderness):
    """0.1 % on 32 x 32 elements of the quarter, second order, the limit within 0.01 %."""
    exact = FREQUENCIES[angles, slenderness]
    values = [frequency(angles, slenderness, n) for n in (8, 16, 32)]
    order, limit = richardson(values)
    print(
        f"\n{angles} a/h {slenderness}: {values[0]:.4f} {values[1]:.4f} {values[2]:.4f} order {order:.2f} "
        f"-> {limit:.4f}, exact {exact}"
    )
    assert values[-1] == pytest.approx(exact, rel=1e-3)
    assert limit == pytest.approx(exact, rel=1e-4)
    assert order == pytest.approx(2.0, abs=0.2)
