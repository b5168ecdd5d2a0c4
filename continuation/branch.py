"""Branches and curves as results: points, special points, figures, HDF5 files.

One HDF5 file holds a branch: the attribute ``header`` (JSON) with names, parameters and the reason of the end; ``z``
and ``tangent`` of shape (points, unknowns); one dataset per number; ragged eigenvalues padded with nan; one group per
special point.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field, replace
from operator import itemgetter
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from continuation.options import NotAParameter, Reason, Said, require

#: Version of the layout of files.
FORMAT = 2
#: Special points that the text of a branch lists.
SHOWN = 7


@dataclass
class SpecialPoint:
    """Special point of a branch: a bifurcation, or an event of the user's own.

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
        Numbers such as ``omega``, ``first_lyapunov_coefficient``, ``iterations``; of a fold or branch point
        ``unstable``, the unstable eigenvalues besides the critical one.
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

    def __repr__(self) -> str:
        at = ", ".join(f"{name} = {value:.8g}" for name, value in self.mu.items())
        return f"<SpecialPoint: {self.kind} at {at}, {'located' if self.located else 'not located: ' + self.reason}>"


@dataclass
class CurvePoint:
    """Point of a curve.

    Attributes
    ----------
    z, tangent : ndarray
        Unknowns (state, freed parameters, extra numbers) and unit tangent.
    step : float
        Arclength step that led here (0 at the start).
    iterations : int
        Corrections spent on it.
    residual : float
    tests : dict of str to float
        Test functions.
    unstable : int
        Unstable eigenvalues among those asked for; -1 if not known.
    eigenvalues : ndarray, complex
        Converged eigenvalues with non-negative imaginary part.
    local : continuation.problem.Local or None
        Linearisation at the point while the run is on.
    data : dict
        Notes of the monitors while the run is on.
    """

    z: np.ndarray
    tangent: np.ndarray
    step: float = 0.0
    iterations: int = 0
    residual: float = np.nan
    tests: dict = field(default_factory=dict)
    unstable: int = -1
    eigenvalues: np.ndarray = field(default_factory=lambda: np.empty(0, complex))
    local: Any = None
    data: dict = field(default_factory=dict)

    def __repr__(self) -> str:
        known = "" if self.unstable < 0 else f", {self.unstable} unstable"
        return f"<CurvePoint: {self.z.size} unknowns, residual {self.residual:.2g}{known}>"

    def record(self) -> CurvePoint:
        """Copy for a result: without linearisation and notes."""
        return replace(self, tests=dict(self.tests), local=None, data={})


@dataclass
class Branch:
    """Computed branch or curve; everything accepted is kept whatever ended the run.

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
    reason : Said
        Sentence that says why it ended; its ``kind`` is a `Reason`.
    next_step : float
        Where the step control stood.
    restart : dict of str to ndarray
        Borders and frame that a resumed run needs besides the points.
    """

    kind: str
    size: int
    names: tuple[str, ...]
    extra_names: tuple[str, ...]
    fixed: dict
    points: list[CurvePoint] = field(default_factory=list)
    special: list[SpecialPoint] = field(default_factory=list)
    reason: Said = Reason.RUNNING()
    next_step: float = 0.0
    restart: dict = field(default_factory=dict)

    def __repr__(self) -> str:
        """Kind, parameters with their ranges, the first special points, and the reason of the end."""
        over = []
        for i, name in enumerate(self.names):
            at = [point.z[self.size + i] for point in self.points] or [np.nan]
            over.append(f"{name} {min(at):.6g} to {max(at):.6g}")
        head = f"<Branch of {self.kind}: {len(self)} points of {self.size} unknowns, {', '.join(over)}; {self.reason}"
        listed = [f"  {special!r}" for special in self.special[:SHOWN]]
        more = len(self.special) - len(listed)
        return "\n".join([head, *listed, *([f"  and {more} more special points"] if more else [])]) + ">"

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
        raise NotAParameter(f"The branch has no {name!r}; it has {', '.join(columns)}.")

    def mu(self, index: int) -> dict[str, float]:
        """All parameters at a point."""
        z = self.points[index].z
        return {**self.fixed, **dict(zip(self.names, map(float, z[self.size :])))}

    def of_kind(self, kind: str, located: bool = True) -> list[SpecialPoint]:
        """Special points of one kind, located ones only by default."""
        return [s for s in self.special if s.kind == kind and (s.located or not located)]

    def reopen(self) -> Branch:
        """Copy with lists of its own, for a run that goes on from the last point."""
        return replace(
            self,
            points=list(self.points),
            special=list(self.special),
            reason=Reason.RUNNING(),
            restart=dict(self.restart),
        )

    def save(self, path: str | Path) -> None:
        """Write HDF5; the file is replaced only when the new one is complete."""
        path = Path(path)
        partial = path.with_name(path.name + ".partial")
        with h5py.File(partial, "w") as file:
            _write(file, self)
        os.replace(partial, path)

    @classmethod
    def load(cls, path: str | Path) -> Branch:
        """Read a file that `save` wrote.

        Raises
        ------
        ValueError
            The file is not one of these, or of an unknown format.
        """
        if not Path(path).is_file():
            raise FileNotFoundError(f"There is no file {path}.")
        foreign = f"{path} is not a branch file of format {FORMAT}."
        require(h5py.is_hdf5(path), foreign)
        with h5py.File(path, "r") as file:
            require(file.attrs.get("format") == FORMAT, foreign)
            header = json.loads(file.attrs["header"])
            header["names"], header["extra_names"] = tuple(header["names"]), tuple(header["extra_names"])
            header["reason"] = Said(header["reason"])
            header["reason"].kind = Reason[header.pop("end")]
            restart = {name: item[()] for name, item in file.get("restart", {}).items()}
            special = [_read_special(item) for item in file["special"].values()]
            return cls(**header, points=_read_points(file), special=special, restart=restart)

    def plot(self, observable=None, ax=None):
        """Branch diagram, stable parts solid, unstable ones dashed; curves in their two parameters.

        Parameters
        ----------
        observable : callable, int or str, optional
            ``observable(u)``, the index of an unknown, or a name that `values` takes; by default the largest absolute
            entry, of orbits their period.  Curves in two parameters need none.
        ax : matplotlib axes, optional

        Returns
        -------
        matplotlib.axes.Axes
        """
        if ax is None:
            import matplotlib.pyplot as plt

            ax = plt.subplots()[1]
        label, values, height = self._observed(observable)
        x, y, unstable = self.values(), values(), self.unstable
        if np.all(unstable < 0):
            ax.plot(x, y, "k-")
        else:
            ax.plot(x, y, "k:", linewidth=0.5)
            for keep, style in ((unstable == 0, "k-"), (unstable > 0, "k--")):
                # A segment belongs to a style when both of its ends do.
                ax.plot(x, np.where(keep, y, np.nan), style)
        kinds = list(dict.fromkeys(special.kind for special in self.special))
        for special in self.special:
            if np.isfinite(special.u).all():
                ax.plot(
                    special.mu[self.names[0]],
                    height(special),
                    f"C{kinds.index(special.kind)}{_MARKERS.get(special.kind, 'x')}",
                    label=special.kind,
                    fillstyle="full" if special.located else "none",
                )
        handles, labels = ax.get_legend_handles_labels()
        unique = dict(zip(labels, handles))
        if unique:
            ax.legend(unique.values(), unique.keys())
        ax.set_xlabel(self.names[0])
        ax.set_ylabel(label)
        return ax

    def _observed(self, observable):
        """Label of what a figure shows, its values along the branch, and its value at a special point."""
        if observable is None and len(self.names) == 2:
            name = self.names[1]
            return name, lambda: self.values(name), lambda special: special.mu[name]
        if observable is None and self.kind == "orbits":
            observable = "period"
        if isinstance(observable, str):

            def beside(special):
                own = {**special.values, **special.mu}
                return own[observable] if observable in own else self.values(observable)[special.index]

            return observable, lambda: self.values(observable), beside
        if observable is None:
            label, function = "largest |u|", lambda u: np.abs(u).max()
        elif callable(observable):
            label, function = getattr(observable, "__name__", "observable"), observable
        else:
            label, function = f"unknown {observable}", itemgetter(int(observable))
        return label, lambda: np.array([function(u) for u in self.states]), lambda special: function(special.u)


