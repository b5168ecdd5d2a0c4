"""``dbvfiv damping``, ``fit`` and ``ply``: what materials damp, and their constants from tests."""

from __future__ import annotations

import re
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import CaseError
from .terminal import AsJson, CaseFile, Override, PlotFolder, print_answer, refuse_beside, save_figures

if TYPE_CHECKING:
    from ..fit.ply import PlyFit
    from ..materials.laws import OrthotropicPly

_CONSTANTS = ("e1", "e2", "nu12", "g12", "g13", "g23")


def damping(
    case_file: CaseFile = None,
    at: Annotated[
        str | None,
        typer.Option(
            "--at", metavar="F1,F2", help="Also alpha and beta that match the loss factors at two frequencies, Hz."
        ),
    ] = None,
    plots: PlotFolder = None,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Damping of the wall: materials, fits of their loss factors with errors, damping ratio over frequency.

    dbvfiv damping my.toml --set damping.model="loss factor" --at 5,40 --plots figures
    """
    from ..drawing.materials import damping_figure
    from ..fit.cards import describe_damping, read_frequencies
    from ..studies.case import load_case

    case = load_case(case_file, overrides or ())
    frequencies = None if at is None else read_frequencies(at)
    report = describe_damping(case)
    figures = save_figures({"damping": lambda: damping_figure(report)}, plots)
    print_answer(report.summary(frequencies), lambda: report.lines(frequencies), as_json, (figures, plots))


#: Forms of the energy, constraints on the constants, the error that a fit minimises, and the load cycle fitted.
Form = StrEnum("Form", ["softening", "neo-hookean", "mooney-rivlin", "yeoh", "ogden"])
Constraint = StrEnum("Constraint", ["none", "non-negative", "stable"])
Weighting = StrEnum("Weighting", ["absolute", "relative"])
Cycle = StrEnum("Cycle", ["first", "last"])


def fit(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.csv", help="Test in tension, or several with a column test (uniaxial, planar, biaxial)."
        ),
    ],
    planar: Annotated[
        Path | None, typer.Option("--planar", metavar="FILE.csv", help="Test in planar tension (pure shear).")
    ] = None,
    biaxial: Annotated[
        Path | None, typer.Option("--biaxial", metavar="FILE.csv", help="Test in equibiaxial tension.")
    ] = None,
    law: Annotated[Form | None, typer.Option("--law", help="Form told in full; softening if not given.")] = None,
    terms: Annotated[int | None, typer.Option("--terms", help="Its number of terms.")] = None,
    constraint: Annotated[Constraint, typer.Option("--constraint", help="On the constants.")] = Constraint("none"),
    stable_to: Annotated[
        str | None, typer.Option("--stable-to", metavar="STRAIN", help='With --constraint stable: up to "30 %".')
    ] = None,
    error: Annotated[Weighting, typer.Option("--error", help="What is made small.")] = Weighting("absolute"),
    cycle: Annotated[Cycle, typer.Option("--cycle", help="Which loading, where the file has a column cycle.")] = Cycle(
        "last"
    ),
    name: Annotated[str, typer.Option("--name", help="Name of the material in the table to paste.")] = "rubber",
    density: Annotated[str, typer.Option("--density", help="Its density in the table to paste.")] = "1300 kg/m^3",
    plots: PlotFolder = None,
    as_json: AsJson = False,
) -> None:
    """Constants of a rubber from its tests: every form compared, one in full, its table for a case file.

    dbvfiv fit tension.csv --planar shear.csv --constraint stable --plots figures
    """
    from ..drawing.materials import fit_figure
    from ..fit.curves import read_tests
    from ..fit.report import describe_fits

    mass = _read_material(name, density)
    far = None if stable_to is None else _read_positive("--stable-to", stable_to, "%", "a strain greater than 0: 30 %")
    if constraint.value != "stable":
        refuse_beside({"--stable-to": stable_to}, "goes with --constraint stable alone")
    tests = read_tests(path, planar, biaxial)
    report = describe_fits(tests, law and law.value, terms, constraint.value, far, error.value, cycle.value)
    figures = save_figures({"fit": lambda: fit_figure(report)}, plots)
    print_answer(report.summary(name, mass), lambda: report.lines(name, mass), as_json, (figures, plots))


def ply(
    warp: Annotated[Path, typer.Argument(metavar="WARP.csv", help="Strip pulled along the fibre.")],
    weft: Annotated[Path, typer.Argument(metavar="WEFT.csv", help="Strip pulled across it.")],
    bias: Annotated[Path | None, typer.Option("--bias", metavar="FILE.csv", help="Strip cut at 45 degrees.")] = None,
    fraction: Annotated[str, typer.Option("--fraction", help="Volume fraction of the fibre.")] = "45 %",
    xi: Annotated[float, typer.Option("--xi", help="Halpin-Tsai coefficient along the fibre.")] = 120000.0,
    at: Annotated[
        str | None, typer.Option("--at", metavar="F1,F2,...", help="Also the ply of other fractions of the fibre.")
    ] = None,
    name: Annotated[str, typer.Option("--name", help="Name of the material in the tables to paste.")] = "ply",
    density: Annotated[str, typer.Option("--density", help="Its density in the tables to paste.")] = "1270 kg/m^3",
    plots: PlotFolder = None,
    as_json: AsJson = False,
) -> None:
    """Constants of a ply from tension along warp and weft, and of its fibre and matrix by Halpin-Tsai backwards.

    dbvfiv ply warp.csv weft.csv --fraction "45 %" --at "30 %,60 %" --plots figures
    """
    from ..drawing.materials import ply_figure
    from ..fit.ply import fit_ply, read_strip_test

    mass = _read_material(name, density)
    share = _read_fraction("--fraction", fraction)
    others = [] if at is None else [_read_fraction("--at", text) for text in at.split(",")]
    if not 0.0 < xi < float("inf"):
        raise CaseError(f"--xi is given as {xi:g}; it must be a number greater than 0.")
    strips = {"warp": warp, "weft": weft, "bias": bias}
    tests = [read_strip_test(path, direction) for direction, path in strips.items() if path is not None]
    found = fit_ply(tuple(tests), share, xi, mass)
    figures = save_figures({"ply": lambda: ply_figure(found)}, plots)
    plies = {f: found.constituents.ply(mass, f) for f in others}
    table = _ply_tables(found, name, mass)
    document = {
        "ply": _ply_values(found.ply),
        "measured": found.measured,
        "missed": found.missed,
        "constituents": vars(found.constituents),
        "residuals": {t.direction: t.residuals for t in found.tests},
        "at": [{"fibre_fraction": f} | _ply_values(made) for f, made in plies.items()],
        "toml": "\n".join(table),
    }
    print_answer(document, lambda: [*_ply_lines(found, plies), "", *table], as_json, (figures, plots))


def _read_material(name: str, density: str) -> float:
    """Density, kg/m3, of a table to paste, whose name is checked."""
    if not re.fullmatch(r"[A-Za-z0-9_-]+", name):
        raise CaseError(f"--name {name!r} must be of letters, digits, - and _, to stand in a case file.")
    return _read_positive("--density", density, "kg/m^3", "a density greater than 0: 1300 kg/m^3")


def _read_fraction(option: str, text: str) -> float:
    """A fraction between 0 and 1."""
    wanted = "a fraction greater than 0 and less than 1: 45 %"
    value = _read_positive(option, text.strip(), "%", wanted)
    if value >= 1.0:
        raise CaseError(f"{option} is given as {text.strip()!r}; it must be {wanted}.")
    return value


def _read_positive(option: str, text: str, unit: str, wanted: str) -> float:
    """A quantity in SI units, greater than 0."""
    from ..case.quantity import Quantity

    try:
        value = Quantity("" if unit == "%" else unit, unit).parse(text)
    except ValueError as error:
        raise CaseError(f"{option} is given as {text!r}, {error}; it must be {wanted}.") from None
    if not 0.0 < value < float("inf"):
        raise CaseError(f"{option} is given as {text!r}; it must be {wanted}.")
    return value


def _ply_values(ply: OrthotropicPly) -> dict[str, Any]:
    return {name: getattr(ply, name) for name in _CONSTANTS}


def _ply_text(ply: OrthotropicPly) -> str:
    values = _ply_values(ply)
    return ", ".join(f"{n} {v:.4g}" if n == "nu12" else f"{n} {v / 1e6:.5g} MPa" for n, v in values.items())


def _ply_lines(fit: PlyFit, plies: dict[float, OrthotropicPly]) -> list[str]:
    rows = []
    for test in fit.tests:
        left, top = test.residuals, abs(test.test.stress).max()
        rows.append(
            f"{test.direction}: modulus {test.modulus / 1e6:.5g} MPa from {left.size} points up to "
            f"{test.test.strain.max():.2%}, largest residual {abs(left).max() / top:.2%} of the largest stress"
        )
    rest = [n for n in _CONSTANTS if n not in fit.measured]
    rows.append(f"Ply: {_ply_text(fit.ply)}.")
    rows.append(f"Measured: {', '.join(fit.measured)}" + (f"; by Halpin-Tsai: {', '.join(rest)}." if rest else "."))
    c = fit.constituents
    rows.append(
        f"Halpin-Tsai backwards at {c.fibre_fraction:.3g} of fibre: fibre {c.fibre_modulus / 1e6:.5g} MPa, matrix "
        f"{c.matrix_modulus / 1e6:.5g} MPa, Poisson ratios {c.fibre_poisson:.3g} and {c.matrix_poisson:.3g}."
    )
    rows += [fit.missed] if fit.missed else []
    rows += [f"With {f:.3g} of fibre: {_ply_text(ply)}." for f, ply in plies.items()]
    return rows


def _ply_tables(fit: PlyFit, name: str, density: float) -> list[str]:
    """The ply as measured, and by its constituents, to paste into a case file; one of the two."""
    values, c = _ply_values(fit.ply), fit.constituents
    rows = [f"[materials.{name}]", 'kind = "orthotropic"']
    rows += [f"{n} = {v:.12g}" if n == "nu12" else f'{n} = "{v / 1e6:.12g} MPa"' for n, v in values.items()]
    rows += [f'density = "{density:g} kg/m^3"', "", "# or, to vary the fraction of the fibre:"]
    rows += [f"# [materials.{name}]", '# kind = "halpin-tsai"', f"# fibre_fraction = {c.fibre_fraction:.12g}"]
    rows += [f'# {n} = "{getattr(c, n) / 1e6:.12g} MPa"' for n in ("fibre_modulus", "matrix_modulus")]
    rows += [f"# {n} = {getattr(c, n):.12g}" for n in ("fibre_poisson", "matrix_poisson", "xi")]
    return [*rows, f'# density = "{density:g} kg/m^3"']
