"""Soft or hard with water outside: what the added mass adds by its change with the shape is in the normal form."""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.model.outside_forms import OutsideForms
from dbvfiv.studies.case import thesis_case

WATER = {
    "mesh.around": 8,
    "mesh.along": 14,
    "outside.fluid": "same",
    "drive.pressure": 10e3,
    "damping.alpha": 0.0,
    "onset.coarse_mesh": 0,
}


@pytest.mark.slow
def test_an_onset_with_water_outside_is_soft_or_hard(monkeypatch):
    """Here the change of the added mass turns a hard onset into a soft one, so it cannot be left out."""
    (found,) = dbvfiv.load(thesis_case(), WATER).onset("beta=1.5e-3:4e-3:3:log").points
    assert found["criticality"] == "super" and not found["note"] and found["crossing_speed"] < 0
    nothing = lambda forms, *directions: np.zeros_like(forms.q)  # noqa: E731
    monkeypatch.setattr(OutsideForms, "second", nothing)
    monkeypatch.setattr(OutsideForms, "third", nothing)
    (left_out,) = dbvfiv.load(thesis_case(), WATER).onset("beta=1.5e-3:4e-3:3:log").points
    assert left_out["value"] == found["value"] and left_out["criticality"] == "sub"
