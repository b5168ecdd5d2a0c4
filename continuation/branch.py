"""Branches and curves as result objects: points, special points, files, figures, JSON."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from continuation import storage
from continuation.plots import plot_branch


@dataclass
class SpecialPoint:
    """A point where something happens on a branch.

    Attributes
    ----------
    kind : str
        ``"fold"``, ``"branch point"``, ``"hopf"``, ``"bogdanov-takens"``,
        ``"generalised hopf"``, ``"cusp"``, ``"zero-hopf"``, an event's own name, ...
    index : int
        It lies between points ``index`` and ``index + 1`` of the branch.
    u : ndarray, shape (n,)
    mu : dict
        All parameters.
    z, tangent : ndarray
        Unknowns of the curve and its tangent there.
    located : bool
        Located by Newton's method and confirmed to be the point detected; otherwise the
        values are those of the best bracket and ``reason`` tells why.
    reason : str
    values : dict of str to float
        Numbers such as ``omega``, ``first_lyapunov_coefficient``, ``iterations``.
    vectors : dict of str to ndarray
        Null vectors or eigenvectors: ``right``, ``left``, ``direction``, ...
    """

    kind: str
    index: int
    u: np.ndarray
    mu: dict
    z: np.ndarray
    tangent: np.ndarray
    located: bool
    reason: str = ""
    values: dict = field(default_factory=dict)
    vectors: dict = field(default_factory=dict)

    def to_dict(self) -> dict:
        """Without the vectors."""
        values = {k: v if isinstance(v, str) else float(v) for k, v in self.values.items()}
        return {
            "kind": self.kind,
            "index": self.index,
            "mu": self.mu,
            "located": self.located,
            "reason": self.reason,
            **values,
        }


@dataclass
class CurvePoint:
    """One point of a curve.

    Attributes
    ----------
    z, tangent : ndarray
        Unknowns (state, freed parameters, extra numbers) and unit tangent.
    step : float
        Arclength step that led here (0 at the start).
    iterations : int
    residual : float
    tests : dict of str to float
        Test functions.
    unstable : int
        Unstable eigenvalues among those asked for; -1 if not known.
    eigenvalues : ndarray, complex
        Converged eigenvalues with non-negative imaginary part.
    """

    z: np.ndarray
    tangent: np.ndarray
    step: float
    iterations: int
    residual: float
    tests: dict = field(default_factory=dict)
    unstable: int = -1
    eigenvalues: np.ndarray = field(default_factory=lambda: np.empty(0, complex))


@dataclass
class Branch:
    """A computed curve; everything accepted is kept whatever ended the run.

    Attributes
    ----------
    kind : str
        ``"equilibria"``, ``"fold curve"``, ``"hopf curve"`` or ``"orbits"``.
    size : int
        n.
    names : tuple of str
        Freed parameters.
    extra_names : tuple of str
        Extra unknowns, e.g. ``("omega",)``.
    fixed : dict
        All parameters at the start.
    points : list of CurvePoint
    special : list of SpecialPoint
    reason : str
        Why it ended.
    next_step : float
        Where the step control stood.
    restart : dict of str to ndarray
        What a resumed run needs besides the points.
    """

    kind: str
    size: int
    names: tuple[str, ...]
    extra_names: tuple[str, ...]
    fixed: dict
    points: list[CurvePoint] = field(default_factory=list)
    special: list[SpecialPoint] = field(default_factory=list)
    reason: str = "running"
    next_step: float = 0.0
    restart: dict = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def states(self) -> np.ndarray:
        """States, shape (points, n)."""
        return np.array([point.z[: self.size] for point in self.points])

    @property
    def unstable(self) -> np.ndarray:
        """Number of unstable eigenvalues, shape (points,); -1 where not known."""
        return np.array([point.unstable for point in self.points])

    def values(self, name: str | None = None) -> np.ndarray:
        """A freed parameter (the first by default), extra unknown or test function."""
        name = self.names[0] if name is None else name
        columns = (*self.names, *self.extra_names)
        if name in columns:
            return np.array([point.z[self.size + columns.index(name)] for point in self.points])
        if any(name in point.tests for point in self.points):
            return np.array([point.tests.get(name, np.nan) for point in self.points])
        raise KeyError(f"The branch has no {name!r}; it has {', '.join(columns)}.")

    def mu(self, index: int) -> dict[str, float]:
        """All parameters at a point."""
        z = self.points[index].z
        return {**self.fixed, **dict(zip(self.names, map(float, z[self.size :])))}

    def of_kind(self, kind: str, located: bool = True) -> list[SpecialPoint]:
        """Special points of one kind, located ones only unless told otherwise."""
        return [s for s in self.special if s.kind == kind and (s.located or not located)]

    def to_dict(self) -> dict:
        """Everything but states and vectors, ready for ``json.dumps``."""
        columns = (*self.names, *self.extra_names)
        return {
            "kind": self.kind,
            "parameters": list(self.names),
            "fixed": {k: v for k, v in self.fixed.items() if k not in self.names},
            "reason": self.reason,
            "points": [
                {
                    **dict(zip(columns, map(float, point.z[self.size :]))),
                    "residual": float(point.residual),
                    "iterations": int(point.iterations),
                    "unstable_count": None if point.unstable < 0 else int(point.unstable),
                    "eigenvalues": [[float(x.real), float(x.imag)] for x in point.eigenvalues],
                }
                for point in self.points
            ],
            "special": [special.to_dict() for special in self.special],
        }

    def to_json(self) -> str:
        """One JSON document; numbers that are not finite become null."""
        return json.dumps(_finite(self.to_dict()), allow_nan=False)

    def save(self, path: str | Path) -> None:
        """Write HDF5; the file is replaced only when the new one is complete."""
        storage.save(self, Path(path))

    @classmethod
    def load(cls, path: str | Path) -> Branch:
        """Read what `save` wrote."""
        return storage.load(Path(path), cls, CurvePoint, SpecialPoint)

    def plot(self, observable=None, ax=None):
        """Branch diagram; see `continuation.plots.plot_branch`."""
        return plot_branch(self, observable, ax)


def _finite(value):
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if isinstance(value, (bool, str, int)) or value is None:
        return value
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    if isinstance(value, (complex, np.complexfloating)):
        return [_finite(value.real), _finite(value.imag)]
    return value
