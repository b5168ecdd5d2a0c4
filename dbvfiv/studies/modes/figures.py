"""Figures of modes: the complex plane, shapes, the swing of a centre line, the argument-principle count, animations."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from ...drawing.style import (
    COMPUTED,
    DANGER,
    REST,
    STABLE,
    UNSTABLE,
    colour_bar,
    driven,
    headline,
    log_axis,
    new_figure,
    phase_looks,
    style,
)
from ...drawing.views import COLOURS, ValveSkin, frame, mark_pieces, shaded
from ...errors import CaseError
from ...model.symmetry import symmetry_named
from ...record.vtkhdf import faces
from ..request import require_gif
from ..result import StudyResult
from .search import Certificate, ModeShape, drawn_amplitude

_RATIOS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.7)


def draw(result: StudyResult, mode: int | None = None) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of modes, each with its name; of one mode, its shape and its swing in place of those of the first ones.

    In a motion that is antisymmetric about it the line x = 0 does not swing in y and has no figure.
    """
    if result.certificate is None:
        return
    if result.modes:
        yield "eigenvalues", lambda: eigenvalues(result)
    if mode is not None:
        yield f"mode-shape-{mode}", lambda: mode_shapes(result, [result.mode(mode)])
    elif result.modes:
        yield "mode-shapes", lambda: mode_shapes(result, result.modes[:_PANELS])
    chosen = result.modes[:_DRAWN] if mode is None else [result.mode(mode)]
    for each in (mode for mode in chosen if symmetry_named(mode.symmetry).signs[0] > 0):
        yield f"centre-line-{each.number}", lambda each=each: centre_line(result, each)
    for name, certificate in result.certificates.items():
        ending = "" if symmetry_named(name).of_equilibria else f"-{name}"
        yield f"winding{ending}", lambda name=name, certificate=certificate: winding(result, name, certificate)


def eigenvalues(result: StudyResult) -> Figure:
    """Growth rate and frequency of each mode, numbered as in the table; rays of constant damping ratio; where
    eigenvalues accumulate.
    """
    figure = new_figure(7.0, 4.8)
    axes = figure.add_subplot()
    growth = np.array([mode.growth_rate for mode in result.modes])
    frequency = np.array([mode.frequency for mode in result.modes])
    width = max(np.ptp(np.append(growth, 0.0)), 1.0)
    left, right = min(growth.min(), 0.0) - 0.1 * width, max(growth.max(), 0.0) + 0.12 * width
    top = max(frequency.max() * 1.15, width / (2 * np.pi) * 0.5)
    beta = result.case.damping.beta
    if beta > 0 and left > -1.25 / beta > left - 0.6 * width:
        left = -1.25 / beta
    axes.set_xlim(left, right)
    axes.set_ylim(-0.03 * top, top)
    axes.axvspan(0.0, right, color=DANGER, lw=0)
    axes.axvline(0.0, color="0.25", lw=1.1)
    axes.text(0.99, 0.02, "unstable", transform=axes.transAxes, ha="right", va="bottom", color=UNSTABLE, fontsize=9)
    _rays(axes, left, top)
    if beta > 0 and -1.0 / beta > left:
        axes.axvline(-1.0 / beta, color="0.45", lw=1.1, ls="--")
        axes.text(
            -1.0 / beta,
            top,
            r" $-1/\beta$: eigenvalues accumulate",
            rotation=90,
            ha="right",
            va="top",
            color="0.35",
            fontsize=8.5,
        )
    for mode in result.modes:
        colour = UNSTABLE if mode.growth_rate > result.certificate.line else STABLE
        axes.plot(mode.growth_rate, mode.frequency, "o", color=colour, ms=7, clip_on=False, zorder=3)
        axes.annotate(
            str(mode.number) + class_of(mode),
            (mode.growth_rate, mode.frequency),
            (6, 5),
            textcoords="offset points",
            fontsize=9.5,
            color=colour,
        )
    axes.set_xlabel("Growth rate, 1/s")
    axes.set_ylabel("Frequency, Hz")
    axes.set_title(f"Leading modes {conditions(result)}", loc="left", fontweight="bold", pad=15)
    figure.supxlabel(textwrap.fill(result.sentence, 100), x=0.01, ha="left", fontsize=9)
    return figure


def conditions(result: StudyResult) -> str:
    """Pressure and fluid as they stand in titles."""
    where = (
        "at rest"
        if result.state.pressure == result.case.rest_pressure
        else f"at {driven(result.case, result.state.pressure)}"
    )
    case = result.case
    fluid = f"{case.fluid.density:g} kg/m³"
    if in_vacuo(result):
        fluid = "no flow" if case.outside.is_there else "in vacuo"
    return f"{where}, {fluid} {case.outside.words}".rstrip()


