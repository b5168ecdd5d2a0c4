"""The wall: pieces of given thickness along the axis, and patches of limited extent on them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, Self

from pydantic import model_validator

from .quantity import Length, Number
from .section import BrokenRule, Section, key


def multiplied(section: Section, names: Sequence[str], factor: float) -> dict[str, float]:
    """Sizes of a table, as far as they are given, times a factor."""
    sizes = {name: getattr(section, name) for name in names}
    return {name: factor * size for name, size in sizes.items() if size is not None}


class _Piece(Section):
    """A piece of the wall with lengths."""

    _lengths: ClassVar[tuple[str, ...]]

    def enlarged(self, factor: float) -> Self:
        """Copy with all lengths multiplied by a factor."""
        return self.model_copy(update=multiplied(self, self._lengths, factor))


class Extent(_Piece):
    """A part of the wall; all of it where nothing is given."""

    _lengths = ("begin", "end")
    begin: Length | None = key(
        None, "Axial position at which it begins, from the lip; the lip where not given.", ge=0, le=100
    )
    end: Length | None = key(
        None, "Axial position at which it ends; the inlet end of the valve where not given.", gt=0, le=100
    )
    around_from: Number | None = key(
        None,
        "Share of the section's length, from the centre (0) to the side edge (1), at which it begins; 0 where not "
        "given.",
        ge=0,
        lt=1,
    )
    around_to: Number | None = key(
        None, "Share of the section's length at which it ends; 1 where not given.", gt=0, le=1
    )

    @model_validator(mode="after")
    def _has_an_inside(self) -> Self:
        if self.begin is not None and self.end is not None and self.end <= self.begin:
            raise BrokenRule("end", f"{self.end:g} m", f"it must lie behind begin = {self.begin:g} m")
        if self.around_from is not None and self.around_to is not None and self.around_to <= self.around_from:
            raise BrokenRule(
                "around_to", f"{self.around_to:g}", f"it must be greater than around_from = {self.around_from:g}"
            )
        return self

    @property
    def is_limited(self) -> bool:
        """True where the region leaves out any part of the wall."""
        return any(x is not None for x in (self.begin, self.end, self.around_from, self.around_to))

    @property
    def axial_edges(self) -> tuple[float, ...]:
        """Axial positions at which it begins and ends, m."""
        return tuple(z for z in (self.begin, self.end) if z is not None)

    @property
    def section_edges(self) -> tuple[float, ...]:
        """Shares of the section at which it begins and ends."""
        return tuple(s for s in (self.around_from, self.around_to) if s is not None)

    def covers(self, z: float, s: float) -> bool:
        """True where the point at axial position z, m, and share s of the section's length lies in the region."""
        along = (self.begin or 0.0) <= z and (self.end is None or z < self.end)
        end = 2.0 if self.around_to in (None, 1.0) else self.around_to
        around = (self.around_from or 0.0) <= s < end
        return along and around


def edges_of(parts: Sequence[Extent], name: str, length: float) -> tuple[set[float], set[float]]:
    """Axial positions, m, and shares of the section at which parts of a wall of this length begin or end, 0 among them.
    Raises BrokenRule for a part beyond the end of the valve; `name` is the key of the list.
    """
    along, around = {0.0}, {0.0}
    for i, part in enumerate(parts):
        for end in ("begin", "end"):
            place = getattr(part, end)
            if place is not None and (place > length * (1 + 1e-9) or (end == "begin" and place >= length)):
                raise BrokenRule(f"{name}.{i}.{end}", f"{place:g} m", f"the valve ends at {length:g} m")
        along |= set(part.axial_edges)
        around |= set(part.section_edges)
    return along, around


class WallStep(_Piece):
    """One piece of the measured wall."""

    _lengths = ("to", "thickness")
    to: Length = key(..., "End of the piece, measured along the axis from the lip.", gt=0, le=100)
    thickness: Length = key(..., "Wall thickness of the piece.", gt=0, le=10)


class WallPatch(Extent):
    """A part of the wall that is thicker or thinner than its surroundings: a side edge, an overlap, a pad."""

    _lengths = ("begin", "end", "thickness", "extra")
    thickness: Length | None = key(None, "Wall thickness there, in place of what the wall has.", gt=0, le=10)
    extra: Length | None = key(None, "Thickness added to what the wall has there; negative takes off.", ge=-10, le=10)

    @model_validator(mode="after")
    def _one_of_two(self) -> WallPatch:
        if (self.thickness is None) == (self.extra is None):
            given = "missing" if self.thickness is None else f"{self.thickness:g} m beside extra"
            raise BrokenRule("thickness", given, "a patch has either a thickness or an extra thickness")
        return self

    def on(self, thickness: float) -> float:
        """Thickness of the wall there, m, where it would have another one."""
        return self.thickness if self.thickness is not None else thickness + self.extra
