"""Response of steady states to the pressure at the inlet: T(i omega) x = f on a reduced operator that is checked on the
full one, mean squares under a pressure spectrum, correlation times; run, storage, figures.

The space holds the full response at some frequencies; the next of them is where the residual of the reduced one is
largest, until the full response there confirms what the reduced one gave. Loss factors are exact in frequency, as the
operator is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure
from scipy.integrate import trapezoid
from scipy.linalg import qr

from eigen.factor import SingularShiftError, Workspace
from eigen.family import DenseOperator
from eigen.operator import real_apply
from eigen.pairs import acceptable, all_pairs, newton

from ...case.parameters import PARAMETERS, PIPES, Mu
from ...drawing.style import ACCENT, COMPUTED, headline, new_figure, parameter_label, some_of
from ...errors import CaseError, SolveError
from ...fit.cards import outside_band
from ...flow.law import FlowMotion
from ...model.dynamics import LinearisedState, still_channel
from ...model.state import LipCentre
from ...model.symmetry import equilibria_of, only_class_of
from ...record.record import GrowingRecord, Record
from ...record.table import Column, TableSpec
from ...texts import digits
from ..case import Case
from ..result import RangeResult
from ..session import Session, Study
from ..stability.place import check_range, describe_fixed, fixed_conditions
from ..stability.walk import StabilityWalk

#: Quantities that answer, with their units over Pa: of the whole valve, the displacement of one lip.
OUTPUTS = {"lip_displacement": "m", "outlet_area": "m^2", "flow": "m^3/s", "flange_pressure": "Pa"}
#: Relative error of the reduced response at which its space is accepted, and full solutions at most.
ACCURACY, MOST = 1e-5, 40
#: Residual of eigenvalues on the full operator, and their distance, relative, within which two are one.
EXACT, SAME = 1e-8, 1e-6
#: Directions of the space weaker than these are left out.
WEAK = 1e-13
#: Half widths of a peak between which its square is integrated, and nodes on each piece.
WIDTHS, NODES = (-100.0, -30.0, -10.0, -3.0, -1.0, 0.0, 1.0, 3.0, 10.0, 30.0, 100.0), 12


@dataclass(frozen=True)
class Spread:
    """Random motion under a pressure spectrum."""

    rms: np.ndarray  #: (k,); of the outputs.
    #: (k,), s; twice the integral of the square of the correlation coefficient over all lags: of one mode, one over its
    #: decay rate.
    correlation_time: np.ndarray


def require_inertia(case: Case) -> None:
    """Refuse a valve without a fluid that has inertia. Raises CaseError."""
    if not (case.drive.kind == "flow" and case.fluid.unsteady):
        raise CaseError(
            "The response to the pressure at the inlet needs a fluid with inertia (fluid.unsteady = true).",
            key="fluid.unsteady",
        )


class Transfer:
    """Response of a steady state per pressure at its inlet, over frequency. Raises CaseError for a flow without
    inertia. Raises SolveError if the reduced operator does not become accurate.

    Parameters
    ----------
    frequencies : (k,) array, Hz
        Frequencies that it is made for, ascending and not negative.

    Attributes
    ----------
    error : float
        Largest relative difference from the full operator at frequencies that the space was not made for.
    checked : tuple of float, Hz
        Frequencies at which both were compared.
    """

    def __init__(self, linear: LinearisedState, mu: Mu, frequencies: np.ndarray):
        flow = linear.model.flow
        require_inertia(linear.model.case)
        if linear.seal is not None:
            raise SolveError("the faces of the bill touch and nothing flows, so there is no response of a flow.")
        self.linear, self.mu = linear, mu
        self.frequencies = np.asarray(frequencies, float)
        self.pencil, self._workspace = linear.pencil(mu), Workspace()
        self._drive(flow, mu)
        self._reduce()

    def _drive(self, flow, mu: Mu) -> None:
        """Derivatives of pressures and balances by the inlet pressure, and rows of the outputs."""
        linear, m = self.linear, self.pencil.m
        pipes = {name: mu[name] for name in PIPES if name in mu}
        given = flow.values({"inlet": linear.inlet, "density": mu.density, "storage": mu.get("storage"), **pipes})
        area, inner = jnp.asarray(linear.area), jnp.asarray(flow.steady_inner(linear.area, given))
        still = FlowMotion.still(area, inner)

        def driven(inlet):
            return flow.equations(still, given | {"inlet": inlet})

        pressure, balance = jax.jacfwd(driven)(jnp.asarray(linear.inlet, float))
        self.pressure = np.zeros(m)
        self.pressure[: len(area)], self.balance = pressure, np.asarray(balance)

        def leaving(area, rate, inner):
            return area[0] * flow.speeds_of(area, rate, inner, given)[0]

        copies = linear.model.mesh.part.copies
        rows = jax.jacrev(leaving, argnums=(0, 1, 2))(area, jnp.zeros_like(area), inner)
        self._by_area, self._by_rate = (copies * np.pad(np.asarray(row), (0, m - len(area))) for row in rows[:2])
        self._by_inner, self._copies, self._flange = copies * np.asarray(rows[2]), copies, len(area) - 1
        self._tail = self._behind(area, inner, given)
        lip = LipCentre(linear.model.mesh, linear.model.shell)
        self._lip = np.array([lip.displacement(row) for row in np.eye(self.pencil.n)])
        self.force = self.pencil.G @ self.pressure

    def _behind(self, area, inner, given) -> list[np.ndarray]:
        """Derivatives (2, ...) of the pressure around the jet over that at the far end of a pipe behind the valve, by
        areas, their rates and inner unknowns: of its head, Pa, and of its momentum, Pa s. Nothing without one.
        """
        tail, flow, m = self.linear.model.tail, self.linear.model.flow, self.pencil.m
        if tail is None:
            return []
        channel = still_channel(flow)

        def lifted(area, rate, inner):
            passing = flow.flange(inner, given)[0]
            stream = channel.stream(area, rate, flow.speeds_of(area, rate, inner, given), inner, passing)
            return given["density"] * jnp.array([tail.head(stream, given), tail.momentum(stream, given)])

        rows = jax.jacrev(lifted, argnums=(0, 1, 2))(area, jnp.zeros_like(area), inner)
        by_area, by_rate = (np.pad(np.asarray(row), ((0, 0), (0, m - len(area)))) for row in rows[:2])
        return [by_area, by_rate, np.asarray(rows[2])]

    def _outputs(self, s: complex, lip, motion, inner) -> np.ndarray:
        """Outputs (4, ...) from the displacement of the lip, areas (m, ...) and inner unknowns (b, ...)."""
        A, B, _, _ = self.pencil.fluid_at(s)
        flow = (self._by_area + s * self._by_rate) @ motion + self._by_inner @ inner
        pressure = A[self._flange] @ motion + B[self._flange] @ inner + self.pressure[self._flange]
        if self._tail:  # stations have the pressure over that around the jet, a gauge that over the surroundings
            by_area, by_rate, by_inner = self._tail
            pressure = pressure + np.array([1.0, s]) @ ((by_area + s * by_rate) @ motion + by_inner @ inner)
        return np.array([lip, self._copies * motion[0], flow, pressure])

    def full(self, frequency: float) -> tuple[np.ndarray, np.ndarray]:
        """Outputs (4,) of the full operator, and its displacements (n,)."""
        s = 2j * np.pi * frequency if frequency else 0.0
        q, u = self._workspace.shifted(self.pencil, s).solve(self.force + 0.0 * s, -self.balance + 0.0 * s)
        return self._outputs(s, self._lip @ q, real_apply(self.pencil.J, q), u), q

    def _reduce(self) -> None:
        asked = self.frequencies
        picks = [float(f) for f in asked[np.linspace(0, len(asked) - 1, 6).astype(int)]]
        vectors, checked, errors = [], [], []
        for frequency in dict.fromkeys(picks):
            vectors.append(self._full_or_beside(frequency)[1])
        for number in range(MOST):
            self._project(np.column_stack([part for q in vectors for part in (q.real, q.imag)]))
            at = float(asked[int(np.argmax(self._residuals()))])
            at *= 1.0 + 1e-3 * (number % 2)  # a frequency of the grid is met and missed in turn
            outputs, q = self._full_or_beside(at)
            error = float(np.max(np.abs(outputs - self.at([at])[0]) / np.abs(outputs)))
            checked.append(at)
            errors.append(error)
            if error <= ACCURACY and len(errors) > 1 and errors[-2] <= ACCURACY:
                self.checked, self.error = tuple(checked[-2:]), max(errors[-2:])
                return
            vectors.append(q)
        raise SolveError(
            f"The response was not found on a reduced operator: after {MOST} full solutions it is {errors[-1]:.2g} off."
        )

    def _full_or_beside(self, frequency: float) -> tuple[np.ndarray, np.ndarray]:
        try:
            return self.full(frequency)
        except SingularShiftError as error:
            raise SolveError(f"The state has an undamped mode at {frequency:.6g} Hz: {error}") from error

    def _project(self, vectors: np.ndarray) -> None:
        pencil = self.pencil
        # orthogonal factors keep what Gram's matrix loses: a lip that stops hold moves by a millionth of the wall
        length = np.linalg.norm(vectors, axis=0)
        factor, triangle, _ = qr(vectors[:, length > 0.0] / length[length > 0.0], mode="economic", pivoting=True)
        strength = np.abs(np.diag(triangle))
        self._V = factor[:, strength > WEAK * strength[0]]
        self._images = [matrix @ self._V for matrix in (pencil.M, pencil.C, pencil.K, *pencil.relaxing)]
        self.reduced = pencil.projected(self._V)
        self._operator, self._motion = DenseOperator(self.reduced), self.reduced.J.toarray()
        self._small_force, self._small_lip = self._V.T @ self.force, self._lip @ self._V

    def _solved(self, s: complex) -> tuple[np.ndarray, np.ndarray]:
        """Coordinates (k,) and inner unknowns (b,) of the reduced response."""
        whole = self._operator(s)[0]
        scale = np.abs(whole).max(axis=1)
        x = np.linalg.solve(whole / scale[:, None], np.concatenate([self._small_force, -self.balance]) / scale)
        return x[: self.size], x[self.size :]

    def _residuals(self) -> np.ndarray:
        """Norm of what the reduced response leaves of the full force, over its own, at each frequency asked."""
        pencil, own, out = self.pencil, self.pencil.relaxation, []
        M, C, K, *relaxing = self._images
        for s in 2j * np.pi * self.frequencies:
            x, u = self._solved(s)
            A, B, _, _ = pencil.fluid_at(s)
            left = s * s * (M @ x) + s * (C @ x) + K @ x - self.force
            if own is not None:
                left = left + sum(factor * (part @ x) for factor, part in zip(own.factors(s), relaxing))
            left = left - real_apply(pencil.G, A @ (self._motion @ x) + B @ u)
            out.append(np.linalg.norm(left) / np.linalg.norm(K @ x))
        return np.array(out)

    @property
    def size(self) -> int:
        """Unknowns of the reduced operator."""
        return self._V.shape[1]

    def at(self, frequencies) -> np.ndarray:
        """Complex responses (k, 4) per pressure at frequencies, Hz."""
        found = []
        for s in 2j * np.pi * np.asarray(frequencies, float):
            x, u = self._solved(s)
            found.append(self._outputs(s, self._small_lip @ x, self._motion @ x, u))
        return np.array(found).reshape(-1, len(OUTPUTS))

    @cached_property
    def modes(self) -> np.ndarray:
        """Oscillating eigenvalues in the range of frequencies, by falling growth rate."""
        values = self._eigenvalues()
        kept = values[self._is_in_range(values)]
        return kept[np.argsort(-kept.real)]

    def _is_in_range(self, values):
        low, high = 2 * np.pi * self.frequencies[[0, -1]]
        return (values.imag > max(low, 1e-6 * high)) & (values.imag < high) & (-values.real < values.imag)

    def _eigenvalues(self) -> np.ndarray:
        """Eigenvalues of the reduced operator in that range, corrected on the full one; without those that belong to
        none.
        """
        values, x, u, *_ = all_pairs(self.reduced, left=False)
        found: list[complex] = []
        for i in np.flatnonzero(self._is_in_range(values)):
            start = values[i], self._V @ x[:, i], u[:, i]
            value, *_, residual, backward = newton(self.pencil, *start, workspace=self._workspace, tolerance=EXACT)
            known = any(abs(value - other) <= SAME * abs(value) for other in found)
            if acceptable(residual, backward, EXACT) and not known:
                found.append(complex(value))
        return np.array(found, complex)

    def spread(self, density: Callable[[np.ndarray], np.ndarray], breaks=()) -> Spread:
        """Random motion under a pressure of a given one-sided power density, Pa2/Hz over Hz, within the range of
        frequencies; between `breaks` the density is smooth.
        """
        low, high = self.frequencies[[0, -1]]
        places = [low, high, *np.linspace(low, high, 33), *np.geomspace(low, high, 17), *breaks]
        for value in self.modes:
            places += [(value.imag + width * value.real) / (2 * np.pi) for width in WIDTHS]
        edges = np.unique([place for place in places if low <= place <= high])
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        half = 0.5 * np.diff(edges)[:, None]
        at = (0.5 * (edges[1:] + edges[:-1])[:, None] + half * nodes).ravel()
        power = np.abs(self.at(at)) ** 2 * np.asarray(density(at))[:, None]
        weight = (half * weights).ravel()
        variance = weight @ power
        return Spread(np.sqrt(variance), weight @ power**2 / variance**2)


CURVE, PEAKS, POINTS = "curve", "peaks", "points"
_CURVE = (
    Column("value", "SI", "Of the range"),
    Column("frequency", "Hz", "Of the pressure at the inlet"),
    *(Column(f"{n}_{p}", f"{u}/Pa", f"{p} part, per pressure") for n, u in OUTPUTS.items() for p in ("real", "imag")),
)
_PEAKS = (
    Column("value", "SI", "Of the range"),
    Column("frequency", "Hz", "Of the mode"),
    Column("growth_rate", "1/s", "Of the mode"),
    *(Column(name, f"{unit}/Pa", "Amplitude per pressure at that frequency") for name, unit in OUTPUTS.items()),
)
_POINTS = (
    Column("value", "SI", "Of the range"),
    Column("growth_rate", "1/s", "Of the mode of least damping ratio up to response.max_frequency"),
    Column("frequency", "Hz", "Of that mode"),
    Column("damping_ratio", "", "Of that mode"),
    Column("correlation_time", "s", "Of the lip under the noise"),
    *(Column(f"{name}_rms", unit, "Root mean square under the noise") for name, unit in OUTPUTS.items()),
    Column("error", "", "Relative, of the reduced operator against the full one at frequencies it was not made for"),
    Column("size", "", "Unknowns of the reduced operator", "i8"),
)
#: Frequencies below the curves at which the response is made too, over their step.
SLOW = np.geomspace(0.01, 0.7, 8)
#: Curves, peaks, and one row for each value of the range.
_TABLES = TableSpec(CURVE, _CURVE, chunk=512), TableSpec(PEAKS, _PEAKS), TableSpec(POINTS, _POINTS)


def rows_to_keep(known: Record, _case: Case) -> dict[str, int]:
    """Rows that a run goes on from: those of the values whose point vouches for them."""
    done = known.column(POINTS, "value")
    own = {table: int(np.isin(known.column(table, "value"), done).sum()) for table in (CURVE, PEAKS)}
    return own | {POINTS: len(done)}


def check(case: Case) -> None:
    """Refuse a range of what the case does not have, a fluid without inertia, and noise that has no power within the
    frequencies.
    """
    check_range(case, case.response.parameter)
    require_inertia(case)
    left_out(case)


def frequencies(case: Case, resolved: float = np.inf) -> np.ndarray:
    """Frequencies, Hz, that the response is made for: those of the curves, and some below them; up to where waves are
    resolved.
    """
    # down to a little above zero: a long line lets slow pulsation through that it keeps from faster one
    step = min(case.response.max_frequency, resolved) / case.response.count
    return np.append(step * SLOW, step * np.arange(1, case.response.count + 1))


def left_out(case: Case, resolved: float = np.inf) -> list[str]:
    """Sentences on the power of response.spectrum beyond the frequencies that the response is made for, up to where
    waves are resolved. Raises CaseError without any power within them.
    """
    frequency, power = np.transpose(case.response.density())
    (low, most), whole = frequencies(case, resolved)[[0, -1]], trapezoid(power, frequency)

    def up_to(limit: float) -> float:
        within = np.append(frequency[frequency < limit], min(limit, frequency[-1]))
        return trapezoid(np.interp(within, frequency, power), within)

    below, above = up_to(low), whole - up_to(most)
    if not whole - below - above > 1e-12 * whole:
        raise CaseError(
            f"response.spectrum has no power between {low:.4g} and {most:g} Hz, so nothing moves; give a spectrum that "
            "has, or response.max_frequency and response.count.",
            key="response.spectrum",
        )
    parts = (
        (below, 1e-3, f"below {low:.4g} Hz, a hundredth of the step that response.count gives"),
        (above, 1e-6, f"above response.max_frequency = {most:g} Hz"),
    )
    return [
        f"response.spectrum has {100 * part / whole:.3g} % of its power {where}, which root mean squares are without."
        for part, least, where in parts
        if part >= least * whole
    ]


def run(session: Session, record: GrowingRecord) -> None:
    """Response at the state of the case, or at every value of response.over. Raises CaseError without a fluid that has
    inertia. Raises SolveError without flow.
    """
    case, asked = session.case, session.case.response
    values = (case.drive.pressure,) if asked.axis is None else asked.axis.values
    rows = asked.density()
    walk = StabilityWalk(case, record, session.model)
    done = set(record.column(POINTS, "value"))
    record.begin("response", len(values))
    record.warn(*left_out(case))
    for value in values:
        if value in done:
            continue
        try:
            _respond(walk, Mu.of(case).at(**{asked.parameter: value}), value, rows, record)
        except (CaseError, SolveError, ArithmeticError) as error:
            record.fail(f"At {PARAMETERS[asked.parameter].text(value)}: {error}")
        record.item(value)
    outside = outside_band(case, record.column(PEAKS, "frequency"))
    record.warn(*filter(None, (ended_early(record, case), outside, *walk.about_rubbers())))


def ended_early(record: Record, case: Case) -> str | None:
    """Sentence on curves that end where waves are no longer resolved; None where all go to response.max_frequency."""
    values, frequency = (record.column(CURVE, name) for name in ("value", "frequency"))
    most = case.response.max_frequency
    least = min((frequency[values == value].max() for value in np.unique(values)), default=most)
    if least >= most * (1.0 - 1e-9):
        return None
    return (
        "The elements of the line, or the rows of the mesh in a fluid that is compressed, resolve waves up to "
        f"{digits(least, 4)} Hz, so curves, peaks and root mean squares end there, below response.max_frequency = "
        f"{digits(most, 4)} Hz; more upstream.elements or mesh.along reach further."
    )


def _respond(walk: StabilityWalk, place: Mu, value: float, rows, record: GrowingRecord) -> None:
    """Keep the response at one parameter point."""
    verdict = walk.verdict(place)
    if not verdict.stable:
        state = "is not stable" if verdict.stable is False else "is not known to be stable"
        raise SolveError(f"the state {state}, so that motions about it do not stay small. {verdict.reason}")
    linear = walk.family(place).linear
    resolved = linear.resolved(place)
    left_out(walk.case, resolved)  # a spectrum without power below
    transfer = Transfer(linear, place, frequencies(walk.case, resolved))
    even = transfer.frequencies[len(SLOW) :]
    curve = transfer.at(even)
    columns: dict[str, Any] = {"value": np.full(len(curve), value), "frequency": even}
    for name, row in zip(OUTPUTS, curve.T):
        columns |= {f"{name}_real": row.real, f"{name}_imag": row.imag}
    table = np.array(rows)
    found = transfer.spread(lambda f: np.interp(f, *table.T, left=0.0, right=0.0), table[:, 0])
    modes = transfer.modes
    peaks = np.abs(transfer.at(modes.imag / (2 * np.pi)))
    record.extend(CURVE, columns)
    for mode, heights in zip(modes, peaks):
        row = {"value": value, "frequency": mode.imag / (2 * np.pi), "growth_rate": mode.real}
        record.append(PEAKS, row | dict(zip(OUTPUTS, heights)))
    point = {"value": value, "error": transfer.error, "size": transfer.size}
    # the peak of least damping, or the leading mode where there is none in the range of frequencies
    ratios = -modes.real / np.abs(modes)
    least = modes[int(np.argmin(ratios))] if len(modes) else complex(verdict.growth_rate, 2 * np.pi * verdict.frequency)
    point |= {"growth_rate": least.real, "frequency": least.imag / (2 * np.pi)}
    point |= {"damping_ratio": -least.real / abs(least)}
    point |= {"correlation_time": found.correlation_time[0]}
    record.append(POINTS, point | {f"{name}_rms": rms for name, rms in zip(OUTPUTS, found.rms)})


class ResponseResult(RangeResult):
    """Response to the pressure at the inlet.

    Attributes
    ----------
    parameter : str
    points : list of dict
        One for each value of the range that is stable.

    Examples
    --------
    >>> found = dbvfiv.load("cases/dbv12-in-line.toml").response(pressure="2 m")                # doctest: +SKIP
    >>> found.points[0]["lip_displacement_rms"], found.peaks(found.points[0]["value"])          # doctest: +SKIP
    """

    kind = "response"
    missed = "There is no response at {} of the states"

    @cached_property
    def points(self) -> list[dict[str, Any]]:
        rows = self.record.table_rows(_TABLES[2])
        return [{name: np.asarray(value).item() for name, value in row.items()} for row in rows]

    def curve(self, value: float) -> dict[str, np.ndarray]:
        """Frequencies, Hz, and complex responses per Pa by name at a value of the range."""
        here = self.record.column(CURVE, "value") == value
        read = lambda name: self.record.column(CURVE, name)[here]  # noqa: E731
        return {"frequency": read("frequency")} | {n: read(f"{n}_real") + 1j * read(f"{n}_imag") for n in OUTPUTS}

    def peaks(self, value: float) -> list[dict[str, float]]:
        """Modes in the range of frequencies at a value of the range, with the amplitudes per Pa at each."""
        found = []
        for row in self.record.table_rows(_TABLES[1]):
            if row["value"] == value:
                plain = {name: float(number) for name, number in row.items()}
                turns = 2 * np.pi * plain["frequency"]
                found.append(plain | {"damping_ratio": -plain["growth_rate"] / np.hypot(plain["growth_rate"], turns)})
        return sorted(found, key=lambda peak: peak["frequency"])

    def summary(self) -> dict[str, Any]:
        points = []
        for point in self.points:
            curve = self.curve(point["value"])
            shown = {"frequency": curve.pop("frequency").tolist()}
            shown |= {n: {"amplitude": np.abs(c).tolist(), "phase": np.angle(c).tolist()} for n, c in curve.items()}
            peaks = [{k: float(v) for k, v in p.items()} for p in self.peaks(point["value"])]
            points.append(point | {"peaks": peaks, "curve": shown})
        fixed = fixed_conditions(self.case, self.parameter)
        known = {"parameter": self.parameter, "symmetry": equilibria_of(self.case.part).name}
        return known | {"points": points, "fixed": fixed} | self.ending()

    def lines(self) -> list[str]:
        units = self.case.units
        row, unit, flow = self._row, units.name("flow"), units.factor("flow")
        said = [f"At {describe_fixed(self.case, self.parameter)}; {self.noise}:"]
        head = f"{self.parameter:>14}{'damping, %':>12}{'at, Hz':>10}{'lip rms, um':>13}{'flow rms, ' + unit:>15}"
        said.append(f"{head}{'correlation, s':>16}")
        said += [
            f"{row.text(p['value']):>14}{100 * p['damping_ratio']:>12.4g}{p['frequency']:>10.4g}"
            f"{1e6 * p['lip_displacement_rms']:>13.4g}{p['flow_rms'] / flow:>15.4g}{p['correlation_time']:>16.4g}"
            for p in self.points
        ]
        if not self.points:
            return [*said, "There is no stable state."]
        said.append(f"They are stable in {only_class_of(self.case.part)}.")
        last = self.points[-1]
        said += ["", f"Peaks at {row.text(last['value'])}, per kPa at the inlet:"]
        said.append(f"{'frequency, Hz':>14}{'damping, %':>12}{'lip, um':>12}{'flow, ' + unit:>12}{'flange, Pa':>12}")
        said += [
            f"{p['frequency']:>14.5g}{100 * p['damping_ratio']:>12.4g}{1e9 * p['lip_displacement']:>12.4g}"
            f"{1e3 * p['flow'] / flow:>12.4g}{1e3 * p['flange_pressure']:>12.4g}"
            for p in self.peaks(last["value"])
        ]
        worst = max(point["error"] for point in self.points)
        said.append(f"Reduced operator of {last['size']} unknowns, within {worst:.1g} of the full one where checked.")
        return said

    @property
    def noise(self) -> str:
        """Pressure noise in words."""
        asked = self.case.response
        if asked.spectrum is not None:
            return f"pressure noise of {asked.spectrum.name}"
        return f"white pressure noise of {digits(asked.noise, 4)} Pa up to {digits(asked.max_frequency, 4)} Hz"


_SHOWN = (("lip_displacement", 1e9, "Lip, um per kPa"), ("flow", 1e6, "Flow, L/s per kPa"))


def draw(result: RangeResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a response, each with its name."""
    if result.points:
        yield "response", lambda: response(result)
    if len(result.points) > 1:
        yield "precursors", lambda: precursors(result)