def in_vacuo(result: StudyResult) -> bool:
    """True where the modes are those in vacuo, without the fluid."""
    return result.case.modes.in_vacuo or result.case.drive.kind != "flow"


def mode_title(mode) -> str:
    """Number, growth rate and frequency of a mode."""
    growth = f"{mode.growth_rate:+.4g} 1/s".replace("-", "\N{MINUS SIGN}")
    name = f"Mode {mode.number}{class_of(mode)}"
    if mode.frequency == 0:
        return f"{name}: {growth}, no oscillation"
    return f"{name}: {mode.frequency:.4g} Hz, {growth}"


def class_of(mode) -> str:
    """Class of motion as it stands behind the number of a mode; nothing for that of the equilibria."""
    return "" if symmetry_named(mode.symmetry).of_equilibria else f" {mode.symmetry}"


def _rays(axes, left: float, top: float) -> None:
    """Lines on which the damping ratio is the same."""
    last = 0.0
    for ratio in _RATIOS:
        slope = np.sqrt(1 / ratio**2 - 1) / (2 * np.pi)  # frequency over -growth rate
        end = min(-left, top / slope)
        if end - last < 0.055 * -left and end < -left:
            continue  # too close to the ray before for two labels
        last = end
        axes.plot([0, -end], [0, end * slope], color="0.8", lw=0.8, zorder=1)
        outside = end * slope >= 0.999 * top
        place = (-end, top) if outside else (left, end * slope)
        offset, align = ((0, 2), ("center", "bottom")) if outside else ((3, 1), ("left", "bottom"))
        axes.annotate(
            f"{100 * ratio:g} %",
            place,
            offset,
            textcoords="offset points",
            fontsize=7.5,
            color="0.55",
            ha=align[0],
            va=align[1],
        )


_PANELS = 6


def mode_shapes(result: StudyResult, modes) -> Figure:
    """Modes at the phase of their largest displacement, the whole valve, coloured by the amplitude over a cycle."""
    columns = min(2, len(modes))
    rows = -(-len(modes) // columns)
    figure = new_figure(8.2, 5.0) if columns == 1 else new_figure(5.2 * columns, 3.2 * rows)
    skin = ValveSkin.of(result.mesh)
    scale = Normalize(0.0, 1.0)
    panels = []
    for number, mode in enumerate(modes):
        axes = figure.add_subplot(rows, columns, number + 1, projection="3d", computed_zorder=False)
        surface = ModeSurface(result, mode, skin)
        surface.draw(axes, 0.0)
        colour = UNSTABLE if mode.growth_rate > result.certificate.line else "black"
        axes.set_title(mode_title(mode), fontsize=10, color=colour, loc="left", y=0.95 if columns > 1 else 1.0)
        if columns > 1:  # small panels show the shape; the scales stand in the figure of a single mode
            axes.set_axis_off()
            axes.set_box_aspect(np.ptp(surface.limits(), axis=0), zoom=1.45)
        panels.append(axes)
    shrink = 0.62 if rows == 1 else 0.4
    label = "Amplitude, relative to the largest"
    colour_bar(figure, ScalarMappable(scale, COLOURS), panels, label, shrink=shrink, pad=0.08)
    length = 1e3 * np.ptp(result.mesh.z)
    return headline(figure, f"Mode shapes {conditions(result)}, lips at the front; the valve is {length:.0f} mm long")


class ModeSurface:
    """The valve swinging in a mode, ready to be drawn at any phase."""

    def __init__(self, result: StudyResult, mode: ModeShape, skin: ValveSkin | None = None):
        self.skin = skin or ValveSkin.of(result.mesh)
        self.mode = mode
        self.amplitude = drawn_amplitude(result.state, mode)
        self.steady = result.state.nodal
        self.parity = symmetry_named(mode.symmetry).parity(self.skin.valve.sign)
        self.colours = COLOURS(self.skin.means(mode.amplitude))

    def corners(self, phase: float) -> np.ndarray:
        """(n, 4, 3) mm, in the order axis of the valve, width, opening."""
        motion = self.amplitude * self.mode.at_phase(phase)
        return self.skin.moving_corners(self.steady, motion, self.parity)[:, :, [2, 0, 1]] * 1e3

    def limits(self) -> np.ndarray:
        """(2, 3) mm, corners of a box that holds the whole cycle."""
        quarters = np.concatenate([self.corners(phase).reshape(-1, 3) for phase in np.pi * np.arange(4) / 2])
        return np.array([quarters.min(axis=0), quarters.max(axis=0)])

    def draw(self, axes, phase: float) -> Poly3DCollection:
        """Draw at a phase, rad."""
        corners = self.corners(phase)
        colours = shaded(corners, self.colours)
        surface = Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.3, clip_on=False)
        axes.add_collection3d(surface)
        frame(axes, self.limits())
        return surface

    def move(self, surface: Poly3DCollection, phase: float) -> None:
        """Take what `draw` gave to another phase, rad."""
        corners = self.corners(phase)
        colours = shaded(corners, self.colours)
        surface.set_verts(corners)
        surface.set_facecolors(colours)
        surface.set_edgecolors(colours)


