"""Stability along a branch from a spectrum: counts, tracked modes, Hopf points.

Modes of neighbouring points are paired by eigenvalue and shape.  A pair that crosses the imaginary axis is a Hopf
point, located as a zero of the augmented system ``F = 0, det(F_u - i omega B) = 0``.
"""

from __future__ import annotations

import numpy as np

from continuation.branch import CurvePoint
from continuation.branch_points import BranchPointMonitor
from continuation.conditions import HopfCondition, null_vectors
from continuation.event_location import SLACK, locate_zero, solve_augmented, special_at
from continuation.normal_form import hopf_normal_form
from continuation.options import ContinuationError, DerivativeMissing, NotConverged
from continuation.spectra import count_unstable, match_modes, mode_distance
from continuation.tracer import SUBDIVISIONS, Monitor


def solve_hopf(tracer, guess, omega, vector):
    """Newton on ``F = 0, g = 0`` in state, parameter and frequency; see `solve_augmented`."""
    linear, q = guess.local.linear, np.asarray(vector, complex)
    borders = null_vectors(linear.shifted(1j * omega), linear.mass_matvec(q), q)
    frame = tracer.problem.frame(guess.tangent[:, None])
    result = solve_augmented(tracer, HopfCondition(*borders), np.append(guess.z, omega), frame)
    if not result.z[-1] > 0:
        raise NotConverged("Newton's method went to a frequency that is not positive")
    return result


def describe_hopf(tracer, result, tangent, index):
    """Special point with frequency, normal form and a check of the eigenpair."""
    problem, value = tracer.problem, result.local.condition
    omega = float(result.z[-1])
    linear, q = value.linear, value.v / np.linalg.norm(value.v)
    aq, bq = linear.matvec(q), linear.mass_matvec(q)
    defect = np.linalg.norm(aq - 1j * omega * bq) / max(np.linalg.norm(aq), 1e-300)
    values = {"omega": omega, "iterations": result.iterations, "eigen_residual": float(defect)}
    vectors = {"right": q, "left": value.w}
    try:
        form = hopf_normal_form(problem.system, result.local.u, result.local.mu, omega, q, problem.names[0])
        values.update(
            first_lyapunov_coefficient=form.l1,
            c1_real=form.c1.real,
            c1_imag=form.c1.imag,
            crossing_real=form.crossing.real,
            crossing_imag=form.crossing.imag,
            criticality=form.criticality,
            amplitude_coefficient=form.amplitude_coefficient(),
        )
        vectors["left"] = form.p
    except (DerivativeMissing, ContinuationError) as error:
        values["normal_form"] = str(error)
    return special_at(tracer, "hopf", CurvePoint(result.z[:-1], tangent), index, True, "", values, vectors)


