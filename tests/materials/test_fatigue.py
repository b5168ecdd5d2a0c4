"""Cracking energy density, growth of cracks and cycles against closed forms and published examples."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.materials.energy import MOONEY_RIVLIN
from dbvfiv.materials.fatigue import (
    RUBBERS,
    SHAPE,
    UNIT,
    CrackGrowth,
    count_cycles,
    cracking_energy,
    plane_normals,
    shipped_growth,
)
from dbvfiv.materials.laws import MooneyRivlin
from dbvfiv.materials.shipped import rubber
from dbvfiv.shell.recovery import stress_at

SOFT = MooneyRivlin.neo_hookean(1e6, 1300.0)
FLAW = (20e-6, 50e-6)


def shares(law, strain):
    """Cracking energy density on the planes over the strain energy."""

    def stress(e):
        return stress_at(MOONEY_RIVLIN, law.parameters[None], e[:, None])[:, 0]

    return cracking_energy(np.array([strain]), stress, plane_normals())[0] / float(law.energy(np.array(strain)))


@pytest.mark.parametrize("law", [SOFT, rubber("CR", 0.2), rubber("SBR", 0.2)], ids=["neo-Hookean", "CR", "SBR"])
@pytest.mark.parametrize("stretch", [1.01, 1.3, 1.6])
def test_energy_of_tension_and_of_equibiaxial_tension(law, stretch):
    """All of the strain energy on the plane across a tension, half of it on every plane across an equibiaxial one."""
    across = 0.5 * (1 / stretch - 1)
    found = shares(law, [0.5 * (stretch**2 - 1), across, 0.0, 0.0, 0.0])
    assert found.argmax() == 0 and np.isclose(found[0], 1.0, rtol=1e-4)
    upright = shares(law, [0.5 * (stretch**2 - 1), 0.5 * (stretch**2 - 1), 0.0, 0.0, 0.0])[:18]
    assert np.allclose(upright, 0.5, rtol=1e-4)


def test_energy_of_small_shear_is_half_on_planes_that_open_or_slide():
    """Every upright plane has half the energy; of those pressed shut only the share cos^2 2a that slides counts."""
    found = shares(SOFT, [0.0, 0.0, 1e-4, 0.0, 0.0])[:18]
    angle = 2 * np.radians(np.arange(0.0, 180.0, 10.0))
    closed = np.sin(angle) < -1e-9
    assert np.allclose(found, 0.5 * np.where(closed, np.cos(angle) ** 2, 1.0), atol=1e-3)


def test_planes_pressed_shut_slide_only():
    """In compression by a small strain: none across it, 3/2 sin^2 a cos^2 a of the energy at an angle a."""
    found = shares(SOFT, [-1e-4, 0.5e-4, 0.0, 0.0, 0.0])[:18]
    angle = np.radians(np.arange(0.0, 180.0, 10.0))
    assert np.allclose(found, 1.5 * (np.sin(angle) * np.cos(angle)) ** 2, atol=1e-3)


def test_life_in_closed_form():
    """Square law of natural rubber (Gent, Lindley and Thomas 1964): N = 1/(B (2 pi W)^2 c_0); fourth power of SBR (Lake
    and Lindley 1964): N = 1/(3 B (2 pi W)^4 c_0^3), where the crack is much longer than the flaw.
    """
    energy, flaw = 1e6, 25e-6
    for exponent in (2.0, 4.0):
        grown = CrackGrowth(1e-7, exponent, 1e-3, 0.0, flaw)
        law = 1e-7 * (SHAPE * energy / UNIT) ** exponent
        exact = (flaw ** (1 - exponent) - 2e-3 ** (1 - exponent)) / ((exponent - 1) * law)
        assert np.isclose(grown.blocks(np.array([[energy, 0.0]]), 2e-3), exact, rtol=1e-10)
        assert np.isclose(
            grown.blocks(np.array([[energy, 0.0]]), 1.0), flaw ** (1 - exponent) / (exponent - 1) / law, rtol=1e-4
        )
    # two cycles a block, one of which begins to count when the crack has grown: pieces in closed form
    grown = CrackGrowth(1e-7, 2.0, 50.0, 0.0, flaw)
    weak = 50.0 / (SHAPE * 4 * flaw)
    first = (1 / flaw - 1 / (4 * flaw)) / (1e-7 * (SHAPE * energy / UNIT) ** 2)
    second = (1 / (4 * flaw) - 1 / 2e-3) / (1e-7 * (SHAPE / UNIT) ** 2 * (energy**2 + weak**2))
    assert np.isclose(grown.blocks(np.array([[energy, 0.0], [weak, 0.0]]), 2e-3), first + second, rtol=1e-3)


def test_fatigue_limit_of_natural_rubber():
    """Lake and Lindley (1965): gum natural rubber lasts from zero load up to strains of 70 to 100 %. With a threshold
    of 50 J/m2 and flaws of 25 um that follows from its modulus, 0.4 MPa in shear.
    """
    gum, stretch = MooneyRivlin.neo_hookean(0.4e6, 930.0), np.linspace(1.2, 2.5, 131)
    energy = np.array([float(gum.energy(np.array([0.5 * (s**2 - 1), 0.5 * (1 / s - 1), 0, 0, 0]))) for s in stretch])
    lasts = np.isinf(CrackGrowth(1e-7, 2.0, 50.0, 0.0, 25e-6).blocks(np.stack([energy, 0 * energy], -1)[:, None], 2e-3))
    assert lasts[0] and not lasts[-1] and 1.7 < stretch[lasts].max() < 2.0


def test_minimum_load():
    """Without crystallisation the range governs; with it F grows as exp(k R), which slows growth below T_c."""
    plain, crystals = (CrackGrowth(1e-7, 2.0, 50.0, k, 25e-6) for k in (0.0, 2.0))
    assert np.isclose(plain.speed(1000.0, 500.0), 1e-7 * 0.25)
    assert np.isclose(crystals.speed(1000.0, 200.0), 1e-7 * 0.1 ** (2 * (np.exp(0.4) - 1)))
    assert crystals.speed(1000.0, 0.0) == plain.speed(1000.0, 0.0) == 1e-7
    assert plain.speed(49.0, 0.0) == 0 == plain.speed(1000.0, 1000.0)


def test_cycles_are_those_of_the_standard():
    """ASTM E1049, figure of simplified rainflow counting for a repeating history: one range each of 9, 7, 4 and 3."""
    history = np.array([[-2.0, 1, -3, 5, -1, 3, -4, 4], [-2.0, 1, -3, 5, -1, 3, -4, 4]])
    history[1] = np.roll(history[1], 3)
    for cycles in count_cycles(np.repeat(history, 2, axis=1)):
        assert sorted(map(tuple, cycles)) == [(1.0, -2.0), (3.0, -1.0), (4.0, -3.0), (5.0, -4.0)]
    flat, wave = count_cycles(np.array([[2.0] * 6, [0.0, 1, 0, 1, 0, 1]]))
    assert not flat.any() and np.allclose(wave, [[1, 0], [1, 0], [1, 0]])


@pytest.mark.parametrize("name", RUBBERS)
def test_samples_have_the_stated_spread(name):
    """Tenth and nine-tenth quantiles are the pair; the same samples every time; all growth lies within a decade and a
    half of 1e-4 mm a cycle at 1 kJ/m2, the level of vulcanisates.
    """
    spread = shipped_growth(name) | {"precursor": FLAW}
    drawn, again = CrackGrowth.draw(spread), CrackGrowth.draw(spread)
    for key in ("rate", "exponent", "threshold", "precursor"):
        values = getattr(drawn, key)
        assert np.array_equal(values, getattr(again, key))
        assert np.allclose(np.quantile(values, [0.1, 0.9]), spread[key], rtol=0.06)
    assert abs(np.log10(CrackGrowth.middle(spread).speed(UNIT, 0.0) / 1e-7)) < 1.5
    assert (shipped_growth(name)["crystallisation"][1] > 0) == (name in ("NR", "CR"))
