"""OctoMap's occupancy octrees: `.bt` (solid or free) and `.ot` (log odds)."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from uavexp.arrays import Int
from uavexp.errors import WorldError
from uavexp.formats import grid, octree
from uavexp.formats.base import UNMEASURED, Cells, Content, Options

_HEADER = 65536  # bytes in which the header must end
_BINARY = b"# Octomap OcTree binary file"
_FULL = b"# Octomap OcTree file"
# bytes of a node of each kind of tree before its children's byte; every one begins with log odds
_NODE_BYTES = {"OcTree": 4, "ColorOcTree": 7, "OcTreeStamped": 4}
_CENTRE_KEY = 1 << (octree.DEPTH - 1)  # the key that begins at 0 m

Leaves = Callable[[Int], tuple[int, int, int]]


def read(path: Path, options: Options) -> Content:
    """Return the leaves' cells of the tree's resolution; what no leaf covers is unmeasured.

    The bytes say which form a file has, whatever its suffix. Counts are compared with the header's.
    """
    data = path.read_bytes()
    if not data.startswith((_BINARY, _FULL)):
        raise WorldError(f"world file {path} is no octomap: it does not begin with '{_FULL.decode()}'")
    entries, begin = _header(path, data[:_HEADER])
    kind = entries.get("id", "")
    if kind not in _NODE_BYTES:
        raise WorldError(f"world file {path} holds a tree {kind!r}; one of {' '.join(_NODE_BYTES)} is needed")
    resolution = _number(path, entries, "res")
    if not 0.0 < resolution < math.inf:
        raise WorldError(f"world file {path}: res must be > 0 and finite, got {resolution}")
    tree = np.frombuffer(data, dtype=np.uint8, offset=begin)
    if data.startswith(_BINARY):
        leaves = _leaves(path, partial(octree.binary_leaves, tree), _number(path, entries, "size"))
    else:
        fill = partial(octree.full_leaves, tree, _NODE_BYTES[kind])
        leaves = _leaves(path, fill, _number(path, entries, "size"))
    return Content(kind="octomap", cells=_cells(path, leaves, resolution))


def _header(path: Path, head: bytes) -> tuple[dict[str, str], int]:
    """Words of the header by their keys, and the byte after it."""
    entries: dict[str, str] = {}
    begin = 0
    while "data" not in entries:
        end = head.find(b"\n", begin)
        if end < 0:
            raise WorldError(f"world file {path} is damaged or truncated: its header has no line 'data'")
        key, _, value = head[begin:end].decode("latin-1").strip().partition(" ")
        entries[key] = value.strip()
        begin = end + 1
    return entries, begin


def _number(path: Path, entries: dict[str, str], key: str) -> float:
    try:
        return float(entries[key])
    except (KeyError, ValueError):
        raise WorldError(
            f"world file {path} is damaged: its header needs a number {key}, got {entries.get(key, 'none')!r}"
        ) from None


def _leaves(path: Path, fill: Leaves, promised: float) -> Int:
    """Leaves (L, 5) of a tree that has the promised number of nodes."""
    count, nodes, read = fill(np.empty((0, 5), dtype=np.int64))
    if read < 0 or nodes != promised:
        raise WorldError(
            f"world file {path} is damaged or truncated: {promised:g} nodes promised, {nodes} found"
        )
    if count == 0:
        raise WorldError(f"world file {path} holds no measured cell")
    leaves = np.empty((count, 5), dtype=np.int64)
    fill(leaves)
    return leaves


def _cells(path: Path, leaves: Int, resolution: float) -> Cells:
    low = leaves[:, :3].min(axis=0)
    high = (leaves[:, :3] + leaves[:, 3:4]).max(axis=0)
    state = grid.filled(path, high - low, UNMEASURED)
    octree.paint(leaves, low, state)
    return Cells(state=state, origin=(low - _CENTRE_KEY) * resolution, size=np.full(3, resolution))
