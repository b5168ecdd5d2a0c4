"""Natural frequencies of square isotropic plates against converged Mindlin solutions (shear correction 5/6).

10 m by 10 m, E 200 GPa, nu 0.3, density 8000 kg/m3. Twisting moments fall to zero within about a third of the thickness
of a free edge, and a solution that does not resolve this layer comes out too high: Legendre-Ritz series of degree 16
give 1.6203 and 4.1863 Hz for the free plate where degrees 44 and 56 agree on 1.6184 and 4.1820. The values below are
those of degree 56 (free) and 54 (clamped); often quoted ones, next to them, lie up to 0.12 % higher.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

from dbvfiv.shell import Shell, ShellMesh
from dbvfiv.shell.mass import AVERAGED, CONSISTENT
from tests.shell.structures import grid, isotropic_section

# thickness, frequencies with the edge layer resolved, and as quoted
REFERENCE = {
    "free": (
        0.05,
        (1.61839, 2.35922, 2.92177, 4.18197, 4.18197, 7.35316),
        (1.6203, 2.3593, 2.9219, 4.1868, 4.1868, 7.3537),
    ),
    "one edge clamped": (
        0.05,
        (0.417880, 1.02270, 2.56174, 3.27195, 3.72128, 6.51030),
        (0.4179, 1.0236, 2.5622, 3.2735, 3.7244, 6.5179),
    ),
    "hard simply supported": (1.0, (45.911, 109.528, 109.528, 168.074), (45.911, 109.528, 109.528, 168.074)),
}


def frequencies(support: str, n: int, mass_kind: str) -> np.ndarray:
    """Lowest frequencies, Hz, on n by n elements; rigid-body modes left out, in-plane motion held."""
    h, exact, _ = REFERENCE[support]
    # finer towards the edges: twisting moments fall to zero within about a thickness of a free edge, and a regular mesh
    # misses that
    cosine = lambda t: 5.0 * (1 - np.cos(np.pi * t))  # noqa: E731
    patch = grid(n, n, lambda u, v: (cosine(u), cosine(v), 0 * u))
    free = np.ones((len(patch.nodes), 5), bool)
    free[:, :2] = False  # bending is uncoupled from membrane motion in a flat plate
    i = patch.index
    if support == "one edge clamped":
        free[i[0]] = False
    elif support == "hard simply supported":
        for nodes, tangential in ((i[0], 4), (i[-1], 4), (i[:, 0], 3), (i[:, -1], 3)):
            free[nodes, 2] = False
            free[nodes, tangential] = False
    mesh = ShellMesh.build(patch.nodes, patch.quads, h, material_axis=(1.0, 0, 0))
    shell = Shell(mesh, isotropic_section(200e9, 0.3, h, 8000.0), free, mass_kind=mass_kind)
    stiffness = shell.dofs.matrix(shell.force_and_tangent(np.zeros(shell.size))[1]).tocsc()
    mass = shell.dofs.matrix(shell.mass()).tocsc()
    count = len(exact) + (3 if support == "free" else 0)
    values = np.sort(eigsh(stiffness, count, mass, sigma=-1.0, return_eigenvectors=False))
    if support == "free":
        assert np.abs(values[:3]).max() < 1e-3  # two tilts and a heave
        values = values[3:]
    return np.sqrt(values) / (2 * np.pi)


@pytest.mark.parametrize("mass_kind", [AVERAGED, CONSISTENT])
@pytest.mark.parametrize("support", sorted(REFERENCE))
def test_plate_frequencies(support, mass_kind):
    """0.6 % on 48 x 48 elements; the error falls with the square of the element size; extrapolated within 0.02 %, and
    0.15 % of quoted values.
    """
    _, exact, quoted = REFERENCE[support]
    exact = np.array(exact)
    coarse, fine = (frequencies(support, n, mass_kind) for n in (24, 48))
    limit = fine + (fine - coarse) / 3
    print(f"\n{support}")
    for row in zip(coarse, fine, limit, exact, quoted):
        print("  24: {:.4f}  48: {:.4f}  extrapolated {:.4f}  exact {:.4f}  quoted {:.4f}".format(*row))
    assert fine == pytest.approx(exact, rel=6e-3)
    assert limit == pytest.approx(exact, rel=2e-4)
    assert limit == pytest.approx(quoted, rel=1.5e-3)
    # second order: the error falls by four, a little less where the corners of the clamped edge count
    falls = (coarse - exact) / (fine - exact)
    if mass_kind == CONSISTENT:
        assert falls == pytest.approx(4.0, abs=0.4)
    else:  # errors of mass and stiffness nearly cancel in two modes, which fall by 4.7 and 4.8 then
        assert (falls > 3.6).all() and np.median(falls) == pytest.approx(4.0, abs=0.1)
