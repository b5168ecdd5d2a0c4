"""One verdict by every study: modes, a map around a state, an onset across it and a sweep give one outcome, or say
that they do not decide.
"""

from __future__ import annotations

import numpy as np
import pytest

from dbvfiv.observer import Observer
from dbvfiv.studies.modes.run import ModesOptions, run_modes
from dbvfiv.studies.session import Session
from tests.verification.doors import Asked, ask_all, random_cases, rates_in_time

#: Share of states that some study may leave undecided.
OPEN = 0.1
#: Elements around and along on which many states are asked in short time; where a valve is stable depends on the mesh,
#: the agreement of the studies does not.
COARSE = (4, 6)


def judge(asked: list[Asked]) -> None:
    """Everything that is asked of a sample of random states."""
    failed = [a for a in asked if a.failure]
    decided = [a for a in asked if not a.failure]
    print(f"\n{len(asked)} states, {len(failed)} without a steady state, {sum(a.left_open for a in decided)} left open")
    assert len(failed) <= 0.05 * len(asked), "\n".join(map(str, failed))
    assert all(a.agree for a in decided), "\n".join(str(a) for a in decided if not a.agree)
    assert sum(a.left_open for a in decided) <= OPEN * len(decided), [str(a) for a in decided if a.left_open]
    for a in decided:
        verdicts = [v for v in a.verdicts.values() if v.certain and np.isfinite(v.growth_rate)]
        rates = np.array([v.growth_rate for v in verdicts])
        size = 2 * np.pi * np.array([v.frequency for v in verdicts])
        assert np.ptp(rates) <= 1e-4 * max(1.0, float(np.hypot(rates, size).max())) if rates.size else True, str(a)
    assert not any(v.outcome == "not valid" for a in decided if not is_published(a) for v in a.verdicts.values())


def is_published(asked: Asked) -> bool:
    """Whether the rubbers have the thesis's constants, which are unstable in such states."""
    return asked.case.materials.constants == "published"


def test_every_study_gives_one_outcome():
    valves = "cases/dbv18.toml", "cases/dbv6.toml", "cases/dbv12-in-line.toml", "cases/dbv12.toml"
    judge(list(ask_all(random_cases(100, seed=5, valves=valves, each=25, mesh=COARSE))))


@pytest.mark.slow
def test_every_study_gives_one_outcome_on_many_valves():
    judge(list(ask_all(random_cases(100, seed=6))) + list(ask_all(random_cases(900, seed=7, mesh=COARSE))))


def check_kicks(number: int, seed: int) -> None:
    """The valve in time rings after a kick at the rate of the verdict."""
    for _, case in random_cases(number, seed, each=2, mesh=COARSE):
        session = Session(case)
        state = session.equilibrium(Observer())
        verdict = run_modes(session.model, state, options=ModesOptions.of(case)).verdict
        value, rung = rates_in_time(case, verdict.frequency)
        print(f"{verdict.outcome}: {verdict.growth_rate:.4f} 1/s, {verdict.frequency:.4f} Hz, in time {rung:.5f}")
        assert value.real == pytest.approx(verdict.growth_rate, rel=1e-6)
        # stops whose contact parts within the kick leave half a per cent at the smallest openings
        assert abs(rung - value) < 0.01 * abs(value)
        assert verdict.outcome == ("flutters" if rung.real > 0 else "stable")


def test_kicks_in_time_ring_at_the_rates_of_the_verdicts():
    check_kicks(6, seed=3)


@pytest.mark.slow
def test_forty_kicks_in_time_ring_at_the_rates_of_the_verdicts():
    check_kicks(40, seed=3)
