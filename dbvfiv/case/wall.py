"""The wall: pieces of given thickness along the axis, and patches on them."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator

from .extent import Extent
from .quantity import Length
from .section import BrokenRule, Section, key


class WallStep(Section):
    """One piece of the measured wall."""

    to: Length = key(..., "End of the piece, measured along the axis from the lip.", gt=0, le=100)
    thickness: Length = key(..., "Wall thickness of the piece.", gt=0, le=10)

    def enlarged(self, factor: float) -> WallStep:
        """Copy with all lengths multiplied by a factor."""
        return self.model_copy(update={"to": factor * self.to, "thickness": factor * self.thickness})


class WallPatch(Extent):
    """A part of the wall that is thicker or thinner than its surroundings: a side edge, an overlap, a pad."""

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

    def enlarged(self, factor: float) -> Self:
        """Copy with all lengths multiplied by a factor."""
        sizes = {name: getattr(self, name) for name in ("thickness", "extra")}
        larger = {name: factor * size for name, size in sizes.items() if size is not None}
        return super().enlarged(factor).model_copy(update=larger)