def _finish(figure: Figure, result: RangeResult, title: str) -> Figure:
    return headline(figure, title, describe_fixed(result.case, result.parameter), result.noise)


def response(result: RangeResult) -> Figure:
    """Amplitudes per pressure at the inlet and the phase of the lip, over frequency."""
    figure = new_figure(7.6, 6.4)
    axes = figure.subplots(3, 1, sharex=True)
    for point in some_of(result.points):
        curve, label = result.curve(point["value"]), PARAMETERS[result.parameter].text(point["value"])
        for panel, (name, scale, _) in zip(axes, _SHOWN):
            panel.semilogy(curve["frequency"], scale * np.abs(curve[name]), lw=1.2, label=label)
        axes[2].plot(curve["frequency"], np.unwrap(np.angle(curve["lip_displacement"])) * 180 / np.pi, lw=1.2)
    for peak in result.peaks(result.points[-1]["value"]):
        axes[0].axvline(peak["frequency"], color="0.6", lw=0.7, ls=":")
    for panel, (_, _, label) in zip(axes, _SHOWN):
        panel.set_ylabel(label)
    axes[2].set(xlabel="Frequency, Hz", ylabel="Phase of the lip, deg", xlim=(0, result.case.response.max_frequency))
    axes[0].legend(fontsize=8)
    return _finish(figure, result, f"Response of {result.header.name} to the pressure at the inlet")


def precursors(result: RangeResult) -> Figure:
    """Root mean square of the lip under the noise, its correlation time, and the least damping over the range."""
    figure = new_figure(7.6, 6.4)
    axes = figure.subplots(3, 1, sharex=True)
    x = np.array([point["value"] for point in result.points]) / PARAMETERS[result.parameter].scale
    rows = (
        ("lip_displacement_rms", 1e6, "Lip rms, um", COMPUTED),
        ("correlation_time", 1.0, "Correlation time, s", COMPUTED),
        ("damping_ratio", 100.0, "Least damping, %", ACCENT),
    )
    for panel, (name, scale, label, colour) in zip(axes, rows):
        panel.plot(x, [scale * point[name] for point in result.points], "o-", color=colour)
        panel.set_ylabel(label)
    if result.axis is not None and result.axis.log:
        axes[2].set_xscale("log")
    axes[2].set_xlabel(parameter_label(result.case, result.parameter))
    return _finish(figure, result, f"Towards the onset, {result.header.name}")


STUDY = Study("response", lambda _mesh: _TABLES, run, ResponseResult, check, rows_to_keep=rows_to_keep)