class SpectrumMonitor(Monitor):
    """Count of unstable eigenvalues, and Hopf points by tracking each mode.

    A pair that enters the right half plane while another leaves it does not change the
    count, so the modes are matched one by one; and where matches and counts contradict each
    other, the interval is halved.

    Parameters
    ----------
    spectrum : callable, optional
        ``(u, mu, count, near) -> Spectrum``; the system's own by default.
    """

    kinds = ("hopf", "zero eigenvalue", "stability change")

    def __init__(self, spectrum=None):
        self._spectrum = spectrum
        self._past = None
        self._recent: list = []

    def modes(self, tracer, point):
        """Values and vectors at a point, computed once."""
        if "modes" not in point.data:
            options, problem = tracer.options, tracer.problem
            ask = self._spectrum or problem.system.spectrum
            result = ask(problem.u(point.z), problem.mu(point.z), options.eigenvalues, options.near)
            point.data["modes"] = result.upper_half()
            point.eigenvalues = point.data["modes"][0]
            point.unstable = count_unstable(point.eigenvalues) if np.all(result.converged) else -1
        return point.data["modes"]

    def measure(self, tracer, point):
        self.modes(tracer, point)

    def between(self, tracer, before, after, index, found):
        special: list = []
        self._between(tracer, before, after, index, 0, found, special)
        if self._past is not None:
            special += self._probe(tracer, self._past, before, after, index, [*found, *special])
        return special

    def accept(self, tracer, before, after, found):
        if self._past is not None:
            # Vectors of points left behind would only fill memory.
            self._past.data.pop("modes", None)
        self._past, self._recent = before, found

    def _probe(self, tracer, past, before, after, index, found):
        """Look for a crossing and its return within one step.

        A parabola through the growth rates at three points tells where a mode that has the
        same sign at all of them comes near the axis; there one more spectrum is computed.
        """
        modes = [self.modes(tracer, point) for point in (past, before, after)]
        onward = dict(match_modes(modes[1], modes[2]))
        s = np.array([-tracer.problem.norm(before.z - past.z), 0.0, tracer.problem.norm(after.z - before.z)])
        for i, j in match_modes(modes[0], modes[1]):
            if j not in onward:
                continue
            y = np.array([modes[0][0][i].real, modes[1][0][j].real, modes[2][0][onward[j]].real])
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
            seen = self._recent if vertex < 0 else found
            self._between(tracer, low, middle, at, 1, seen, new)
            self._between(tracer, middle, high, at, 1, seen, new)
            known = found + self._recent
            return [
                n
                for n in new
                if not any(n.kind == k.kind and np.allclose(n.z, k.z, rtol=1e-7, atol=1e-9) for k in known)
            ]
        return []

    def _between(self, tracer, before, after, index, depth, found, special):
        a, b = self.modes(tracer, before), self.modes(tracer, after)
        pairs = match_modes(a, b)
        crossing = [(i, j) for i, j in pairs if (a[0][i].real > 0) != (b[0][j].real > 0)]
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
        # Next to a fold a pair may have crossed back within the same step.
        hidden |= known and len(explained) == 1 and not self._agrees(tracer, explained[0], before, after)
        if (contradictory or hidden) and depth < SUBDIVISIONS:
            middle = tracer.at(before, after, 0.5)
            if middle is not None:
                self._between(tracer, before, middle, index, depth + 1, found, special)
                self._between(tracer, middle, after, index, depth + 1, found, special)
                return
        # A pair may become two real eigenvalues so near to a fold that no interval holds only one of both.
        change = after.unstable - before.unstable
        through_zero = known and not oscillating and explained and (change - len(explained)) % 2 == 0
        if contradictory and not (through_zero and abs(change) <= len(explained)):
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

    def _agrees(self, tracer, special, before, after):
        """True where the eigenvalues at a fold or branch point leave one more or none for the points beside it."""
        if "unstable" not in special.values:
            options, ask = tracer.options, self._spectrum or tracer.problem.system.spectrum
            values, _ = ask(special.u, special.mu, options.eigenvalues, options.near).upper_half()
            nearest = np.argmin(np.abs(values)) if values.size else []
            special.values["unstable"] = count_unstable(np.delete(values, nearest))
        return all(point.unstable - special.values["unstable"] in (0, 1) for point in (before, after))

    def _real(self, tracer, before, after, index, i, j, known):
        """A real eigenvalue through zero that nobody else explains: a branch point, most likely."""
        if not (tracer.options.branch_points and tracer.options.locate):
            reason = "a real eigenvalue crossed zero; branch points were not to be located"
            return [special_at(tracer, "zero eigenvalue", after, index, False, reason)]
        mode_at = self._follow(tracer, before, after, i, j)
        search = BranchPointMonitor()

        def attempt(guess, *_):
            vector = np.append(mode_at(guess)[1][:, 0].real, 0.0)
            return search.solve(tracer, guess, (vector, vector))

        result, guess, reason = locate_zero(tracer, before, after, lambda point: mode_at(point)[0][0].real, attempt)
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
        for point, k in ((before, i), (after, j)):
            values, vectors = self.modes(tracer, point)
            ends.append((values[[k]], vectors[:, [k]]))
            point.data[key] = ends[-1]

        def mode_at(point):
            """The crossing mode at a point of the bracket: the one most like both ends."""
            if key not in point.data:
                values, vectors = self.modes(tracer, point)
                unlike = sum(mode_distance(end, (values, vectors))[0] for end in ends)
                best = int(np.argmin(unlike))
                point.data[key] = (values[[best]], vectors[:, [best]])
            return point.data[key]

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
        mode_at = self._follow(tracer, before, after, i, j)

        def attempt(guess, low, high):
            x, y = mode_at(low), mode_at(high)
            ra, rb = x[0][0].real, y[0][0].real
            share = ra / (ra - rb) if ra != rb else 0.5
            omega = (1 - share) * x[0][0].imag + share * y[0][0].imag
            vector = (x if share < 0.5 else y)[1][:, 0]
            result = solve_hopf(tracer, guess, omega, vector)
            found_omega = float(result.z[-1])
            room = max(abs(x[0][0].imag - y[0][0].imag), 0.05 * abs(omega))
            if abs(found_omega - omega) > room:
                raise NotConverged("Newton's method went to another frequency")
            for other in special:
                if (
                    other.kind == "hopf"
                    and other.located
                    and np.allclose(np.append(other.z, other.values["omega"]), result.z, rtol=1e-9, atol=1e-12)
                ):
                    raise NotConverged("Newton's method found the same point again")
            return result

        result, guess, reason = locate_zero(tracer, before, after, lambda point: mode_at(point)[0][0].real, attempt)
        if result is None:
            return special_at(tracer, "hopf", guess, index, False, reason, {"omega": float(mode_at(before)[0][0].imag)})
        return describe_hopf(tracer, result, guess.tangent, index)


def _sign(x) -> int:
    return 1 if x > 0 else -1


class CountMonitor(SpectrumMonitor):
    """Count of unstable eigenvalues along a fold or Hopf curve, without the critical ones.

    The count tells whether the bifurcation is the first loss of stability: 0 on the
    boundary of the stable region.
    """

    kinds = ()

    def measure(self, tracer, point):
        values, _ = self.modes(tracer, point)
        extra = tracer.problem.extra(point.z)
        critical = 1j * abs(float(extra[0])) if extra.size else 0.0
        if point.unstable < 0 or values.size == 0:
            return
        nearest = int(np.argmin(np.abs(values - critical)))
        # The critical mode may lie outside of what the spectrum was asked for.
        found = abs(values[nearest] - critical) <= 1e-4 * max(1.0, abs(critical))
        rest = np.delete(values, nearest) if found else values
        point.unstable = count_unstable(rest)

    def between(self, tracer, before, after, index, found):
        return []

    def accept(self, tracer, before, after, found):
        before.data.pop("modes", None)
