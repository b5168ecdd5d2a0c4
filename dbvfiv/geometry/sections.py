"""Cross-sections of the mid-surface, each a curve from the centre line (x = 0) to the side edge (y = 0)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_simpson
from scipy.interpolate import make_interp_spline

from ..case.lip import LipSizes


@dataclass(frozen=True)
class Profile:
    """A section of the quarter mid-surface.

    Attributes
    ----------
    z : float
        Axial position, m.
    points : callable
        Positions (k, 2) in x and y, m, at normalised arc lengths s (k,) in 0 (centre) .. 1 (side edge).
    """

    z: float
    points: Callable[[np.ndarray], np.ndarray]


def lip_section(lip: LipSizes) -> Callable[[np.ndarray], np.ndarray]:
    """Lip: straight at y = radius up to the half width, then a quarter circle down to y = 0 (App. A); or bowed by a
    rise.
    """
    radius, bow_length, turn = lip.radius, lip.bow_length, lip.turn
    length = bow_length + lip.edge_length

    def points(s):
        arc = np.asarray(s) * length
        angle = np.clip((arc - bow_length) / radius, 0.0, 0.5 * np.pi - turn)
        if turn == 0.0:
            x = np.where(arc < bow_length, arc, bow_length + radius * np.sin(angle))
            return np.stack([x, radius * np.cos(angle)], axis=-1)
        bent = np.minimum(arc / lip.bow, turn)
        x = lip.bow * np.sin(bent) + radius * (np.sin(turn + angle) - np.sin(turn))
        y = lip.height - 2.0 * lip.bow * np.sin(0.5 * bent) ** 2 + radius * (np.cos(turn + angle) - np.cos(turn))
        return np.stack([x, y], axis=-1)

    return points


def flange_section(radius: float) -> Callable[[np.ndarray], np.ndarray]:
    """Round flange: a quarter circle (App. A)."""

    def points(s):
        angle = 0.5 * np.pi * np.asarray(s)
        return radius * np.stack([np.sin(angle), np.cos(angle)], axis=-1)

    return points


def key_point_sections(points: np.ndarray) -> list[Profile]:
    """Profiles through given key points.

    Parameters
    ----------
    points : (profiles, points, 3) array, m
        From lip to flange; each profile from the centre to the side edge at one axial position.

    Each profile is a cubic spline through its points over the chord length, evaluated at equal normalised arc length,
    as the thesis's program draws its lines (App. A).
    """
    return [
        Profile(float(np.mean(profile[:, 2])), _spline_section(profile[:, :2])) for profile in np.asarray(points, float)
    ]


def _spline_section(xy: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(xy, axis=0), axis=1))])
    curve = make_interp_spline(chord, xy, k=3)
    fine = np.linspace(0.0, chord[-1], 4001)
    speed = np.linalg.norm(curve.derivative()(fine), axis=1)
    arc = cumulative_simpson(speed, x=fine, initial=0.0)

    def points(s):
        return curve(np.interp(np.asarray(s) * arc[-1], arc, fine))

    return points
