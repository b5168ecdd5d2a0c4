"""Onset curves of a stability map: linked through the onsets of its columns, and followed exactly by continuation of
Hopf points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from continuation import ContinuationError, ContinuationOptions, NewtonOptions, SpecialPoint, continue_hopf
from continuation.hopf import hopf_borders

from ..errors import CaseError, SolveError
from ..observer import Observer
from .map_column import MapColumn, MapPlan
from .onset_normal_form import system_of
from .plane_system import RATE, PlaneSystem
from .stability_walk import StabilityWalk

#: Distance in the unit square, frequencies counted relatively, up to which onsets of neighbouring columns belong
#: together.
NEIGHBOURS = 0.7
#: Distance from a curve, in the unit square, up to which an onset of a column counts as on it.
ON_CURVE = 2e-3
#: First, smallest and largest step along a curve, in the unit square.
STEPS = (0.02, 1e-5, 0.07)


@dataclass(frozen=True)
class OnsetCurve:
    """A curve in the plane of the map on which a mode is neutral.

    Attributes
    ----------
    law : int
        Number of the continuity law.
    x, y : (k,) arrays
        SI values.
    frequency : (k,) array, Hz
    exact : bool
        Followed by continuation; otherwise straight between the onsets of columns.
    mismatch : float
        Largest distance, in the unit square, of the columns' onsets from it; NaN if not compared.
    reason : str
        Why the continuation ended.
    """

    law: int
    x: np.ndarray
    y: np.ndarray
    frequency: np.ndarray
    exact: bool = False
    mismatch: float = float("nan")
    reason: str = ""

    def points(self) -> list[list[float]]:
        """[[x, y], ...]."""
        return [[float(a), float(b)] for a, b in zip(self.x, self.y)]


def linked(plan: MapPlan, columns: tuple[MapColumn, ...]) -> tuple[OnsetCurve, ...]:
    """Curves through the onsets of neighbouring columns; chains of opposite direction that end at one column meet in
    the tip of a tongue.
    """
    usable = [column for column in columns if not column.failure]
    chains: list[list[tuple[int, tuple]]] = []
    open_: list[list[tuple[int, tuple]]] = []
    for i, column in enumerate(usable):
        left, kept = [tuple(row) for row in column.onsets], []
        pairs = sorted(
            (
                (_apart(plan, chain[-1][1], point), a, b)
                for a, chain in enumerate(open_)
                for b, point in enumerate(left)
            ),
            key=lambda t: t[0],
        )
        taken_a, taken_b = set(), set()
        for distance, a, b in pairs:
            if distance > NEIGHBOURS or a in taken_a or b in taken_b:
                continue
            taken_a.add(a)
            taken_b.add(b)
            open_[a].append((i, left[b]))
            kept.append(open_[a])
        for b, point in enumerate(left):
            if b not in taken_b:
                chain = [(i, point)]
                chains.append(chain)
                kept.append(chain)
        open_ = kept
    chains = _joined(plan, chains)
    return tuple(_curve(plan, usable, chain) for chain in chains)


def _apart(plan: MapPlan, a, b) -> float:
    """Distance of two onsets along their columns; infinite for different laws or directions."""
    if a[0] != b[0] or a[3] != b[3]:
        return np.inf
    gap = plan.coordinate(plan.along, a[1]) - plan.coordinate(plan.along, b[1])
    return float(np.hypot(gap, (a[2] - b[2]) / max(a[2], b[2], 1.0)))


def _joined(plan: MapPlan, chains):
    """Join chains head to head or tail to tail at tongue tips."""
    chains = [list(chain) for chain in chains]
    for end in (0, -1):
        merged = True
        while merged:
            merged = False
            for a in range(len(chains)):
                for b in range(a + 1, len(chains)):
                    one, two = chains[a][end], chains[b][end]
                    opposite = one[0] == two[0] and one[1][0] == two[1][0] and one[1][3] != two[1][3]
                    close = (
                        abs(plan.coordinate(plan.along, one[1][1]) - plan.coordinate(plan.along, two[1][1]))
                        < NEIGHBOURS
                        if opposite
                        else False
                    )
                    if close and abs(one[1][2] - two[1][2]) < 0.25 * max(one[1][2], two[1][2], 1.0):
                        first, second = (chains[a][::-1], chains[b]) if end == 0 else (chains[a], chains[b][::-1])
                        chains[a] = first + second
                        del chains[b]
                        merged = True
                        break
                if merged:
                    break
    return chains


def _curve(plan: MapPlan, columns, chain) -> OnsetCurve:
    across = np.array([columns[i].value for i, _ in chain])
    along = np.array([point[1] for _, point in chain])
    x, y = (along, across) if plan.transposed else (across, along)
    return OnsetCurve(int(chain[0][1][0]), x, y, np.array([point[2] for _, point in chain]))


def continued(
    plan: MapPlan, walk: StabilityWalk, curves: tuple[OnsetCurve, ...], observer: Observer, warnings: list[str]
) -> tuple[OnsetCurve, ...]:
    """Replace curves by exact ones; a curve that cannot be followed stays as it is, with a sentence in `warnings`."""
    done: list[OnsetCurve] = []
    for curve in sorted(curves, key=lambda c: -len(c.x)):
        points = _unit(plan, curve.x, curve.y)
        others = [known for known in done if known.exact and known.law == curve.law]
        distance = (
            np.min([_distances(points, _unit(plan, k.x, k.y)) for k in others], axis=0)
            if others
            else np.full(len(points), np.inf)
        )
        if np.all(distance < 5 * ON_CURVE):
            continue  # another curve goes through all its points
        if not np.all(curve.frequency > 0):
            done.append(curve)
            continue
        observer.progress(f"onset curve from {plan.x.parameter} = {curve.x[len(curve.x) // 2]:.6g}")
        try:
            done.append(follow(plan, walk, curve))
        except (ContinuationError, SolveError, CaseError, ArithmeticError, ValueError) as error:
            warnings.append(
                f"An onset curve near {plan.x.parameter} = {curve.x[0]:.6g} was not followed exactly: "
                f"{str(error).rstrip('.')}."
            )
            done.append(curve)
    return tuple(done)


def follow(plan: MapPlan, walk: StabilityWalk, curve: OnsetCurve) -> OnsetCurve:
    """The exact curve through the middle of a linked one, in both directions up to the edges of the map.

    Raises
    ------
    ContinuationError, SolveError
    """
    law = plan.laws[curve.law]
    middle = len(curve.x) // 2
    special, system = hopf_at(plan, walk, law, curve.x[middle], curve.y[middle], curve.frequency[middle])
    parts, reasons = [], []
    for direction in (1, -1):
        options = ContinuationOptions(
            step=STEPS[0],
            min_step=STEPS[1],
            max_step=STEPS[2],
            max_points=400,
            limits={"x": (0.0, 1.0), "y": (0.0, 1.0)},
            direction=direction,
            location_tolerance=2e-5,
            newton=NewtonOptions(tolerance=1e-4, max_iterations=10),
            state_scale=10.0,
        )
        branch = continue_hopf(system, special, ("x", "y"), options, lyapunov=False)
        part = np.column_stack(
            [branch.values("x"), branch.values("y"), RATE * np.abs(branch.values("omega")) / (2 * np.pi)]
        )
        parts.append(part)
        reasons.append(branch.reason)
        if "closed" in branch.reason:
            break
    whole = parts[0] if len(parts) == 1 else np.vstack([parts[1][::-1], parts[0][1:]])
    onsets = np.column_stack([_unit(plan, curve.x, curve.y), curve.frequency])
    whole, mismatch = merged(whole, onsets)
    x = np.array([plan.value(plan.x, c) for c in np.clip(whole[:, 0], 0, 1)])
    y = np.array([plan.value(plan.y, c) for c in np.clip(whole[:, 1], 0, 1)])
    return OnsetCurve(curve.law, x, y, whole[:, 2], True, mismatch, "; ".join(dict.fromkeys(reasons)))


def merged(curve: np.ndarray, onsets: np.ndarray) -> tuple[np.ndarray, float]:
    """Points (k, 3) of a continued curve and onsets (p, 3) of columns on it, in order; and the largest distance of the
    latter from a spline through the former.
    """
    points = curve[np.concatenate([[True], np.linalg.norm(np.diff(curve[:, :2], axis=0), axis=1) > 1e-9])]
    if len(points) < 4:
        return curve, float(_distances(onsets[:, :2], curve[:, :2]).max())
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1))])
    fine = np.linspace(0.0, length[-1], 60 * len(points))
    line = CubicSpline(length, points)(fine)
    distance = _distances(onsets[:, :2], line[:, :2])
    where = fine[np.argmin(np.linalg.norm(onsets[:, None, :2] - line[None, :, :2], axis=2), axis=1)]
    on = distance < ON_CURVE
    # no two points closer than what the order along the curve can resolve
    on &= np.min(np.abs(where[:, None] - length[None]), axis=1) > fine[1]
    order = np.argsort(np.concatenate([length, where[on]]), kind="stable")
    return np.vstack([points, onsets[on]])[order], float(distance.max())


def hopf_at(plan: MapPlan, walk: StabilityWalk, law: float, x: float, y: float, frequency: float):
    """A Hopf point for `continue_hopf` at an onset of a column, and the system it belongs to."""
    across, along = (y, x) if plan.transposed else (x, y)
    place = plan.place(across, along, law)
    system = PlaneSystem(system_of(plan.case, walk, place), plan, law)
    plane = {"x": plan.coordinate(plan.x, x), "y": plan.coordinate(plan.y, y)}
    u = system.state(walk.equilibrium(place), plane)
    spectrum = walk.spectrum(place)
    nearest = int(np.argmin(np.abs(spectrum.eigenvalues - 2j * np.pi * frequency)))
    value = complex(spectrum.eigenvalues[nearest])
    if abs(value - 2j * np.pi * frequency) > 1e-3 * abs(value):
        raise SolveError(
            f"The full pencil has no neutral mode at {plan.x.parameter} = {x:.6g}, {plan.y.parameter} = {y:.6g}."
        )
    omega, q = abs(value.imag), spectrum.q[:, nearest]
    vector = np.concatenate([q, 1j * omega * q, spectrum.u[:, nearest]])
    linear = system.linear(u, plane)
    left, right = hopf_borders(linear, omega / RATE, vector / np.linalg.norm(vector))
    slope = -linear.solve(system.d_parameter(u, plane, "x"))
    tangent = np.append(slope, 1.0)
    z = np.append(u, plane["x"])
    special = SpecialPoint(
        "hopf", 0, u, plane, z, tangent, True, "", {"omega": omega / RATE}, {"right": right, "left": left}
    )
    return special, system


def _unit(plan: MapPlan, x, y) -> np.ndarray:
    return np.column_stack([[plan.coordinate(plan.x, v) for v in x], [plan.coordinate(plan.y, v) for v in y]])


def _distances(points: np.ndarray, line: np.ndarray) -> np.ndarray:
    """Distances of points (p, 2) from a polyline (k, 2)."""
    if len(line) < 2:
        return np.linalg.norm(points - line[0], axis=1)
    a, d = line[:-1], np.diff(line, axis=0)
    share = np.einsum("pkj,kj->pk", points[:, None] - a, d) / np.maximum(np.einsum("kj,kj->k", d, d), 1e-300)
    nearest = a + np.clip(share, 0, 1)[:, :, None] * d
    return np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1)
