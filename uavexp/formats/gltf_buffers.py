"""The arrays of a glTF 2.0 file (Khronos 2021): its json, its buffers, and their accessors."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from uavexp.arrays import Float
from uavexp.errors import WorldError

JSON, BINARY = 0x4E4F534A, 0x004E4942  # types of a glb file's chunks
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
COMPRESSIONS = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
MAX_ZEROS = 10_000_000  # elements of an accessor that has no data of its own


@dataclass(frozen=True, slots=True)
class Document:
    """A file's json, whose entries are looked up by kind and index, and its binary chunk."""

    path: Path
    json: dict[str, Any]
    chunk: bytes | None
    _buffers: dict[int, bytes] = field(default_factory=dict)

    def entry(self, kind: str, index: object) -> dict[str, Any]:
        """Return one of the json's nodes, meshes, accessors ...; raise `WorldError` when there is none."""
        entries = self.json.get(kind, [])
        inside = isinstance(index, int) and 0 <= index < len(entries)
        entry: object = entries[index] if inside else None
        if not isinstance(entry, dict):
            raise WorldError(
                f"world file {self.path} is damaged: it names {kind} {index!r} of {len(entries)}, from 0"
            )
        return entry

    def buffer(self, index: int) -> bytes:
        """Bytes of a buffer, at least as many as it promises."""
        if index not in self._buffers:
            entry = self.entry("buffers", index)
            data = self._bytes(entry, index)
            promised = whole(entry, "byteLength")
            if len(data) < promised:
                raise WorldError(
                    f"world file {self.path} is truncated: its buffer {index} promises {promised} bytes, "
                    f"{len(data)} found"
                )
            self._buffers[index] = data
        return self._buffers[index]

    def _bytes(self, entry: dict[str, Any], index: int) -> bytes:
        uri = entry.get("uri")
        if uri is None:
            if self.chunk is None or index != 0:
                raise WorldError(f"world file {self.path} is damaged: its buffer {index} is nowhere")
            return self.chunk
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        file = self.path.parent / unquote(uri)
        if not file.is_file():
            raise WorldError(f"world file {self.path} needs its buffer {file}, which is no file")
        return file.read_bytes()

    def accessor(self, index: object) -> npt.NDArray[Any]:
        """Values (N, W) of an accessor as it stores them."""
        entry = self.entry("accessors", index)
        dtype, width = np.dtype(COMPONENTS[entry["componentType"]]), WIDTHS[entry["type"]]
        count = whole(entry, "count")
        sparse = entry.get("sparse")
        if "bufferView" in entry:
            values = self._view(entry, dtype, count, width)
        elif sparse is not None and count <= MAX_ZEROS:
            values = np.zeros((count, width), dtype)
        else:
            raise WorldError(f"world file {self.path} is damaged: its accessor {index} has no data")
        if sparse is not None:
            changed = whole(sparse, "count")
            kind = np.dtype(COMPONENTS[sparse["indices"]["componentType"]])
            places = self._view(sparse["indices"], kind, changed, 1)[:, 0]
            values = values.copy()
            values[places] = self._view(sparse["values"], dtype, changed, width)
        return values

    def _view(self, entry: dict[str, Any], dtype: npt.DTypeLike, count: int, width: int) -> npt.NDArray[Any]:
        """Values (count, width) from where an entry begins in its buffer view."""
        view = self.entry("bufferViews", entry["bufferView"])
        check_uncompressed(self.path, view.get("extensions", {}))
        size = np.dtype(dtype).itemsize
        stride = whole(view, "byteStride", width * size)
        if stride < width * size:
            raise ValueError(f"byteStride must be at least {width * size}, got {stride}")
        begin, length = whole(entry, "byteOffset", 0), whole(view, "byteLength")
        first = whole(view, "byteOffset", 0)
        data = memoryview(self.buffer(view["buffer"]))[first : first + length]
        last = begin + stride * (count - 1) + width * size
        if count == 0:
            return np.empty((0, width), dtype)
        if last > len(data):
            raise WorldError(
                f"world file {self.path} is damaged or truncated: {last} bytes of a view are needed, "
                f"{len(data)} found"
            )
        return np.ndarray((count, width), dtype, data, begin, (stride, size))


def load(path: Path) -> Document:
    """Return the document of a .glb or .gltf file; raise `WorldError` when it is none."""
    data = path.read_bytes()
    if path.suffix.lower() == ".gltf":
        return Document(path, _parsed(path, data), None)
    if data[:4] != b"glTF" or len(data) < 12:
        raise WorldError(f"world file {path} is no glb file: it does not begin with 'glTF'")
    version, promised = (int.from_bytes(data[place : place + 4], "little") for place in (4, 8))
    if version != 2:
        raise WorldError(f"world file {path} is glTF {version}, 2 is needed; export it anew")
    if len(data) < promised:
        raise WorldError(f"world file {path} is truncated: {promised} bytes expected, {len(data)} found")
    chunks, place = dict[int, bytes](), 12
    while place + 8 <= promised:  # chunks of some writers are not padded to 4 bytes
        length, kind = (int.from_bytes(data[begin : begin + 4], "little") for begin in (place, place + 4))
        if place + 8 + length > len(data):
            raise WorldError(f"world file {path} is truncated: a chunk of {length} bytes ends beyond it")
        chunks.setdefault(kind, data[place + 8 : place + 8 + length])
        place += 8 + length
    if JSON not in chunks:
        raise WorldError(f"world file {path} is damaged: it has no json chunk")
    return Document(path, _parsed(path, chunks[JSON]), chunks.get(BINARY))


def _parsed(path: Path, text: bytes) -> dict[str, Any]:
    try:
        parsed = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise WorldError(f"world file {path} is damaged or truncated: its json cannot be parsed") from error
    if not isinstance(parsed, dict) or not isinstance(parsed.get("asset"), dict):
        raise WorldError(f"world file {path} is no glTF file: it has no asset")
    version = parsed["asset"].get("version")
    if not str(version).startswith("2."):
        raise WorldError(f"world file {path} is glTF {version}, 2 is needed; export it anew")
    return parsed


def buffer_files(path: Path) -> tuple[Path, ...]:
    """Return the files that hold a file's buffers."""
    buffers = load(path).json.get("buffers", [])
    uris = [entry.get("uri") for entry in buffers if isinstance(entry, dict)]
    return tuple(path.parent / unquote(uri) for uri in uris if isinstance(uri, str) and uri[:5] != "data:")


def whole(entry: dict[str, Any], key: str, default: int | None = None) -> int:
    """Return a whole number >= 0 of an entry; raise `ValueError` when it is none."""
    value = entry.get(key, default)
    if not isinstance(value, int) or value < 0:
        raise ValueError(f"{key} must be a whole number >= 0, got {value!r}")
    return value


def normalised(values: npt.NDArray[Any]) -> Float:
    """Return whole numbers as shares of the greatest of their type, from -1 or 0 to 1."""
    if values.dtype.kind == "f":
        return values.astype(np.float64)
    return np.maximum(values / np.iinfo(values.dtype).max, -1.0)


def check_uncompressed(path: Path, extensions: Iterable[str]) -> None:
    """Raise `WorldError` when a decoder is needed."""
    for name in COMPRESSIONS:
        if name in extensions:
            raise WorldError(
                f"world file {path} holds geometry compressed by {name}, which is not supported; "
                "export it without compression"
            )
