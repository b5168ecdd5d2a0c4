"""A wall whose rubber has lost stability, on the default mesh: what runs away is listed, counted and certified."""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.model import Conditions, ValveModel, linearise, select_search
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.studies.case import thesis_case
from eigen import SearchOptions, TransferBasis, certified_spectrum
from eigen.negative_stiffness import negative_motions


@pytest.mark.slow
def test_the_12_inch_valve_at_36_kpa_with_loss_factors():
    case = thesis_case({"damping.model": "loss factor", "drive.pressure": 36e3})
    model = ValveModel(case)
    linear = linearise(model, LoadPath(model).go_to(36e3).q, 36e3)
    conditions, basis, space = Conditions.of(case), None, None
    for storage, unstable in ((1.0, 2), (0.0, 4)):
        pencil = linear.pencil(conditions, storage=storage)
        basis = basis or TransferBasis(pencil)
        space = negative_motions(pencil) if space is None else space
        # the motion of single elements in the bend of the lip, at the places where it is softest
        weight = np.sort((space**2).sum(axis=1))[::-1]
        assert 1 <= space.shape[1] <= 6 and weight[:20].sum() > 0.9 * weight.sum()
        lowest = basis.structural_frequencies
        search = select_search(SearchOptions(), conditions, lambda n: lowest[:n], 10)
        found = certified_spectrum(pencil, 10, search.options, basis=basis)
        assert found.agrees and found.unstable_count == unstable, found.statement
        real = found.spectrum.eigenvalues[:2]
        np.testing.assert_allclose(real, [11765.5, 5711.1], rtol=1e-3)
        assert found.spectrum.residual.max() < 1e-8 and found.stable is False
        assert any("without oscillating" in note for note in found.spectrum.notes)