_PHASES, _DRAWN = 10, 3
#: Part of the largest swing below which a phase means nothing.
_STILL = 0.02


def centre_line(result: StudyResult, mode: ModeShape) -> Figure:
    """Inner face at x = 0 over one cycle (compare Fig. 7-16 of the thesis): its place, the swing in y, how the motion
    lags along it, and how much of it travels.
    """
    line, z = result.mesh.centre_line, result.mesh.z * 1e3
    figure = new_figure(7.4, 8.0)
    place, swing, lag = figure.subplots(3, 1, sharex=True, gridspec_kw={"height_ratios": [1.25, 1.1, 0.8]})
    amplitude = drawn_amplitude(result.state, mode)
    _draw_cycle(place, swing, result, mode, amplitude)
    motion = mode.shape[line, 1]
    lag.plot(z, _lag(motion), "o-", color=COMPUTED, ms=3)
    mark_pieces(result, place, swing, lag)
    place.set_ylabel("y, mm")
    swing.set_ylabel("Swing in y, mm")
    lag.set_ylabel("Phase in y, degrees")
    lag.set_xlabel("Distance from the lip z, mm")
    lag.set_xlim(min(0.0, float(place.dataLim.x0) - 2), z.max())
    place.set_title(f"{mode_title(mode)} ({conditions(result)})", loc="left", fontweight="bold")
    swing.set_title(
        f"drawn for a largest displacement of {1e3 * amplitude:.3g} mm; a linear mode has no amplitude of its own",
        loc="left",
        fontsize=9,
    )
    lag.set_title(_wave(mode, motion, result.mesh.z), loc="left", fontsize=9)
    place.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
    swing.legend(loc="upper left", bbox_to_anchor=(1.01, 1.05), title="share of\nthe cycle")
    for axes in (place, swing):
        axes.tick_params(labelbottom=True)
    return figure


def _draw_cycle(place, swing, result: StudyResult, mode: ModeShape, amplitude: float) -> None:
    """Inner face and swing of the line x = 0 at some phases, about the steady state."""
    mesh, steady = result.mesh, result.state.nodal
    line, z = mesh.centre_line, mesh.z * 1e3
    phases = np.arange(_PHASES) / _PHASES
    for share, look in zip(phases, phase_looks(_PHASES)):
        shape = mode.at_phase(2 * np.pi * share)
        at = 1e3 * faces(mesh, steady + amplitude * shape)[0][line]
        place.plot(at[:, 2], at[:, 1], lw=1.2, **look)
        swing.plot(z, 1e3 * amplitude * shape[line, 1], lw=1.2, label=f"{share:.1f}", **look)
    for nodal, look in (
        (None, {"color": REST, "ls": "--", "lw": 1.2, "label": "inner face\nat rest"}),
        (steady, {"color": "black", "lw": 2.0, "label": "steady state"}),
    ):
        at = 1e3 * faces(mesh, nodal)[0][line]
        place.plot(at[:, 2], at[:, 1], **look)
    place.axhline(0.0, color=REST, lw=0.8)
    envelope = 1e3 * amplitude * np.abs(mode.shape[line, 1])
    swing.fill_between(z, -envelope, envelope, color="0.5", alpha=0.13, lw=0)


def _wave(mode: ModeShape, motion: np.ndarray, z: np.ndarray) -> str:
    if mode.frequency == 0:
        return "no oscillation, so that no wave travels"
    return wave_content(motion, z).words()


def _lag(swing: np.ndarray) -> np.ndarray:
    """Phase, degrees, continuous along the line and zero where it swings most; NaN where it hardly moves."""
    size = np.abs(swing)
    if not size.max() > 0:
        return np.full(len(swing), np.nan)
    phase = np.degrees(np.unwrap(np.angle(swing)))
    phase -= phase[int(np.argmax(size))]
    return np.where(size > _STILL * size.max(), phase, np.nan)


