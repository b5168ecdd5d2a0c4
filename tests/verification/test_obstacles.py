"""Linear obstacle course: what each problem reaches on 16 x 16 elements, regular and skewed.

A row of trapezoids under bending in its plane is out of reach for elements of two unknowns a node, whoever wrote them:
none that passes the patch test bends freely as a trapezoid (MacNeal 1987, Int. J. Num. Meth. Eng. 24, 1793-1799). A
beam of leaning elements between upright ends has a trapezoid at either end, which is what holds it; a parallelogram
bends freely. The cylinder pinched by point forces wants its 16 x 16 elements where the dent is: spaced evenly they do
not resolve it.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.shell.structures import observed_order
from tests.verification import obstacles

ELEMENT = "MITC4+EAS"
COURSE = {
    "Cook's panel": obstacles.cook,
    "hemisphere": obstacles.hemisphere,
    "skewed hemisphere": lambda e, n: obstacles.hemisphere(e, n, obstacles.skewed(n)),
    "roof": obstacles.roof,
    "skewed roof": lambda e, n: obstacles.roof(e, n, obstacles.skewed(n)),
    "twisted beam in its plane": lambda e, n: obstacles.twisted_beam(e, 2 * n, max(n // 4, 1)),
    "twisted beam across": lambda e, n: obstacles.twisted_beam(e, 2 * n, max(n // 4, 1), load=2),
    "thin twisted beam in its plane": lambda e, n: obstacles.twisted_beam(e, 2 * n, n // 4, 0.0032),
    "thin twisted beam across": lambda e, n: obstacles.twisted_beam(e, 2 * n, n // 4, 0.0032, 2),
}

#: Shares on 16 x 16 elements, of the plain element too, as docs/evidence/shell.md prints them.
PRINTED = {"Cook's panel": (0.997, 0.978), "skewed hemisphere": (0.991, 0.948), "roof": (0.998, 0.989)}


@pytest.mark.parametrize("name", COURSE)
def test_obstacle(name):
    """Within 2 % of the published value at 16 (Cook, roof, hemisphere n x n; beams 2 n x n/4)."""
    found = tuple(COURSE[name](element, 16) for element in (ELEMENT, "MITC4"))
    print(f"\n{name}: {found[0]:.4f}, MITC4 {found[1]:.4f}")
    assert found[0] == pytest.approx(1.0, abs=0.02)
    assert found == pytest.approx(PRINTED.get(name, found), abs=6e-4)


@pytest.mark.parametrize(
    "shape, printed",
    [("rectangles", (0.993, 0.093)), ("parallelograms", (0.632, 0.034)), ("trapezoids", (0.052, 0.027))],
)
def test_beam_of_six_elements(shape, printed):
    """MacNeal's slender cantilever loaded in its plane, with the element and the plain one."""
    coarse, fine = (obstacles.straight_beam(ELEMENT, shape, 6 * k, k) for k in (1, 2))
    plain = obstacles.straight_beam("MITC4", shape)
    print(f"\n{shape}: 6 x 1 {coarse:.4f}, 12 x 2 {fine:.4f}, MITC4 6 x 1 {plain:.4f}")
    assert (coarse, plain) == pytest.approx(printed, abs=6e-4)
    assert fine > coarse - 1e-3
    assert obstacles.straight_beam(ELEMENT, shape, load=2) == pytest.approx(1.0, abs=0.04)  # across


@pytest.mark.parametrize("lean", [0.0, 1.0, -1.0, 2.0])
def test_parallelogram_bends_freely(lean):
    """An element five times as long as wide holds the energy of beam theory however it leans; the plain one 11 to 147
    times as much.
    """
    assert obstacles.bending_energy(ELEMENT, (lean, lean)) == pytest.approx(1.0, abs=1e-9)
    assert obstacles.bending_energy("MITC4", (lean, lean)) > 10


@pytest.mark.parametrize("skew", [False, True])
def test_pinched_cylinder(skew):
    """The dent under the point force is what is still missing at 16 x 16; its error falls as that of the best four-node
    elements do.
    """
    meshes = (4, 8, 16, 32)
    distort = obstacles.skewed if skew else lambda n: obstacles.regular
    values = np.array([obstacles.pinched_cylinder(ELEMENT, n, distort(n)) for n in meshes])
    print(f"\npinched cylinder, skewed {skew}: {np.round(values, 4)}, orders {np.round(observed_order(1 - values), 2)}")
    assert np.all(np.diff(values) > 0)
    assert values[2] > 0.9 and values[3] == pytest.approx(1.0, abs=0.02)
    if not skew:
        plain = obstacles.pinched_cylinder("MITC4", 16, obstacles.regular)
        assert (values[2], plain) == pytest.approx((0.933, 0.930), abs=6e-4)


def test_pinched_cylinder_graded_to_its_dent():
    """Within 2 % on 16 x 16, spaced with the square of the distance from the force; 0.933 evenly spaced."""
    values = [obstacles.pinched_cylinder(ELEMENT, n, lambda u, v: (u * u, v * v)) for n in (8, 16)]
    print(f"\npinched cylinder, graded: {np.round(values, 4)}")
    assert values[1] == pytest.approx(1.0, abs=0.02) and values[0] > 0.85


def test_cantilever_bent_in_its_plane():
    """Rectangles, one to eight across: within 1 % of beam theory on each, where the plain element needs eight."""
    values, plain = (
        np.array([obstacles.straight_beam(e, "rectangles", 6 * k, k) for k in (1, 2, 4, 8)]) for e in (ELEMENT, "MITC4")
    )
    print(f"\nin-plane cantilever {np.round(values, 4)}, MITC4 {np.round(plain, 4)}")
    assert values == pytest.approx(1.0, abs=0.01)
    assert np.all(np.abs(values - 1) < np.abs(plain - 1))
