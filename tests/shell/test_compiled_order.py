"""What branches hold has the same digits by both loops that give it, whichever was compiled first and where.

A resumed run takes it from one and goes on as the whole run, which took it from the other.
"""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from dbvfiv.shell.memory import advance_branches, hold_resultants

PROGRAM = f"""
import sys
import numpy as np
from {hold_resultants.__module__} import {advance_branches.__name__} as advance, {hold_resultants.__name__} as hold

rng = np.random.default_rng(1)
count, groups, times = 40, 2, 3
group, time = (x.ravel() for x in np.mgrid[:groups, :times])
branches, stretch, slow, slow_new = (rng.normal(size=(count, 4, n, 8)) for n in (len(group), times, groups, groups))
strain, strain_new = rng.normal(size=(2, count, 4, 8))
kept, gained = rng.random((2, 2, len(group)))
by_group, area, work = rng.random(groups), rng.random((count, 4)), np.zeros((2, groups))
out, stretch_out, ahead, held = (np.zeros_like(x) for x in (branches, stretch, strain, strain))
before = branches, stretch, slow, slow_new, strain, strain_new
for step in sys.argv[1:]:
    if step == "advance":
        advance(*before, group, time, kept, gained, by_group, 0.5, area, out, stretch_out, ahead, work)
    else:
        hold(out, slow_new, kept[0], by_group, held)
print(np.count_nonzero(ahead), np.count_nonzero(ahead != held))
"""


@pytest.mark.slow
def test_what_branches_hold_has_the_same_digits_in_either_order(tmp_path):
    def counts(cache: str, *order: str) -> list[int]:
        environment = os.environ | {"DBVFIV_CACHE": str(tmp_path / cache), "NUMBA_CACHE_DIR": str(tmp_path / cache)}
        command = [sys.executable, "-c", PROGRAM, *order]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return [int(word) for word in done.stdout.split()]

    counts("one", "hold")  # another process has compiled the one loop before
    assert counts("one", "advance", "hold") == [40 * 4 * 8, 0]
    assert counts("other", "advance", "hold") == [40 * 4 * 8, 0]
