"""Events of the user's own along a branch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from continuation.locate import special_at


@dataclass(frozen=True)
class Event:
    """Something of the user's own to watch for.

    Attributes
    ----------
    name : str
        Becomes the kind of the special point.
    function : callable
        ``function(u, mu)`` -> float; its sign changes are located.
    stop : bool
        End the branch there.
    """

    name: str
    function: Callable
    stop: bool = False


class EventMonitor:
    """Locates sign changes of an `Event`."""

    def __init__(self, event: Event):
        self.event = event

    def value(self, tracer, here):
        return float(self.event.function(tracer.problem.u(here.z), tracer.problem.mu(here.z)))

    def measure(self, tracer, here):
        here.tests[self.event.name] = self.value(tracer, here)

    def between(self, tracer, before, after, index, found):
        f0, f1 = before.tests[self.event.name], after.tests[self.event.name]
        # A value that is not finite is no crossing, and a zero was told when it was reached.
        if not (f0 * f1 < 0 or (f1 == 0 and f0 != 0)):
            return []
        values = {"stop": float(self.event.stop)} if self.event.stop else {}
        if f1 == 0:
            return [special_at(tracer, self.event.name, after, index, True, "", values)]
        here = tracer.root(before, after, lambda point: self.value(tracer, point))
        located = here is not None
        reason = "" if located else "the curve was lost in the bracket"
        return [special_at(tracer, self.event.name, here or after, index, located, reason, values)]
