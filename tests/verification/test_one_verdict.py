"""One verdict by every study: modes, a map around a state, an onset across it and a sweep give one outcome, or say
that they do not decide.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.verification.doors import Asked, ask_all, random_cases

#: Share of states that some study may leave undecided.
OPEN = 0.1


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
    judge(list(ask_all(random_cases(6, seed=5, valves=("cases/dbv6.toml",), each=6))))


@pytest.mark.slow
def test_every_study_gives_one_outcome_on_many_valves():
    judge(list(ask_all(random_cases(1000, seed=6))))
