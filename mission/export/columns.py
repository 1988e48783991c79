"""The records of a log as rows of a table."""

import types
import typing
from dataclasses import dataclass, fields, is_dataclass
from operator import attrgetter
from typing import Any, Union

from pydantic_core import to_json

Cell = int | float | bool | str | None


@dataclass(frozen=True, slots=True)
class Column:
    """A field of a record, or of a record within it: then its name begins with that one's.

    `kind` is int, float, bool or str; lists and the like are JSON text, which `is_json` says. `path` leads to the
    field.
    """

    name: str
    kind: type
    path: tuple[str, ...]
    is_json: bool = False


def columns_of(record: type) -> tuple[Column, ...]:
    """The columns of a record type, in the order of its fields."""
    return tuple(_columns(record, ()))


class RowMaker:
    """Turns the records of one type into rows."""

    def __init__(self, columns: tuple[Column, ...]) -> None:
        self._columns = [(attrgetter(column.path[0]), column.path[1:], column.is_json) for column in columns]

    def row(self, record: object) -> list[Cell]:
        """The cells of a record, as its columns stand; None where a record within it is missing."""
        cells = []
        for first, rest, is_json in self._columns:
            value: Any = first(record)
            for name in rest:
                if value is None:
                    break
                value = getattr(value, name)
            cells.append(to_json(value).decode() if is_json and value is not None else value)
        return cells


def _columns(record: type, path: tuple[str, ...]) -> typing.Iterator[Column]:
    hints = typing.get_type_hints(record)
    for field in fields(record):
        here = (*path, field.name)
        kind = _without_none(hints[field.name])
        if is_dataclass(kind):
            yield from _columns(typing.cast("type", kind), here)
        else:
            cell = next((c for c in (bool, int, float, str) if isinstance(kind, type) and issubclass(kind, c)), None)
            yield Column("_".join(here), cell or str, here, is_json=cell is None)


def _without_none(hint: Any) -> Any:
    """X of X | None."""
    if typing.get_origin(hint) in (types.UnionType, Union):
        others = [kind for kind in typing.get_args(hint) if kind is not types.NoneType]
        return others[0] if len(others) == 1 else hint
    return hint