def _write(file, branch: Branch) -> None:
    points, names = branch.points, ("kind", "size", "names", "extra_names", "fixed", "reason", "next_step")
    file.attrs["format"] = FORMAT
    header = {name: getattr(branch, name) for name in names} | {"end": branch.reason.kind.name}
    file.attrs["header"] = json.dumps(header)
    for name in _NUMBERS:
        file[name] = np.array([getattr(p, name) for p in points])
    padded = np.full((len(points), max((p.eigenvalues.size for p in points), default=0)), np.nan + 0j)
    for row, point in zip(padded, points):
        row[: point.eigenvalues.size] = point.eigenvalues
    file["eigenvalues"] = padded
    tests = file.create_group("tests")
    for number, name in enumerate(sorted({name for p in points for name in p.tests})):
        item = tests.create_dataset(str(number), data=np.array([p.tests.get(name, np.nan) for p in points]))
        item.attrs["name"] = name  # an event's own may hold a slash
    for name, array in branch.restart.items():
        file[f"restart/{name}"] = array
    group = file.create_group("special")
    for number, special in enumerate(branch.special):
        item = group.create_group(f"{number:06d}")
        values = {name: v if isinstance(v, str) else float(v) for name, v in special.values.items()}
        header = {name: getattr(special, name) for name in ("kind", "index", "mu", "located", "reason")}
        item.attrs["header"] = json.dumps(header | {"values": values})
        item["u"], item["z"], item["tangent"] = special.u, special.z, special.tangent
        for name, vector in special.vectors.items():
            item[f"vectors/{name}"] = vector


def _read_points(file) -> list[CurvePoint]:
    columns = {name: file[name][()] for name in _NUMBERS}
    tests = {item.attrs.get("name", key): item[()] for key, item in file["tests"].items()}
    points = []
    for i, values in enumerate(file["eigenvalues"][()]):
        own = {name: column[i] if column.ndim > 1 else column[i].item() for name, column in columns.items()}
        noted = {name: float(column[i]) for name, column in tests.items() if not np.isnan(column[i])}
        points.append(CurvePoint(**own, tests=noted, eigenvalues=values[~np.isnan(values.real)]))
    return points


def _read_special(item) -> SpecialPoint:
    arrays = {name: item[name][()] for name in ("u", "z", "tangent")}
    vectors = {name: vector[()] for name, vector in item.get("vectors", {}).items()}
    return SpecialPoint(**json.loads(item.attrs["header"]), **arrays, vectors=vectors)


#: Arrays and numbers of a point that files hold, one dataset each.
_NUMBERS = ("z", "tangent", "step", "iterations", "residual", "unstable")


#: Markers of special points in figures.
_MARKERS = {
    "fold": "s",
    "branch point": "D",
    "hopf": "o",
    "bogdanov-takens": "*",
    "generalised hopf": "^",
    "cusp": "v",
    "zero-hopf": "P",
}
