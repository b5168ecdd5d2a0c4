"""Base class of every table of a case file, the function that declares a key, and words for what a key allows."""

from __future__ import annotations

import typing
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self, TypeVar

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, model_serializer, model_validator
from pydantic.fields import FieldInfo

from ..texts import short_repr
from .quantity import Quantity


@dataclass(frozen=True)
class Described:
    """Marks a field of several parts.

    Parameters
    ----------
    type : str
        What it is called in the reference.
    allowed : str
        Completes "it must be ...".
    quantity : object, optional
        `dbvfiv.case.quantity.Quantity` by which its numbers are shown.
    """

    type: str
    allowed: str
    quantity: Any = None


Mark = TypeVar("Mark")


def mark_of(field: FieldInfo, kind: type[Mark]) -> Mark | None:
    """Mark of a kind on a field, or on what a list or an alternative of a union in it holds; None without one."""
    return next((m for m in field.metadata if isinstance(m, kind)), None) or _inner(field.annotation, kind)


def _inner(annotation: Any, kind: type[Mark]) -> Mark | None:
    for argument in typing.get_args(annotation):
        marks = getattr(argument, "__metadata__", ())
        found = next((m for m in marks if isinstance(m, kind)), None) or _inner(argument, kind)
        if found:
            return found
    return None


class BrokenRule(ValueError):
    """Two or more keys that do not go together.

    Parameters
    ----------
    key : str
        The key to blame, relative to the model that checks the rule.
    given, allowed : str
        Complete the sentence "KEY is GIVEN; ALLOWED".
    """

    def __init__(self, key: str, given: str, allowed: str):
        super().__init__(f"{key} is {given}; {allowed}")
        self.key, self.given, self.allowed = key, given, allowed


class Section(BaseModel):
    """A table of the case file: immutable, and closed to keys it does not know."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=False, allow_inf_nan=False, validate_default=True)
    __repr__ = short_repr
    #: Keys that say more where they are given than by their values.
    told_by_giving: ClassVar[tuple[str, ...]] = ()
    #: Keys that say nothing without another one, and that.
    needs: ClassVar[Mapping[str, str]] = {}

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        fields = type(self).model_fields
        for name, other in self.needs.items():
            value = getattr(self, name)
            if value != fields[name].default and self.is_usual(other):
                quantity = mark_of(fields[name], Quantity)
                shown = quantity.show(value) if quantity else value
                given = f"{shown:g}" if isinstance(shown, float) else str(shown)
                raise BrokenRule(name, f"{given} without {other}", "it says nothing alone, so give both or neither")
        return self

    def is_usual(self, name: str) -> bool:
        """True where a key has its default, so that those that need it say nothing."""
        return bool(getattr(self, name) == type(self).model_fields[name].default)

    @classmethod
    def make_way(cls, data: dict[str, Any], changed: Collection[tuple[str, ...]]) -> None:
        """Take out of plain data what a changed key stands in the place of, and what needs one that is taken away."""
        cls.take_along(data, changed)

    @classmethod
    def take_along(cls, data: dict[str, Any], changed: Collection[tuple[str, ...]] | None = None) -> None:
        """Take out of plain data what needs a changed key that is taken away; what needs any that is not there without
        changed ones.
        """
        for section, field in cls.model_fields.items():
            table = data.get(section)
            for name, other in getattr(field.annotation, "needs", {}).items() if isinstance(table, dict) else ():
                taken = changed is None or ((section, other) in changed and (section, name) not in changed)
                if taken and table.get(other) in (None, field.annotation.model_fields[other].default):
                    table.pop(name, None)


class FollowingSection(Section):
    """A table of which some keys hold numbers that follow from others where they are not given."""

    _following: frozenset[str] = PrivateAttr(frozenset())

    @property
    def following(self) -> frozenset[str]:
        """Keys that were not given and follow from others."""
        return self._following

    @property
    def as_given(self) -> FollowingSection:
        """The table with its numbers as the case gives them."""
        return self

    def _follows(self, name: str) -> bool:
        """True for a key that was not given; a table is checked again when it becomes part of a case."""
        return getattr(self, name) is None or name in self._following

    def _fill(self, numbers: Mapping[str, Any]) -> None:
        """Take numbers for the keys among these that were not given."""
        self._following = frozenset(filter(self._follows, numbers))
        self.__dict__.update({name: numbers[name] for name in self._following})

    @model_serializer(mode="wrap")
    def _leave_what_follows(self, handler: Any) -> dict[str, Any]:
        """Numbers as given, without those that follow, so that they follow anew after a change."""
        given = handler(self.as_given)
        return {name: None if name in self._following else value for name, value in given.items()}


def key(default: Any, description: str, **limits: Any) -> Any:
    """Declare one key: default, description and limits (``gt``, ``ge``, ``lt``, ``le``, ``min_length``).

    Type and unit come from the annotation. A default of ``...`` makes the key mandatory.
    """
    return Field(default, description=description, **limits)


def _flat(given: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in given.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", value


def flattened(given: Any) -> Any:
    """Entries of nested tables by their names with dots, for keys that hold names of other keys."""
    return dict(_flat(given)) if isinstance(given, Mapping) else given
