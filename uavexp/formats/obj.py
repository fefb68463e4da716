"""Wavefront files (.obj): polygons; materials and textures are not opened."""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np

from uavexp.arrays import Bool, Float, Int, UInt8
from uavexp.errors import WorldError
from uavexp.formats.base import Content, Options, mesh
from uavexp.formats.number_text import integers, numbers, quoted
from uavexp.formats.polygons import triangulate

PIECE = 2**23  # bytes of the file that are worked on at once


def read(path: Path, options: Options) -> Content:
    """Return the mesh of all faces of a file, whatever its objects and groups.

    Negative indices count from the last vertex before their line; a face may come before
    its vertices.

    Raises:
        WorldError: a vertex or a face is damaged, an index names no vertex.
    """
    vertices, corners, counts = [np.empty((0, 3))], [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    known = 0
    with path.open("rb") as file:
        for text in _pieces(file):
            lines = _Lines(text)
            is_vertex = lines.begin_with(b"v")
            is_face = lines.begin_with(b"f")
            vertices.append(_vertices(path, lines, is_vertex))
            before = known + np.cumsum(is_vertex)[is_face]
            count = lines.arguments[is_face]
            corners.append(_corners(path, lines, is_face, np.repeat(before, count)))
            counts.append(count)
            known += vertices[-1].shape[0]
    points = np.concatenate(vertices)
    triangles = triangulate(path, points, np.concatenate(corners), np.concatenate(counts))
    return mesh(path, "obj mesh", points, triangles)


class _Lines:
    """The words of some lines of text."""

    def __init__(self, text: bytes) -> None:
        self.text = text
        self.bytes: UInt8 = np.frombuffer(text, dtype=np.uint8)
        blank = self.bytes <= ord(" ")
        words = np.flatnonzero(~blank & np.concatenate([[True], blank[:-1]]))
        ends = np.flatnonzero(self.bytes == ord("\n"))
        line_of_word = np.searchsorted(ends, words)
        used, first = np.unique(line_of_word, return_index=True)
        self.first = words[first]  # place of the first word of each line that has one
        self.arguments: Int = np.diff(np.append(first, words.size)) - 1  # words after it
        self.end = ends[used]

    def begin_with(self, keyword: bytes) -> Bool:
        """Lines (L,) whose first word is a letter."""
        begin: Bool = (self.bytes[self.first] == ord(keyword)) & (self.bytes[self.first + 1] <= ord(" "))
        return begin

    def rest(self, chosen: Bool) -> bytes:
        """Lines without their first letter."""
        place = np.zeros(self.bytes.size + 1, dtype=np.int8)
        place[self.first[chosen] + 1] += 1
        place[self.end[chosen] + 1] -= 1
        return self.bytes[np.cumsum(place[:-1], dtype=np.int8).view(np.bool_)].tobytes()

    def quoted(self, index: int) -> str:
        """A line for an error."""
        return quoted(self.text[self.first[index] : self.end[index]])


def _pieces(file: BinaryIO) -> Iterator[bytes]:
    """Whole lines of a file, each ended, continued ones joined, without comments."""
    rest = b""
    if file.read(len(BOM_UTF8)) != BOM_UTF8:
        file.seek(0)
    while block := file.read(PIECE):
        block = rest + block
        cut = _last_end(block)
        rest = block[cut:]
        if cut:
            yield _plain(block[:cut])
    if rest:
        yield _plain(rest + b"\n")


def _last_end(block: bytes) -> int:
    """Where the last line ends that is not continued; 0: none does."""
    end = len(block)
    while (end := block.rfind(b"\n", 0, end)) >= 0:
        if not block[max(end - 2, 0) : end].rstrip(b"\r").endswith(b"\\"):
            return end + 1
    return 0


def _plain(text: bytes) -> bytes:
    text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\\\n", b" ")
    return re.sub(rb"#[^\n]*", b"", text) if b"#" in text else text


def _vertices(path: Path, lines: _Lines, chosen: Bool) -> Float:
    """Vertices (V, 3) of the lines; weights and colours after them are passed over."""
    count = lines.arguments[chosen]
    values = numbers(path, lines.rest(chosen))
    if (count < 3).any():
        line = lines.quoted(np.flatnonzero(chosen)[count < 3][0])
        raise WorldError(
            f"world file {path} is truncated or no obj: a vertex needs three numbers, got {line}"
        )
    vertices: Float = values[(np.cumsum(count) - count)[:, None] + np.arange(3)]
    return vertices


def _corners(path: Path, lines: _Lines, chosen: Bool, before: Int) -> Int:
    """Indices of vertices, from 0, of the lines' faces."""
    count = lines.arguments[chosen]
    if (count < 3).any():
        line = lines.quoted(np.flatnonzero(chosen)[count < 3][0])
        raise WorldError(f"world file {path} is truncated or no obj: a face needs three corners, got {line}")
    text = lines.rest(chosen)
    if b"/" in text:
        text = re.sub(rb"/\S*", b"", text)
    index = integers(path, numbers(path, text))
    if index.size != before.size:
        raise WorldError(f"world file {path} is damaged: a corner of a face names no vertex")
    return np.where(index < 0, before + index, index - 1)
