"""Stability along a branch from a spectrum: counts, tracked modes, Hopf points."""

from __future__ import annotations

import numpy as np

from continuation.branch_points import BranchPointMonitor
from continuation.hopf import describe_hopf, solve_hopf
from continuation.locate import SLACK, safeguarded, special_at
from continuation.modes import count_unstable, match_modes, mode_distance


class SpectrumMonitor:
    """Counts unstable eigenvalues and finds Hopf points by tracking each mode.

    A pair that enters the right half plane while another leaves it does not change the
    count, so the modes are matched one by one; and where matches and counts contradict each
    other, the interval is halved.

    Parameters
    ----------
    spectrum : callable, optional
        ``(u, mu, count, near) -> Spectrum``; the system's own by default.
    """

    def __init__(self, spectrum=None):
        self._spectrum = spectrum
        self._past = None
        self._recent: list = []

    def modes(self, tracer, here):
        """Values and vectors at a point, computed once."""
        if "modes" not in here.data:
            options, problem = tracer.options, tracer.problem
            ask = self._spectrum or problem.system.spectrum
            result = ask(problem.u(here.z), problem.mu(here.z), options.eigenvalues, options.near)
            here.data["modes"] = result.upper_half()
            here.eigenvalues = here.data["modes"][0]
            complete = bool(np.all(result.converged))
            here.unstable = -1
            if complete:
                here.unstable = count_unstable(here.eigenvalues, options.stability_tolerance)
        return here.data["modes"]

    def measure(self, tracer, here):
        self.modes(tracer, here)

    def between(self, tracer, before, after, index, found):
        special: list = []
        self._between(tracer, before, after, index, 0, found, special)
        if self._past is not None:
            special += self._probe(tracer, self._past, before, after, index, special)
            # Vectors of points left behind would only fill memory.
            self._past.data.pop("modes", None)
        self._past, self._recent = before, special
        return special

    def _probe(self, tracer, past, before, after, index, special):
        """Look for a crossing and its return within one step.

        A parabola through the growth rates at three points tells where a mode that has the
        same sign at all of them comes near the axis; there one more spectrum is computed.
        """
        limit = tracer.options.stability_tolerance
        modes = [self.modes(tracer, here) for here in (past, before, after)]
        onward = dict(match_modes(modes[1], modes[2]))
        s = np.array([-tracer.problem.norm(before.z - past.z), 0.0, tracer.problem.norm(after.z - before.z)])
        for i, j in match_modes(modes[0], modes[1]):
            if j not in onward:
                continue
            y = np.array([modes[0][0][i].real, modes[1][0][j].real, modes[2][0][onward[j]].real]) - limit
            if not (np.all(y > 0) or np.all(y < 0)):
                continue
            bend, slope, _ = np.polyfit(s, y, 2)
            # Towards the axis and back: the vertex of the parabola points to zero.
            if bend * y[1] <= 0:
                continue
            vertex = -slope / (2 * bend)
            peak = y[1] - bend * vertex**2
            if not s[0] < vertex < s[2] or peak * np.sign(y[1]) > 0.3 * np.abs(y).min():
                continue
            low, high, at = (past, before, index - 1) if vertex < 0 else (before, after, index)
            share = (vertex - (s[0] if vertex < 0 else 0.0)) / (-s[0] if vertex < 0 else s[2])
            middle = tracer.at(low, high, float(np.clip(share, 0.05, 0.95)))
            if middle is None:
                continue
            new: list = []
            self._between(tracer, low, middle, at, 1, [], new)
            self._between(tracer, middle, high, at, 1, [], new)
            known = special + self._recent
            return [
                n
                for n in new
                if not any(n.kind == k.kind and np.allclose(n.z, k.z, rtol=1e-7, atol=1e-9) for k in known)
            ]
        return []

    def _between(self, tracer, before, after, index, depth, found, special):
        a, b = self.modes(tracer, before), self.modes(tracer, after)
        limit = tracer.options.stability_tolerance
        pairs = match_modes(a, b)
        crossing = [(i, j) for i, j in pairs if (a[0][i].real > limit) != (b[0][j].real > limit)]
        oscillating = [(i, j) for i, j in crossing if a[0][i].imag > 0 and b[0][j].imag > 0]
        real = [(i, j) for i, j in crossing if a[0][i].imag == 0 and b[0][j].imag == 0]
        expected = sum(2 * _sign(b[0][j].real - a[0][i].real) for i, j in oscillating)
        expected += sum(_sign(b[0][j].real - a[0][i].real) for i, j in real)
        known = before.unstable >= 0 and after.unstable >= 0
        mixed = len(oscillating) + len(real) < len(crossing)
        contradictory = mixed or (known and expected != after.unstable - before.unstable)
        # Two real eigenvalues that cross together may have been a pair in between.
        explained = [
            s
            for s in found
            if s.kind in ("fold", "branch point") and -SLACK <= tracer.fraction(before, after, s.z)[0] <= 1 + SLACK
        ]
        hidden = len(real) >= 2 and len(real) > len(explained)
        if (contradictory or hidden) and depth < tracer.options.max_subdivisions:
            middle = tracer.at(before, after, 0.5)
            if middle is not None:
                self._between(tracer, before, middle, index, depth + 1, found, special)
                self._between(tracer, middle, after, index, depth + 1, found, special)
                return
        if contradictory:
            reason = (
                f"the count of unstable eigenvalues went from {before.unstable} to "
                f"{after.unstable}, the modes that could be followed explain {expected:+d}"
            )
            special.append(special_at(tracer, "stability change", after, index, False, reason))
        for i, j in oscillating:
            special.append(self._locate(tracer, before, after, index, i, j, special))
        if len(real) > len(explained):
            for i, j in real:
                special += self._real(tracer, before, after, index, i, j, explained + special)

    def _real(self, tracer, before, after, index, i, j, known):
        """A real eigenvalue through zero that nobody else explains: a branch point, most likely."""
        if not (tracer.options.branch_points and tracer.options.locate):
            reason = "a real eigenvalue crossed zero; branch points were not to be located"
            return [special_at(tracer, "zero eigenvalue", after, index, False, reason)]
        limit = tracer.options.stability_tolerance
        mode_at = self._follow(tracer, before, after, i, j)
        search = BranchPointMonitor()

        def attempt(guess, *_):
            vector = np.append(mode_at(guess)[1][:, 0].real, 0.0)
            point = search.solve(tracer, guess, (vector, vector))
            if isinstance(point, str):
                return point
            return point.z[:-1], point

        result, guess, reason = safeguarded(
            tracer, before, after, lambda here: mode_at(here)[0][0].real - limit, attempt
        )
        if result is None:
            reason = f"a real eigenvalue crossed zero; {reason}"
            return [special_at(tracer, "zero eigenvalue", guess, index, False, reason)]
        if any(other.located and np.allclose(other.z, result.z[:-1], rtol=1e-7, atol=1e-9) for other in known):
            return []
        return [search.describe(tracer, result, guess, index)]

    def _follow(self, tracer, before, after, i, j):
        """A function that gives one crossing mode at any point of the bracket."""
        key = ("followed mode", before.z.tobytes(), i)
        ends = []
        for here, k in ((before, i), (after, j)):
            values, vectors = self.modes(tracer, here)
            ends.append((values[[k]], vectors[:, [k]]))
            here.data[key] = ends[-1]

        def mode_at(here):
            """The crossing mode at a point of the bracket: the one most like both ends."""
            if key not in here.data:
                values, vectors = self.modes(tracer, here)
                unlike = sum(mode_distance(end, (values, vectors))[0] for end in ends)
                best = int(np.argmin(unlike))
                here.data[key] = (values[[best]], vectors[:, [best]])
            return here.data[key]

        return mode_at

    def _locate(self, tracer, before, after, index, i, j, special):
        if not tracer.options.locate:
            return special_at(
                tracer,
                "hopf",
                after,
                index,
                False,
                "location was not asked for",
                {"omega": float(self.modes(tracer, after)[0][j].imag)},
            )
        limit = tracer.options.stability_tolerance
        mode_at = self._follow(tracer, before, after, i, j)

        def attempt(guess, low, high):
            x, y = mode_at(low), mode_at(high)
            ra, rb = x[0][0].real - limit, y[0][0].real - limit
            share = ra / (ra - rb) if ra != rb else 0.5
            omega = (1 - share) * x[0][0].imag + share * y[0][0].imag
            vector = (x if share < 0.5 else y)[1][:, 0]
            result = solve_hopf(tracer, guess, omega, vector)
            if isinstance(result, str):
                return result
            found_omega = float(result.z[-1])
            room = max(abs(x[0][0].imag - y[0][0].imag), 0.05 * abs(omega))
            if abs(found_omega - omega) > room:
                return "Newton's method went to another frequency"
            for other in special:
                if (
                    other.kind == "hopf"
                    and other.located
                    and np.allclose(np.append(other.z, other.values["omega"]), result.z, rtol=1e-9, atol=1e-12)
                ):
                    return "Newton's method found the same point again"
            return result.z[:-1], result

        result, guess, reason = safeguarded(
            tracer, before, after, lambda here: mode_at(here)[0][0].real - limit, attempt
        )
        if result is None:
            return special_at(tracer, "hopf", guess, index, False, reason, {"omega": float(mode_at(before)[0][0].imag)})
        return describe_hopf(tracer, result, guess.tangent, index)


def _sign(x) -> int:
    return 1 if x > 0 else -1


class CountMonitor(SpectrumMonitor):
    """Counts unstable eigenvalues along a fold or Hopf curve, without the critical ones.

    The count tells whether the bifurcation is the first loss of stability: 0 on the
    boundary of the stable region.
    """

    def measure(self, tracer, here):
        values, _ = self.modes(tracer, here)
        extra = tracer.problem.extra(here.z)
        critical = 1j * abs(float(extra[0])) if extra.size else 0.0
        if here.unstable < 0 or values.size == 0:
            return
        nearest = int(np.argmin(np.abs(values - critical)))
        # The critical mode may lie outside of what the spectrum was asked for.
        found = abs(values[nearest] - critical) <= 1e-4 * max(1.0, abs(critical))
        rest = np.delete(values, nearest) if found else values
        here.unstable = count_unstable(rest, tracer.options.stability_tolerance)

    def between(self, tracer, before, after, index, found):
        before.data.pop("modes", None)
        return []
