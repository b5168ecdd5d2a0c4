"""What the consistent and the averaged mass leave of error in frequencies, against closed forms.

Of waves of number k on elements of length h, by the symbols of the element's stiffness and mass on a row of equal
elements, a frequency is off by

    stretching: + (k h)^2/24 with the consistent mass, - (k h)^4/480 with the averaged one,
    bending of a thin strip: + (k h)^2/8 and + (k h)^2/12.

Lengthwise the errors of stiffness and averaged mass cancel; the bent element, whose slopes are those of its chords, is
too stiff by (k h)^2/12 where the stretched one is too soft by as much.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

from dbvfiv.shell import Shell, ShellMesh
from dbvfiv.shell.mass import AVERAGED, CONSISTENT

from .structures import isotropic_section, observed_order, rectangle

E, DENSITY, LENGTH, WALL = 1e6, 1000.0, 1.0, 0.02
ELEMENTS = (8, 16, 32)


def lowest_frequency(elements: int, mass_kind: str, choose_free) -> float:
    """Lowest angular frequency, rad/s, of a strip one element wide without Poisson's effect."""
    patch = rectangle(elements, 1, LENGTH, 0.05)
    mesh = ShellMesh.build(patch.nodes, patch.quads, WALL, material_axis=(1.0, 0.0, 0.0))
    free = np.zeros((mesh.node_count, 5), bool)
    choose_free(free, patch.index)
    shell = Shell(mesh, isotropic_section(E, 0.0, WALL, DENSITY), free, mass_kind=mass_kind)
    matrices = (shell.force_and_tangent(np.zeros(shell.size))[1], shell.mass())
    stiffness, mass = (shell.dofs.matrix(values).toarray() for values in matrices)
    return float(np.sqrt(la.eigh(stiffness, mass, eigvals_only=True, subset_by_index=(0, 0))[0]))


def errors(mass_kind: str, choose_free, exact: float) -> np.ndarray:
    """Relative errors of the lowest frequency on `ELEMENTS`."""
    return np.array([lowest_frequency(n, mass_kind, choose_free) / exact - 1.0 for n in ELEMENTS])


def held_bar(free, index):
    """Stretching alone, held at one end."""
    free[index[1:], 0] = True


def supported_beam(free, index):
    """Bending alone, simply supported at both ends."""
    free[:, 2:] = True
    free[index[[0, -1]], 2] = False


def timoshenko(k: float) -> float:
    """Lower angular frequency, rad/s, of a simply supported beam of unit width, shear and rotary inertia included."""
    bending, shear = E * WALL**3 / 12, 5 / 6 * E / 2 * WALL
    stiffness = [[bending * k**2 + shear, shear * k], [shear * k, shear * k**2]]
    inertia = np.diag([DENSITY * WALL**3 / 12, DENSITY * WALL])
    return float(np.sqrt(la.eigh(stiffness, inertia, eigvals_only=True)[0]))


@pytest.mark.parametrize("mass_kind, power, share", [(CONSISTENT, 2, 1 / 24), (AVERAGED, 4, -1 / 480)])
def test_a_stretched_bar(mass_kind, power, share):
    """omega = (pi/2) sqrt(E/rho)/L, held at one end: from above with order 2, from below with order 4."""
    k = np.pi / (2 * LENGTH)
    found = errors(mass_kind, held_bar, k * np.sqrt(E / DENSITY))
    print(f"\n{mass_kind}: {found}, orders {np.round(observed_order(found), 3)}")
    assert found == pytest.approx(share * (k * LENGTH / np.array(ELEMENTS)) ** power, rel=5e-3)
    assert observed_order(found)[-1] == pytest.approx(power, abs=0.01)


@pytest.mark.parametrize("mass_kind, share", [(CONSISTENT, 1 / 8), (AVERAGED, 1 / 12)])
def test_a_bent_beam(mass_kind, share):
    """Order 2 with both; the averaged mass takes off a third of the error."""
    k = np.pi / LENGTH
    found = errors(mass_kind, supported_beam, timoshenko(k))
    print(f"\n{mass_kind}: {found}, orders {np.round(observed_order(found), 3)}")
    assert found[1:] == pytest.approx(share * (k * LENGTH / np.array(ELEMENTS[1:])) ** 2, rel=0.02)
    assert observed_order(found)[-1] == pytest.approx(2.0, abs=0.03)


def test_an_unknown_mass():
    patch = rectangle(1, 1, 1.0, 1.0)
    mesh = ShellMesh.build(patch.nodes, patch.quads, WALL, material_axis=(1.0, 0.0, 0.0))
    with pytest.raises(ValueError, match="The mass is 'lumped', but only 'consistent' and 'averaged' exist"):
        Shell(mesh, isotropic_section(E, 0.0, WALL), mass_kind="lumped")


def test_other_unknowns_of_the_same_shell(saddle_shell):
    """Held unknowns are all that changes: element, metric and mass stay."""
    mesh, wall = saddle_shell.mesh, saddle_shell.section
    shell = Shell(mesh, wall, saddle_shell.dofs.free, element="MITC4", mass_kind=CONSISTENT)
    loose, whole = shell.with_free(), Shell(mesh, wall, element="MITC4", mass_kind=CONSISTENT)
    q = 1e-4 * np.random.default_rng(1).standard_normal(whole.size)
    assert np.array_equal(loose.force(q), whole.force(q))
    assert np.array_equal(loose.mass(), whole.mass())
    assert not np.allclose(loose.mass(), saddle_shell.with_free().mass())
