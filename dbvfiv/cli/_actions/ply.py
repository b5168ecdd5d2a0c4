"""Constants of a ply from its tests, in print and as a figure."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...drawing.files import draw_figures, write_figures
from ...drawing.ply import ply_figure
from ...errors import CaseError
from ...materials.orthotropic import OrthotropicPly
from ...materials.ply_fit import PlyFit, fit_ply, read_strip_test
from .._output import print_json, print_places
from .material import fraction_of, of_material

_CONSTANTS = ("e1", "e2", "nu12", "g12", "g13", "g23")


def tell(
    paths: tuple[Path, Path, Path | None],
    how: tuple[str, float, str | None],
    material: tuple[str, str],
    plots: Path | None,
    as_json: bool,
) -> None:
    """Print and draw what the tests give.

    Parameters
    ----------
    paths : of the strips along warp, weft and at 45 degrees
    how : fraction of the fibre, xi, other fractions, as given
    material : name and density for the tables to paste
    plots : folder for the figure, or None
    as_json : bool

    Raises
    ------
    CaseError
    """
    name, density = of_material(*material)
    fraction = fraction_of("--fraction", how[0])
    others = [] if how[2] is None else [fraction_of("--at", text) for text in how[2].split(",")]
    if not 0.0 < how[1] < float("inf"):
        raise CaseError(f"--xi is given as {how[1]:g}; it must be a number greater than 0.")
    tests = [
        read_strip_test(path, direction) for path, direction in zip(paths, ("warp", "weft", "bias")) if path is not None
    ]
    fit = fit_ply(tuple(tests), fraction, how[1], density)
    figures = []
    if plots is not None:
        figures = write_figures(draw_figures({"ply": lambda: ply_figure(fit)}, (), "ply"), plots)
    plies = {f: fit.constituents.ply(density, f) for f in others}
    table = _tables(fit, name, density)
    if as_json:
        print_json(
            {
                "ply": _values(fit.ply),
                "measured": fit.measured,
                "constituents": vars(fit.constituents),
                "residuals": {t.direction: t.residuals for t in fit.tests},
                "at": [{"fibre_fraction": f} | _values(ply) for f, ply in plies.items()],
                "toml": "\n".join(table),
                "figures": [str(figure) for figure in figures],
            }
        )
        return
    print("\n".join([*_lines(fit, plies), "", *table]))
    print_places(None, figures, plots)


def _values(ply: OrthotropicPly) -> dict[str, Any]:
    return {name: getattr(ply, name) for name in _CONSTANTS}


def _told(ply: OrthotropicPly) -> str:
    values = _values(ply)
    return ", ".join(f"{n} {v:.4g}" if n == "nu12" else f"{n} {v / 1e6:.5g} MPa" for n, v in values.items())


def _lines(fit: PlyFit, plies: dict[float, OrthotropicPly]) -> list[str]:
    rows = []
    for test in fit.tests:
        left, top = test.residuals, abs(test.test.stress).max()
        rows.append(
            f"{test.direction}: modulus {test.modulus / 1e6:.5g} MPa from {left.size} points up to "
            f"{test.test.strain.max():.2%}, largest residual {abs(left).max() / top:.2%} of the largest stress"
        )
    rest = [n for n in _CONSTANTS if n not in fit.measured]
    rows.append(f"Ply: {_told(fit.ply)}.")
    rows.append(f"Measured: {', '.join(fit.measured)}" + (f"; by Halpin-Tsai: {', '.join(rest)}." if rest else "."))
    c = fit.constituents
    rows.append(
        f"Halpin-Tsai backwards at {c.fibre_fraction:.3g} of fibre: fibre {c.fibre_modulus / 1e6:.5g} MPa, matrix "
        f"{c.matrix_modulus / 1e6:.5g} MPa, Poisson ratios {c.fibre_poisson:.3g} and {c.matrix_poisson:.3g}."
    )
    rows += [f"With {f:.3g} of fibre: {_told(ply)}." for f, ply in plies.items()]
    return rows


def _tables(fit: PlyFit, name: str, density: float) -> list[str]:
    """The ply as measured, and by its constituents, to paste into a case file; one of the two."""
    values, c = _values(fit.ply), fit.constituents
    rows = [f"[materials.{name}]", 'kind = "orthotropic"']
    rows += [f"{n} = {v:.12g}" if n == "nu12" else f'{n} = "{v / 1e6:.12g} MPa"' for n, v in values.items()]
    rows += [f'density = "{density:g} kg/m^3"', "", "# or, to vary the fraction of the fibre:"]
    rows += [f"# [materials.{name}]", '# kind = "halpin-tsai"', f"# fibre_fraction = {c.fibre_fraction:.12g}"]
    rows += [f'# {n} = "{getattr(c, n) / 1e6:.12g} MPa"' for n in ("fibre_modulus", "matrix_modulus")]
    rows += [f"# {n} = {getattr(c, n):.12g}" for n in ("fibre_poisson", "matrix_poisson", "xi")]
    return [*rows, f'# density = "{density:g} kg/m^3"']
