"""``dbvfiv response``: forced response to pulsation and noise of the pressure at the inlet."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from pydantic import Field, StrictInt

from ...case.axis import RangeSection, StabilityRange
from ...case.model import Case
from ...case.parameters import listed
from ...case.quantity import Frequency, Pressure, Quantity
from ...case.section import key
from ...case.tables import ExistingFile, read_pairs
from ...errors import CaseError
from ..request import DensityOption, LawOption, PressureOption, over_option, with_unit

ORDER = 33


class Keys(RangeSection):
    """Response to the pressure at the inlet."""

    over: StabilityRange | None = key(
        None, "Values at which the response is asked: a range as in onset.over; the state of the case without it."
    )
    max_frequency: Annotated[Frequency, Field(gt=0, le=1e5)] = key(100.0, "Frequency up to which it is computed.")
    count: StrictInt = key(400, "Frequencies of the curves.", ge=16, le=100_000)
    noise: Annotated[Pressure, Field(gt=0, le=1e7)] = key(
        100.0, "Root mean square of the pressure noise, which is white up to max_frequency."
    )
    spectrum: ExistingFile | None = key(
        None,
        "CSV of frequency, Hz, and one-sided power density of the pressure, Pa2/Hz, used instead of noise; linear "
        "between rows, nothing beyond them.",
    )

    def density(self) -> list[tuple[float, float]]:
        """Frequencies and power densities of the pressure. Raises CaseError."""
        if self.spectrum is None:
            level = self.noise**2 / self.max_frequency
            return [(0.0, level), (self.max_frequency, level)]
        try:
            rows = read_pairs(self.spectrum, (Quantity("Hz"), Quantity("Pa^2/Hz")), "a frequency and a power density")
            for (before, _), (after, _) in zip(rows, rows[1:]):
                if not after > before:
                    raise ValueError(f"whose frequencies do not increase at {after:g} Hz")
            if len(rows) < 2 or min(min(row) for row in rows) < 0:
                raise ValueError("which needs two rows at least, and no number below 0")
        except ValueError as error:
            raise CaseError(
                f"response.spectrum is given as {str(self.spectrum)!r}, {error}.", key="response.spectrum"
            ) from None
        return rows


def command(
    case: Case,
    pressure: PressureOption = None,
    density: DensityOption = None,
    law: LawOption = None,
    over: Annotated[str | None, over_option(f"PARAMETER=START:STOP:COUNT of {listed()}; how an onset nears.")] = None,
    noise: Annotated[
        str | None,
        typer.Option("--noise", metavar="P", callback=with_unit, help="Root mean square of white pressure noise."),
    ] = None,
    spectrum: Annotated[
        Path | None, typer.Option("--spectrum", metavar="CSV", help="Power density of the pressure over frequency.")
    ] = None,
    max_frequency: Annotated[
        str | None, typer.Option("--max-frequency", metavar="F", help="Frequency up to which it is computed, '80 Hz'.")
    ] = None,
) -> None:
    """Lip motion, flow and pressure per pressure at the inlet over frequency (pump pulsation, vane passing), with the
    damping of their peaks, and their root mean squares under pressure noise.

    On a reduced operator that is checked on the full one; loss factors are exact in frequency. Over a range the
    variance and the correlation time rise towards the onset: what a record of the installed valve shows before it
    flutters.

    dbvfiv response cases/dbv12-in-line.toml -p "2 m" --noise "200 Pa" --plots figures
    """
    known = case.response.spectrum if spectrum is None else spectrum
    if noise is not None and known is not None:
        raise CaseError(
            f"--noise is given as {noise!r}, but the spectrum {str(known)!r} is in its place; one of them has to go."
        )
