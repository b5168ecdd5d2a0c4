"""Tasks of the tests of `dbvfiv.studies.workers`, in a module that workers can import."""

import os
import signal
import time

from dbvfiv.studies.workers import Work, Workers

TASKS = tuple(range(1, 13))


def start(power: int) -> float:
    return 1.0 / power


def root_of(context: float, task: int) -> float:
    time.sleep(0.05)  # so that tasks are in flight when a worker dies
    return task**context


def dies(context: float, task: int) -> float:
    if task == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return root_of(context, task)


def expected() -> dict[int, float]:
    return {task: root_of(start(3), task) for task in TASKS}


if __name__ == "__main__":
    with Workers(1, start, (3,), print) as team:
        print(sorted(team.share(TASKS, lambda task: Work(root_of, (task,)))))
