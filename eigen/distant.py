"""Unstable pairs that a search has passed by, where an independent count says that there are some: beyond its band, or
on the real axis far from its shifts.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .condensation import Workspace
from .dense import all_pairs
from .options import SearchOptions
from .pairs import SAME, Found, normalised
from .pencil import CoupledPencil
from .residual import acceptable, newton
from .spectrum import Spectrum
from .transfer import TransferBasis

#: Pairs beyond the band that are looked for at most, and real ones.
MOST = 4
#: Newton steps at most; what lies beyond the band is known roughly.
STEPS = 8


def distant_pairs(
    pencil: CoupledPencil,
    spectrum: Spectrum,
    basis: TransferBasis | None,
    line: float,
    options: SearchOptions,
) -> Found | None:
    """Unstable pairs of the full pencil near those that the pencil on a basis has beyond the band of a spectrum, if
    that was not asked for, and on the real axis, which every band holds; without a basis those of a small pencil.

    Each is brought to the full pencil by Newton steps and has to pass the residual test like any other, however far it
    moves on the way: a basis may know it roughly. The fastest growing ones are tried.

    Parameters
    ----------
    line : float
        Growth rate above which a pair counts as unstable, 1/s.

    Returns
    -------
    Found or None
        None if left vectors are wanted as well, or none was found.
    """
    if spectrum.left_q is not None:
        return None
    values, q, u, _, _ = all_pairs(pencil if basis is None else basis.reduced(pencil), left=False)
    unstable = np.flatnonzero(values.real > line)
    unstable = unstable[np.argsort(-values.real[unstable])]
    chosen = list(unstable[values.imag[unstable] == 0][:MOST])
    if options.max_frequency is None:
        chosen += list(unstable[values.imag[unstable] > 2 * np.pi * spectrum.band][:MOST])
    starts = [(values[i], q[:, i] if basis is None else basis.lift(q[:, i]), u[:, i]) for i in chosen]
    workspace = Workspace()
    pairs = []
    for start in starts:
        pair = newton(pencil, *start, workspace=workspace, tolerance=options.tolerance, steps=STEPS)
        value, _, _, residual, backward = pair
        known = [abs(value - x) <= SAME * abs(x) for x in (*spectrum.eigenvalues, *(other[0] for other in pairs))]
        if value.real > line and acceptable(residual, backward, options.tolerance) and not any(known):
            pairs.append(pair)
    if not pairs:
        return None
    values, q, u, residual, backward = (np.stack(part, axis=-1) for part in zip(*pairs))
    return Found(values, *normalised(q, u), residual, backward)


def joined(spectrum: Spectrum, found: Found, line: float) -> Spectrum:
    """The spectrum with further unstable pairs, sorted; as long as was asked for, if not more are unstable."""
    new = {
        "eigenvalues": found.values,
        "q": found.q,
        "u": found.u,
        "residual": found.residual,
        "backward_error": found.backward,
    }
    parts = {name: np.concatenate([getattr(spectrum, name), part], axis=-1) for name, part in new.items()}
    order = np.lexsort((parts["eigenvalues"].imag, -parts["eigenvalues"].real))
    order = order[: max(spectrum.asked, int(np.sum(parts["eigenvalues"].real > line)))]
    real = found.values.imag == 0
    notes = []
    if real.any():
        rates = ", ".join(f"{value.real:.4g}" for value in found.values[real])
        notes.append(
            f"Motions that grow by {rates} 1/s without oscillating lie far from where modes are searched for; the "
            f"independent count pointed to them."
        )
    if not real.all():
        frequencies = ", ".join(f"{value.imag / (2 * np.pi):.4g}" for value in found.values[~real])
        notes.append(
            f"Unstable modes at {frequencies} Hz lie beyond the band up to {spectrum.band:.4g} Hz in which the list is "
            f"complete; the independent count pointed to them."
        )
    return replace(
        spectrum,
        **{name: part[..., order] for name, part in parts.items()},
        refined=spectrum.refined + found.values.size,
        notes=(*spectrum.notes, *notes),
    )
