"""``dbvfiv steady``: equilibria over a list of pressures."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

import typer

from ...case.axis import parse_axis
from ...case.quantity import number_or_text
from ...errors import CaseError
from ..case import Case
from ..request import Request, with_unit

ORDER = 20

Pressures = Annotated[
    list[str] | None,
    typer.Option(
        "--pressure",
        "-p",
        metavar="P",
        callback=with_unit,
        help="Static inlet pressure, '36 kPa', '2 m' or '6 ft' (head of the fluid), '2 mH2O', or a range "
        "'2 kPa:50 kPa:12'; may be repeated.",
    ),
]


def command(case: Case, pressures: Pressures = None) -> Request:
    """Equilibria of the coupled valve: flow, lip area, jet velocity, deflections, layer stresses.

    The pressures are those of --pressure; else steady.pressures of the case, or its drive.pressure where only that is
    given, with --set for instance; else, with a pump, the operating point. Each state is found from the one before.

    Nothing is written unless asked for: -o keeps states, stations and layer stresses in a result file (an earlier
    result of that name is replaced), state by state, so that Ctrl-C keeps what is done and `dbvfiv resume` goes on.
    `dbvfiv plot`, `export` and `info` read it.

    dbvfiv steady cases/dbv12.toml -p "18 kPa" -p "36 kPa" -o dbv12.h5
    """
    if not pressures and case.meets_pump("steady"):
        return Request()
    return Request(
        {"steady.pressures": list(_read(pressures, case.fluid.density) if pressures else case.steady_pressures())}
    )


def _read(texts: Iterable[str], density: float) -> Iterable[float | str]:
    for text in texts:
        if ":" in text:
            yield from _range(text, density)
        else:
            yield number_or_text(text)


def _range(text: str, density: float) -> tuple[float, ...]:
    try:
        return parse_axis(f"pressure={text}", density=density).values
    except ValueError as error:
        raise CaseError(
            f"--pressure is given as {text!r}, {error}; a range is START:STOP:COUNT, with ':log' behind it for "
            f"logarithmic steps."
        ) from None
