"""Elements of a polygon file (.ply): rows of numbers and of lists of numbers, in bytes or in text."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from uavexp.arrays import Float, Int
from uavexp.errors import WorldError


@dataclass(frozen=True, slots=True)
class Property:
    """A column of an element: a number a row, or a list of numbers with its length before it."""

    name: str
    type: str  # of its numbers, numpy's name without byte order
    count_type: str | None = None  # of a list's length


@dataclass(slots=True)
class Element:
    """So many rows of the same properties."""

    name: str
    rows: int
    properties: list[Property] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Body:
    """What follows the header: bytes, or the numbers of a text; a place is an index of it."""

    values: npt.NDArray[Any]
    order: str  # of bytes; none: text

    def width(self, type_: str | None) -> int:
        """Places that a number takes."""
        if type_ is None:
            return 0
        return np.dtype(type_).itemsize if self.order else 1

    def at(self, type_: str) -> npt.NDArray[Any]:
        """Array whose item p is the number that begins at place p."""
        if not self.order:
            return self.values
        dtype = np.dtype(self.order + type_)
        size = max(self.values.size - dtype.itemsize + 1, 0)
        return np.ndarray((size,), dtype, self.values.data if size else b"", strides=(1,))


@dataclass(frozen=True, slots=True)
class Column:
    """Numbers of a property, row after row, and how many in each row (none: one)."""

    values: Float
    counts: Int | None = None


Table = tuple[dict[str, Column], int]  # columns by their names, and the place where the last row ends


def columns(path: Path, body: Body, element: Element, place: int, wanted: Container[str]) -> Table:
    """Return the wanted columns of an element whose first row begins at a place.

    Raises:
        WorldError: the body ends before the last row.
    """
    least = sum(body.width(item.count_type or item.type) for item in element.properties)
    left = body.values.size - place
    if element.rows * least > left:
        raise _truncated(path, element, max(left, 0) // least)
    if element.rows == 0 or least == 0:
        none = Column(np.empty(0), np.empty(0, dtype=np.int64))
        return dict.fromkeys((item.name for item in element.properties), none), place
    return _alike(body, element, place, wanted) or _one_by_one(path, body, element, place, wanted)


def _alike(body: Body, element: Element, place: int, wanted: Container[str]) -> Table | None:
    """Columns of rows whose lists are all as long as those of the first row; None when they are not."""
    layout: list[tuple[Property, int, int]] = []  # place of its length or only number, and how many
    begin = place
    for item in element.properties:
        count = _count(body, item, begin)
        if count < 0:
            return None
        layout.append((item, begin, count))
        begin += body.width(item.count_type) + count * body.width(item.type)
    row, rows = begin - place, element.rows
    if rows * row > body.values.size - place:
        return None
    table = {}
    for item, first, count in layout:
        width = body.width(item.type)
        if item.count_type is None:
            if item.name in wanted:
                table[item.name] = Column(body.at(item.type)[first::row][:rows].astype(np.float64))
        elif (body.at(item.count_type)[first::row][:rows] != count).any():
            return None
        elif item.name in wanted:
            first += body.width(item.count_type)
            places = first + row * np.arange(rows)[:, None] + width * np.arange(count)
            values = body.at(item.type)[places.reshape(-1)].astype(np.float64)
            table[item.name] = Column(values, np.full(rows, count))
    return table, place + rows * row


def _one_by_one(path: Path, body: Body, element: Element, place: int, wanted: Container[str]) -> Table:
    """Columns of rows whose lists differ in length."""
    size = body.values.size
    steps: list[tuple[Any, int, int, list[int], list[int]]] = []  # lengths, widths, what was found
    for item in element.properties:
        lengths: Any = body.at(item.count_type) if item.count_type else None
        if lengths is not None and lengths.flags.aligned:  # bytes, or the numbers of a text
            lengths = memoryview(lengths)  # whose items are Python's own numbers, ten times as fast
        steps.append((lengths, body.width(item.count_type), body.width(item.type), [], []))
    for row in range(element.rows):
        for lengths, count_width, width, first, counts in steps:
            count = 1
            if lengths is not None:
                length = lengths[place] if place < len(lengths) else -1
                count = int(length) if 0 <= length <= size else -1
                if count < 0 or count != length:
                    raise _truncated(path, element, row)
            place += count_width
            first.append(place)
            counts.append(count)
            place += count * width
        if place > size:
            raise _truncated(path, element, row)
    table = {}
    for item, (_, _, width, first, counts) in zip(element.properties, steps, strict=True):
        if item.name in wanted:
            many = np.array(counts, dtype=np.int64)
            within = np.arange(many.sum()) - np.repeat(np.cumsum(many) - many, many)
            values = body.at(item.type)[np.repeat(np.array(first, dtype=np.int64), many) + width * within]
            table[item.name] = Column(values.astype(np.float64), many if item.count_type else None)
    return table, place


def _count(body: Body, item: Property, place: int) -> int:
    """How many numbers a row has of a property at a place; -1: no length stands there."""
    if item.count_type is None:
        return 1
    lengths = body.at(item.count_type)
    length = lengths[place] if place < lengths.size else -1
    return int(length) if 0 <= length <= body.values.size and length == int(length) else -1


def _truncated(path: Path, element: Element, found: int) -> WorldError:
    return WorldError(
        f"world file {path} is damaged or truncated: it promises {element.rows} rows of {element.name}, "
        f"{found} could be read"
    )
