"""A thin ring under outside pressure buckles at p R^3/(EI) = 3 if the pressure follows the wall, at 4 if its direction
stays (dead load).

The difference is the pressure stiffness alone. Quarter of the ring between two symmetry planes, nu = 0, nothing moves
along the axis.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sl

from dbvfiv.shell import Shell, ShellMesh
from tests.shell.structures import isotropic_section, observed_order, pressure_load, quarter_ring, richardson

RADIUS, H, WIDTH, E = 1.0, 0.01, 0.1, 1e9
UNIT = E * H**3 / 12 / RADIUS**3  # EI/R^3 per unit width


def ring(elements: int) -> Shell:
    patch, planes, free = quarter_ring(elements, RADIUS, WIDTH)
    mesh = ShellMesh.build(patch.nodes, patch.quads, H, planes=planes)
    return Shell(mesh, isotropic_section(E, 0.0, H), free)


def linearised(shell: Shell, follower: bool):
    """Stiffness at rest and its derivative with respect to the outside pressure on the equilibrium path."""
    rest, small = np.zeros(shell.size), 1e-3 * UNIT
    inside, turned = pressure_load(shell)(rest, 1.0)
    stiffness = shell.dofs.matrix(shell.force_and_tangent(rest)[1]).toarray()
    q = -small * np.linalg.solve(stiffness, inside)
    slope = (shell.dofs.matrix(shell.force_and_tangent(q)[1]).toarray() - stiffness) / small
    if follower:
        slope += shell.dofs.matrix(turned).toarray()  # outside pressure: minus the force, minus once more in K
    return stiffness, slope


def critical(elements: int, follower: bool) -> float:
    """Lowest critical pressure over EI/R^3."""
    stiffness, slope = linearised(ring(elements), follower)
    # K0 x = -p K1 x
    values = sl.eigvals(-slope, stiffness)
    values = 1 / np.real(
        values[(np.abs(values.imag) < 1e-9 * np.abs(values).max()) & (values.real > 1e-9 * np.abs(values).max())]
    )
    return float(values.min()) / UNIT


@pytest.mark.parametrize("follower, exact", [(True, 3.0), (False, 4.0)])
def test_ring_buckles(follower, exact):
    """0.5 % on 32 elements of the quarter, second order, the limit within 0.05 % (thickness and compression count with
    h^2/R^2 = 1e-4).
    """
    values = [critical(n, follower) for n in (8, 16, 32)]
    order, limit = richardson(values)
    print(
        f"\n{'follower' if follower else 'dead'}: {np.round(values, 5)} order {order:.2f} limit {limit:.5f} "
        f"exact {exact}"
    )
    assert values[-1] == pytest.approx(exact, rel=5e-3)
    assert limit == pytest.approx(exact, rel=5e-4)
    assert order == pytest.approx(2.0, abs=0.2)
    assert observed_order(np.array(values) - exact)[-1] == pytest.approx(2.0, abs=0.3)
