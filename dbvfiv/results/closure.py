"""Back-pressure states: the result, in memory or in a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from ..record.files import reading
from ..record.header import Header, read_header
from ..record.layout import Table, read_texts
from ..record.mesh import MeshData, read_mesh
from ..record.result import Result
from ..record.states import LAYERS
from ..shell.recovery import LayerFields, layer_fields
from .closure_table import BUCKLING, FIELDS, HEAD, OPENED, PATH, REVERSAL, SUMMARY, row_of

if TYPE_CHECKING:
    from ..model.state import SteadyState
    from ..record.vtkhdf import Step
    from ..record.whole_valve import WholeValve
    from ..studies.closing import ClosingResult
    from ..studies.closure import ClosureResult
    from ..studies.closure_buckling import Buckling
    from ..studies.closure_model import ClosureModel
    from ..studies.closure_path import PathPoint
    from ..studies.closure_state import ClosureState

QUARTERS = 4


class PressedState:
    """A state under back pressure; its attributes are the columns of `closure_table.SUMMARY` and `FIELDS`, see
    `dbvfiv.studies.closure_state.ClosureState`.

    Attributes
    ----------
    nodal : (nn, 5) array, m and rad
    results : ClosureResults
    """

    def __init__(self, results: ClosureResults, values: Mapping[str, Any], read_layers: Callable[[], LayerFields]):
        vars(self).update(values)
        self.results = results
        self._read_layers = read_layers

    @cached_property
    def layers(self) -> LayerFields:
        """Strains and stresses of the layers."""
        return self._read_layers()

    @property
    def sealed_intervals(self) -> list[list[float]]:
        """Intervals along the axis, m, on which the valve is shut."""
        from ..studies.closure_opening import Opening

        results = self.results
        passage = Opening(results.mesh.z, self.opening, results.reference_opening / QUARTERS, self.gap, self.gap)
        return [list(pair) for pair in passage.shut_intervals(results.case.closure.shut_fraction)]

    @property
    def layer_extremes(self) -> list[dict[str, Any]]:
        """Largest elongation or shortening and largest von Mises stress (Pa) of each layer, inside to outside."""
        stretch, stress = self.layers.stretch, self.layers.von_mises
        strain = np.maximum(stretch[:, :, 1] - 1, 1 - stretch[:, :, 0]).max(axis=0)
        return [
            {"layer": title, "largest_strain": float(e), "largest_stress": float(s)}
            for title, e, s in zip(self.results.mesh.layer_titles(), strain, stress.max(axis=0))
        ]

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        found = {c.name: _plain(getattr(self, c.name)) for c in SUMMARY}
        return found | {
            "sealed_intervals": self.sealed_intervals,
            "stiffness_eigenvalues": _plain(self.stiffness_eigenvalues),
            "layers": self.layer_extremes,
        }


class ClosureResults(Result):
    """States under back pressure in the order they were found, with the path that led to them.

    Attributes
    ----------
    states : tuple of PressedState
    path, buckling, opened : tuples of objects with the columns of `closure_table.PATH`, `BUCKLING`, `OPENED`
    closing : dbvfiv.studies.closing.ClosingResult or None
        History of the valve while its drive turned round, where that was asked for.
    supports : str
        "contact" or "held-lips".
    reference_opening : float, m2
        Passage between the inner faces of the lip at rest, whole valve.
    """

    kind = "closure"

    def __init__(
        self,
        header,
        mesh,
        rows,
        read_layers,
        path_rows,
        buckling_rows,
        opened_rows,
        supports,
        reference_opening,
        closing=None,
        **common,
    ):
        super().__init__(header, mesh, **common)
        self.states = tuple(PressedState(self, row, lambda i=i: read_layers(i)) for i, row in enumerate(rows))
        self.walk = tuple(SimpleNamespace(**row) for row in path_rows)
        self.buckling = tuple(SimpleNamespace(**row) for row in buckling_rows)
        self.opened = tuple(SimpleNamespace(**row) for row in opened_rows)
        self.closing = closing
        self.supports = supports
        self.reference_opening = float(reference_opening)

    @classmethod
    def of(
        cls, result: ClosureResult, header: Header | None = None, closing: ClosingResult | None = None
    ) -> ClosureResults:
        """From a run that has just ended, and the turn of the drive if that was followed."""
        model = result.model
        header = header or Header.of("closure", model.case)
        return cls(
            replace(header, complete=not (result.interrupted or (closing is not None and closing.interrupted))),
            MeshData.of(model),
            [row_from(model, state) for state in result.states],
            lambda i: layer_fields(model.shell, result.states[i].q),
            path_rows(result.path),
            buckling_rows(model, result.buckling),
            opened_rows(result.opened),
            model.supports,
            reference_opening(model),
            closing=closing,
            warnings=result.warnings,
            failures=result.failures,
            model=model,
        )

    @classmethod
    def read(cls, file: h5py.File, path: Path) -> ClosureResults:
        names = tuple(file["mesh/layer_names"].asstr()[:])

        def read_layers(row: int) -> LayerFields:
            with reading(path) as again:
                layers = Table(again["states"], LAYERS)
                return LayerFields(names, **{c.name.split("/")[1]: layers.read(c.name, row) for c in LAYERS})

        return cls(
            read_header(file),
            read_mesh(file),
            _rows(file["states"], (*SUMMARY, *FIELDS)),
            read_layers,
            _rows(file["path"], PATH),
            _rows(file["buckling"], BUCKLING),
            _rows(file["opened"], OPENED),
            str(file.attrs["supports"]),
            float(file.attrs["reference_opening"]),
            _read_closing(file),
            warnings=read_texts(file, "messages/warnings"),
            failures=read_texts(file, "messages/failures"),
            path=path,
        )

    @cached_property
    def model(self) -> ClosureModel:
        """The model under back pressure; rebuilt on first use if the result comes from a file."""
        from ..studies.closure_model import closure_model

        return closure_model(self.header.rebuildable_case())

    def save(self, path: str | Path) -> Path:
        from .closure_file import ClosureFile

        with ClosureFile(path, self.model, self.header) as file:
            for state in self.states:
                values = {c.name: getattr(state, c.name) for c in (*SUMMARY, *FIELDS)}
                file.keep(values, state.layers)
            rows = ([vars(row) for row in rows] for rows in (self.walk, self.buckling, self.opened))
            file.finish(*rows, self.warnings, self.failures, self.complete)
            if self.closing is not None:
                file.keep_closing(self.closing)
        return Path(path)

    def nearest(self, pressure: float) -> PressedState:
        """State at the pressure closest to a given one, Pa."""
        return min(self.states, key=lambda state: abs(state.pressure - pressure))

    @property
    def critical_pressure(self) -> float | None:
        """Lowest back pressure at which the wall buckles on the path followed, Pa; None if it does not."""
        return self.buckling[0].pressure if self.buckling else None

    @property
    def closing_pressure(self) -> float | None:
        """Lowest pressure on the path, Pa, at which some section was shut; None if none was."""
        shut = [point.pressure for point in self.walk if point.sealed_length > 0]
        return min(shut) if shut else None

    def summary(self) -> dict[str, Any]:
        followed = [point for point in self.walk if np.isfinite(point.lowest_eigenvalue)]
        softest = min(followed, key=lambda point: point.lowest_eigenvalue, default=None)
        first = self.buckling[0] if self.buckling else None
        return {
            "supports": self.supports,
            "points": [state.summary() for state in self.states],
            "closing_pressure": self.closing_pressure,
            "buckling": [{"kind": b.kind, "pressure": b.pressure, "eigenvalue": b.eigenvalue} for b in self.buckling],
            "critical_pressure": first.pressure if first else None,
            "softest": {"pressure": softest.pressure, "lowest_stiffness_eigenvalue": softest.lowest_eigenvalue}
            if softest
            else None,
            "path": {c.name: [_plain(getattr(point, c.name)) for point in self.walk] for c in PATH},
            "opened": [vars(point) for point in self.opened],
            "reversal": None if self.closing is None else self.closing.summary(),
            "reference_opening": self.reference_opening,
            "failures": list(self.failures),
            "warnings": list(self.warnings),
            "interrupted": not self.complete,
        }

    def lines(self) -> list[str]:
        return [*HEAD, *(row_of(state) for state in self.states), *self.verdict()]

    def verdict(self) -> list[str]:
        """Sentences on the balances, on buckling and on the turn of the drive."""
        return [*self._balance_verdict(), *self._buckling_verdict(), *self._closing_verdict()]

    def _balance_verdict(self) -> list[str]:
        if not self.states:
            return []
        force, energy = (
            max(getattr(state, name) for state in self.states) for name in ("force_balance", "energy_balance")
        )
        return [f"Forces balance to {force:.1g} of their sizes, work and energies to {energy:.1g} of the work."]

    def _closing_verdict(self) -> list[str]:
        if self.closing is None:
            return []
        told = self.closing.summary()
        turn = (
            f"Drive turned from {told['open_pressure'] / 1e3:g} to {-told['open_pressure'] / 1e3:g} kPa "
            f"in {told['reversal_time']:g} s:"
        )
        if told["closing_time"] is None:
            return [f"{turn} open at the end, {told['duration']:.4g} s."]
        return [
            f"{turn} shut for good {told['closing_time']:.4g} s after it began to turn "
            f"({told['closing_time_after_sign_change']:.4g} s after it changed "
            f"sign), fluid pressure between {told['lowest_pressure'] / 1e3:.4g} and "
            f"{told['highest_pressure'] / 1e3:.4g} kPa."
        ]

    def _buckling_verdict(self) -> list[str]:
        if self.buckling:
            return [f"Buckling ({b.kind}) at {b.pressure / 1e3:.6g} kPa." for b in self.buckling[:3]]
        followed = [point for point in self.walk if np.isfinite(point.lowest_eigenvalue)]
        if not followed:
            return []
        softest = min(followed, key=lambda point: point.lowest_eigenvalue)
        return [
            f"No buckling within the symmetry of the model up to "
            f"{max(p.pressure for p in followed) / 1e3:.4g} kPa; the stiffness is least at "
            f"{softest.pressure / 1e3:.4g} kPa, "
            f"{softest.lowest_eigenvalue / followed[0].lowest_eigenvalue:.0%} of that at the start."
        ]

    def steps(self, valve: WholeValve) -> Sequence[Step]:
        from .closure_export import closure_steps

        return closure_steps(self, valve)


def row_from(model: ClosureModel, state: ClosureState) -> dict[str, Any]:
    """Columns of a state of a model."""
    row = {c.name: getattr(state, c.name) for c in (*SUMMARY, *FIELDS) if c.name != "nodal"}
    return row | {"nodal": model.pressed.nodal(state.q)}


def path_rows(points: Sequence[PathPoint]) -> list[dict[str, Any]]:
    names = [c.name for c in PATH if c.name != "lowest_eigenvalue"]
    return [
        {name: getattr(point, name) for name in names}
        | {"lowest_eigenvalue": float(point.eigenvalues[0]) if len(point.eigenvalues) else np.nan}
        for point in points
    ]


def buckling_rows(model: ClosureModel, found: Sequence[Buckling]) -> list[dict[str, Any]]:
    nodal = model.pressed.nodal
    return [
        {
            "pressure": b.pressure,
            "kind": b.kind,
            "eigenvalue": b.eigenvalue,
            "nodal": nodal(b.q),
            "shape": nodal(b.shape),
        }
        for b in found
    ]


def opened_rows(states: Sequence[SteadyState]) -> list[dict[str, Any]]:
    return [{c.name: getattr(state, c.name) for c in OPENED} for state in states]


def reference_opening(model: ClosureModel) -> float:
    """Passage between the inner faces of the lip at rest, whole valve, m2."""
    from ..studies.closure_opening import opening

    return QUARTERS * opening(model, model.pressed.rest()).reference


def _rows(group: h5py.Group, columns) -> list[dict[str, Any]]:
    table = Table(group, columns)
    data = {c.name: table.read(c.name) for c in columns}
    return [{name: _scalar(values[i]) for name, values in data.items()} for i in range(table.rows)]


def _read_closing(file: h5py.File) -> ClosingResult | None:
    if "reversal" not in file:
        return None
    from ..studies.closing import ClosingResult, ClosingSample, Turn

    group = file["reversal"]
    facts = dict(group.attrs)
    samples = tuple(ClosingSample(**row) for row in _rows(group, REVERSAL))
    turn = Turn(*(float(facts[name]) for name in ("open_pressure", "turn_start", "turn_duration")))
    return ClosingResult(
        samples,
        turn,
        float(facts["shut_below"]),
        int(facts["halvings"]),
        str(facts["failure"]),
        bool(facts["interrupted"]),
    )


def _scalar(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return tuple(value.tolist()) if value.shape == (3,) else value
    return value.item() if isinstance(value, np.generic) else value


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    return list(value) if isinstance(value, tuple) else value
