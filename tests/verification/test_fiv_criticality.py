"""Super- or subcritical: the first Lyapunov coefficient of the coupled valve against time integration on both sides of
an onset.

On the centre manifold an amplitude r obeys r' = r (sigma + Re c1 r^2). From kicks of different size the rate r'/r is
read off runs of half a second and compared with that of the normal form, in which sigma comes from the crossing speed
and Re c1 from the third derivatives: where the rate vanishes is the cycle.
"""

import numpy as np
import pytest

from dbvfiv.model import ValveModel
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.onset.search import OnsetOptions, OnsetSearch, normal_form
from dbvfiv.studies.transient.run import Runner

#: Relative distance from the onset density.
ASIDE = 0.02

pytestmark = pytest.mark.slow


class Onset:
    """The onset over density of a coarse valve at 6 kPa, its normal form, and runs beside it."""

    def __init__(self):
        self.case = thesis_case(
            ["mesh.around=8", "mesh.along=16", "damping.alpha=0", "damping.beta=0.003", "drive.pressure=6 kPa"]
        )
        options = OnsetOptions("density", tuple(np.geomspace(1, 1000, 21)), True, normal_form=False, coarse_mesh=0)
        search = OnsetSearch(self.case, options)
        (crossing,) = search.scan.run(options.values)
        self.point = point = search.point(crossing)
        self.form = normal_form(
            self.case,
            search.walk,
            search.place(point.value),
            search.critical(search.place(point.value), 2j * np.pi * point.frequency),
            "density",
        )
        self.model = search.walk.built(search.place(point.value)).model
        self.steady = self.lip(search.walk.equilibrium(search.place(point.value)))
        shape = self.form.q[: self.model.size]
        change = ASIDE * point.value
        #: Amplitude of the lip on the predicted cycle, m.
        self.cycle = (
            2
            * abs(self.lip(shape.real) + 1j * self.lip(shape.imag))
            * np.sqrt(abs(self.form.crossing.real / self.form.c1.real) * change)
        )
        self.sigma = abs(self.form.crossing.real) * change

    def lip(self, q) -> float:
        return float(self.model.nodal(q)[self.model.mesh.rows[0, 0], 1])

    def rate(self, side: int, kick: float) -> tuple[float, float]:
        """Rate of the lip's amplitude (1/s) after a kick in units of the predicted cycle, and the mean amplitude in the
        same units.
        """
        changes = {
            "fluid.density": self.point.value * (1 + side * ASIDE),
            "transient.start": "kick",
            "transient.kick_opening": kick * self.cycle,
            "transient.duration": 0.5,
            "transient.step": 4e-4,
        }
        history = Runner(ValveModel(self.case.replace(changes))).start().history
        time, lip = np.array(history["time"]), np.array(history["lip_displacement"]) - self.steady
        period = 1.0 / self.point.frequency
        starts = np.arange(0.1, time[-1] - period, period)
        amplitude = np.array([0.5 * np.ptp(lip[(time >= a) & (time < a + period)]) for a in starts])
        return float(np.polyfit(starts, np.log(amplitude), 1)[0]), float(amplitude.mean() / self.cycle)


@pytest.fixture(scope="module")
def onset():
    return Onset()


def test_the_onset_is_supercritical(onset):
    assert onset.form.criticality == "super" and onset.form.side() == -1  # cycles where the density is smaller
    assert onset.cycle < 0.6 * onset.steady  # the cycle keeps clear of the closed lip


def test_motions_grow_within_the_cycle_and_decay_outside(onset):
    for kick, tolerance in ((0.4, 0.05), (0.8, 0.05), (1.4, 0.15)):
        rate, size = onset.rate(-1, kick)
        assert (rate > 0) == (kick < 1)
        assert rate / onset.sigma == pytest.approx(1 - size**2, abs=tolerance)


def test_all_motions_decay_on_the_stable_side(onset):
    for kick in (0.4, 1.0):
        rate, size = onset.rate(1, kick)
        assert rate / onset.sigma == pytest.approx(-1 - size**2, abs=0.1)
