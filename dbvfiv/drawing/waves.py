"""Share of a travelling wave in an oscillation along a line, and its direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Travelling shares below which a motion is a standing wave, and above which it is a travelling one.
_STANDING, _TRAVELLING = 0.1, 0.6


@dataclass(frozen=True)
class WaveContent:
    """Standing and travelling part of a harmonic motion along a line.

    Attributes
    ----------
    travelling : float
        Short over long axis of the motion in the plane of its real and imaginary shape: 0 where all points swing
        together, 1 for a pure travelling wave; the travelling index of Feeny, J. Sound Vib. 310 (2008) 77.
    towards_start : bool
        Whether what travels goes towards the first point of the line.
    """

    travelling: float
    towards_start: bool

    def words(self) -> str:
        """One clause, for a valve's line that begins at the lip."""
        share = f"travelling share {100 * self.travelling:.0f} %"
        if self.travelling < _STANDING:
            return f"{share}: a standing wave"
        way = "downstream, to the lip" if self.towards_start else "upstream, from the lip"
        kind = "a wave that travels" if self.travelling > _TRAVELLING else "partly standing, the rest travels"
        return f"{share}: {kind} {way}"


def wave_content(shape: np.ndarray, place: np.ndarray) -> WaveContent:
    """Content of the motion Re(shape exp(i w t)).

    Parameters
    ----------
    shape : (m,) complex array
    place : (m,) array
        Increasing; the points weigh by the length that belongs to them.
    """
    weight = np.sqrt(np.abs(np.gradient(place)))
    parts = np.stack([shape.real, shape.imag]) * weight
    sizes = np.linalg.svd(parts, compute_uv=False)
    travelling = float(sizes[1] / sizes[0]) if sizes[0] > 0 else 0.0
    # the phase falls against the direction of travel
    flux = np.sum((np.conj(shape) * np.gradient(shape, place)).imag * weight**2)
    return WaveContent(travelling, bool(flux > 0))