def winding(result: StudyResult, symmetry: str, certificate: Certificate) -> Figure:
    """Winding of the determinant from zero frequency up: it ends at the number of eigenvalues to the right, and rises
    past those that are unstable; of one class of motion.
    """
    figure = new_figure(7.0, 4.4)
    axes = figure.add_subplot()
    number = certificate.unstable_count_independent
    turned = -(certificate.phase[1:] - certificate.phase[0]) / np.pi
    start = 0.5 * round(2 * (number - turned[-1]))  # half the degree of the determinant
    axes.semilogx(certificate.frequency[1:], start + turned, "o-", color=COMPUTED, ms=3.2, lw=1.3, label="winding")
    axes.axhline(number, color="0.4", lw=1.0, ls="--")
    where = "the imaginary axis" if certificate.line == 0 else f"a growth rate of {certificate.line:.3g} 1/s"
    label = f"{number} eigenvalues right of {where}"
    axes.axhline(number, color="0.4", lw=1.0, ls="--", label=label, zorder=1)
    log_axis(axes.xaxis, *certificate.frequency[[1, -1]])
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, -0.25), max(high, number + 0.1 * max(1.0, high - low)))
    which = "" if symmetry_named(symmetry).of_equilibria else f" in class {symmetry}"
    levels = _mark_modes(axes, result, symmetry, certificate)
    if np.isfinite(certificate.counted_up_to):
        right = axes.get_xlim()[1]
        axes.axvspan(certificate.counted_up_to, right, color="0.93", lw=0, zorder=0, label="not counted")
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.16), ncols=3)
    axes.set_xlabel("Frequency on the imaginary axis, Hz")
    axes.set_ylabel("Phase of the determinant, half turns")
    axes.set_title(f"Independent count{which} {conditions(result)}", loc="left", fontweight="bold", pad=6 + 11 * levels)
    verdict = f"{result.verdicts[symmetry].outcome.capitalize()} {result.law}: {certificate.statement}"
    beginning = f" The curve begins at {start:g}, half the degree of the determinant." if start else ""
    figure.supxlabel(f"{verdict}\nNumbers: modes found by the search.{beginning}", x=0.01, ha="left", fontsize=9)
    return figure


def _mark_modes(axes, result: StudyResult, symmetry: str, certificate: Certificate) -> int:
    """Lines at the frequencies of the modes, their numbers above the frame, staggered where they are close; how many
    rows of numbers that takes.
    """
    step = np.diff(np.log10(axes.get_xlim()))[0] / 35
    last, level, highest = -np.inf, 0, 0
    modes = [m for m in result.modes if m.frequency > 0 and m.symmetry == symmetry]
    for mode in sorted(modes, key=lambda m: m.frequency):
        place = np.log10(mode.frequency)
        level = (level + 1) % 4 if place - last < step else 0
        last, highest = place, max(highest, level)
        colour = UNSTABLE if mode.growth_rate > certificate.line else STABLE
        axes.axvline(mode.frequency, color=colour, lw=1.0, alpha=0.5, zorder=0)
        axes.annotate(
            str(mode.number),
            (mode.frequency, 1.0),
            (0, 2 + 11 * level),
            xycoords=axes.get_xaxis_transform(),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=9,
            color=colour,
        )
    return highest + 1


_PICTURES_A_SECOND, _DOTS = 15, 90


def animate_mode(result: StudyResult, mode: ModeShape, path: str | Path, frames: int = 24) -> Path:
    """Write one cycle of a mode, endlessly repeated, growth or decay left out; of a mode that does not oscillate, a
    slow to and fro. Raises CaseError if the file cannot be written or there are fewer than 2 frames.
    """
    path = Path(path)
    if frames < 2:
        raise CaseError(f"An animation needs at least 2 frames, not {frames}.")
    require_gif(path)
    with style():
        figure = new_figure(7.6, 4.6)
        axes = figure.add_subplot(projection="3d", computed_zorder=False)
        surface = ModeSurface(result, mode)
        collection = surface.draw(axes, 0.0)
        headline(figure, f"{mode_title(mode)} ({conditions(result)})")
        figure.set_layout_engine("none")  # the picture must not move
        axes.set_position([0.0, 0.05, 0.98, 0.9])
        writer = PillowWriter(fps=_PICTURES_A_SECOND)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with writer.saving(figure, str(path), _DOTS):
                for phase in 2 * np.pi * np.arange(frames) / frames:
                    surface.move(collection, phase)
                    writer.grab_frame()
        except OSError as error:
            raise CaseError(
                f"{str(path)!r} cannot be written ({error.strerror or 'the folder may not be written'})."
            ) from error
    return path


#: Travelling shares below which a motion is a standing wave, and above which it is a travelling one.
_STANDING, _TRAVELLING = 0.1, 0.6


@dataclass(frozen=True)
class WaveContent:
    """Standing and travelling part of a harmonic motion along a line."""

    #: Short over long axis of the motion in the plane of its real and imaginary shape: 0 where all points swing
    #: together, 1 for a pure travelling wave; the travelling index of Feeny, J. Sound Vib. 310 (2008) 77.
    travelling: float
    towards_start: bool  #: Whether what travels goes towards the first point of the line.

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
