"""One verdict by every study: modes, a map around a state, an onset across it and a sweep give one outcome, or say
that they do not decide.
"""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.observer import Observer
from dbvfiv.studies.modes.search import run_modes
from dbvfiv.studies.session import Session
from tests.verification.doors import Asked, ask_all, random_cases
from tests.verification.test_transient_modes import rung_in_time

#: Elements around and along on which many states are asked in short time; where a valve is stable depends on the mesh,
#: the agreement of the studies does not.
COARSE = (4, 6)


def judge(asked: list[Asked], left_open: int, differing: int) -> None:
    """Check one outcome by all studies, and how many states may be left open or lead with different modes."""
    failed = [a for a in asked if a.failure]
    decided = [a for a in asked if not a.failure]
    print(f"\n{len(asked)} states, {len(failed)} without a steady state, {sum(a.left_open for a in decided)} left open")
    assert len(failed) <= 0.05 * len(asked), "\n".join(map(str, failed))
    assert all(a.agree for a in decided), "\n".join(str(a) for a in decided if not a.agree)
    assert sum(a.left_open for a in decided) <= left_open, [str(a) for a in decided if a.left_open]
    others = [a for a in decided if not lead_alike(a)]
    assert len(others) <= differing, "\n".join(map(str, others))
    assert not any(v.outcome == "not valid" for a in decided if not is_published(a) for v in a.verdicts.values())


def lead_alike(asked: Asked) -> bool:
    """True where the leading modes of all studies that are certain have one growth rate."""
    verdicts = [v for v in asked.verdicts.values() if v.certain and np.isfinite(v.growth_rate)]
    rates = np.array([v.growth_rate for v in verdicts])
    size = np.hypot(rates, 2 * np.pi * np.array([v.frequency for v in verdicts])).max(initial=1.0)
    return not verdicts or bool(np.ptp(rates) <= 1e-4 * size)


def is_published(asked: Asked) -> bool:
    """True where the rubbers have the thesis's constants, which are unstable in such states."""
    return asked.case.materials.constants == "published"


@pytest.mark.parametrize(
    ("group", "number"), [(3, 2), *(pytest.param(n, 5, marks=pytest.mark.slow) for n in range(20))]
)
def test_every_study_gives_one_outcome(group, number):
    """A hundred states, five of a valve, a line and a pressure in each group; two of one group are quick."""
    valves = "cases/dbv18.toml", "cases/dbv6.toml", "cases/dbv12-in-line.toml", "cases/dbv12.toml"
    asked = list(ask_all(random_cases(number, seed=100 + group, valves=(valves[group % 4],), each=5, mesh=COARSE)))
    judge(asked, left_open=2, differing=0)


@pytest.mark.slow
@pytest.mark.random
@pytest.mark.parametrize("group", range(10))
def test_every_study_gives_one_outcome_on_many_valves(group):
    """A thousand states, a hundred in each group."""
    fine, coarse = random_cases(10, seed=60 + group), random_cases(90, seed=70 + group, mesh=COARSE)
    judge([*ask_all(fine), *ask_all(coarse)], left_open=4, differing=3)


@pytest.mark.slow
def test_kicks_in_time_ring_at_the_rates_of_the_verdicts():
    for _, case in random_cases(40, seed=3, each=2, mesh=COARSE):
        session = Session(case)
        state = session.equilibrium(Observer())
        verdict = run_modes(session.model, state, keys=case.modes).verdict
        runs = []
        rung = rung_in_time(dbvfiv.load(case), verdict.frequency, examine=runs.append)[1]
        value = runs[-1].progress.eigenvalue
        print(f"{verdict.outcome}: {verdict.growth_rate:.4f} 1/s, {verdict.frequency:.4f} Hz, in time {rung:.5f}")
        assert value.real == pytest.approx(verdict.growth_rate, rel=1e-6)
        # stops whose contact parts within the kick leave half a per cent at the smallest openings
        assert abs(rung - value) < 0.01 * abs(value)
        assert verdict.outcome == ("flutters" if rung.real > 0 else "stable")
