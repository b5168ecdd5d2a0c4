"""Loss of the widening jet against the published factors of the 12-inch valve in its 12-inch tunnel (Th. 7.2)."""

import numpy as np
import pytest

from dbvfiv.flow.terms.tail import Tail
from dbvfiv.model import ValveModel
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.studies.case import thesis_case

#: K of Eq. 7.2 beside Fig. 7-9, and the flows of Th. 4.3.3.
PUBLISHED = {18e3: (0.86, 47.88), 29e3: (0.83, 75.52), 36e3: (0.79, 90.82)}
TUNNEL = 0.3048
#: Ours on 28 x 48, by Borda and Carnot at the computed passage of the lips.
OURS = {18e3: 0.820, 29e3: 0.776, 36e3: 0.757}


def loss(lips: float, diameter: float = TUNNEL) -> float:
    """Borda and Carnot's K at a passage of the lips, m2."""
    return (1.0 - lips / (0.25 * np.pi * diameter**2)) ** 2


@pytest.mark.parametrize("size", [(14, 24), pytest.param((28, 48), marks=pytest.mark.slow)])
def test_published_factors_beside_ours(size):
    """The thesis took its pressures against that at the exit, so its states are those of a free discharge here. Its
    factors lie 4 to 7 % above ours and above what its own flows give, and say so of a K that depends on experiment.
    """
    model = ValveModel(thesis_case({"mesh.around": size[0], "mesh.along": size[1]}))
    path, inlet = LoadPath(model), 4 * float(model.mesh.rest_area[-1] - model.mesh.wall_deduction[-1])
    print("\n  kPa  published  ours  of the published flow  recovered kPa: published, ours")
    for pressure, (published, flow) in PUBLISHED.items():
        state = path.go_to(pressure)
        ours = loss(state.outlet_area)
        at_flange = flow / 1000.0 / inlet
        theirs = loss(flow / 1000.0 / np.sqrt(2 * pressure / 1000.0 + at_flange**2))
        ratio = state.outlet_area / (0.25 * np.pi * TUNNEL**2)
        head = 0.5 * 1000.0 * state.outlet_velocity**2
        gained = [(1 - ratio**2 - k) * head / 1e3 for k in (published, ours)]
        print(f"{pressure / 1e3:5g} {published:9.2f} {ours:7.3f} {theirs:13.3f} {gained[0]:20.2f} {gained[1]:8.2f}")
        assert ours == pytest.approx(OURS[pressure], abs=0.003)
        assert 0.03 < published / ours - 1 < 0.08 and 0.06 < published / theirs - 1 < 0.12
        jet = state.outlet_velocity
        assert float(Tail(TUNNEL).gained(state.outlet_area / 4, jet, ratio * jet)) == pytest.approx(gained[1], rel=1e-6)


def test_a_loss_that_is_given_recovers_as_the_equation_has_it():
    model = ValveModel(
        thesis_case(
            {"mesh.around": 8, "mesh.along": 14, "downstream.pipe_diameter": TUNNEL, "downstream.expansion_loss": 0.86}
        )
    )
    state = LoadPath(model).go_to(18e3)
    ratio = state.outlet_area / (0.25 * np.pi * TUNNEL**2)
    expected = (1 - ratio**2 - 0.86) * 0.5 * 1000.0 * state.outlet_velocity**2
    assert state.recovered_pressure == pytest.approx(expected, rel=1e-5)
