"""Leaves of OctoMap's octrees: what each file's node bytes mean (Hornung et al. 2013, octomap 1.10)."""

from __future__ import annotations

import numba as nb
import numpy as np

from uavexp.arrays import Int, UInt8
from uavexp.formats.base import FREE, SOLID

DEPTH = 16  # of the tree: a key has 16 bits an axis
_STACK = 8 * DEPTH  # children that wait, at most


@nb.njit(cache=True)
def binary_leaves(data: UInt8, leaves: Int) -> tuple[int, int, int]:
    """Fill the leaves of a `.bt` tree, as many as there is room for.

    A node is two bytes: two bits for each child, low bits first; 1 a free leaf, 2 a solid one, 3 a
    node that follows, depth first.

    Args:
        data: (N,) bytes of the tree.
        leaves: (L, 5), filled with the lowest key, edge in keys, and state.

    Returns:
        Leaves; nodes, leaves included; bytes read, -1 when they do not suffice or lie too deep.
    """
    stack = np.zeros((_STACK, 4), dtype=np.int64)  # lowest key and edge of a node
    stack[0, 3] = 1 << DEPTH
    waiting, found, nodes, read = 1, 0, 1, 0
    while waiting > 0:
        waiting -= 1
        x, y, z, edge = stack[waiting]
        half = edge >> 1
        if read + 2 > data.size or half == 0:
            return found, nodes, -1
        pairs = int(data[read]) | int(data[read + 1]) << 8
        read += 2
        for child in range(7, -1, -1):  # pushed last first: the first is read next
            kind = pairs >> (2 * child) & 3
            if kind == 0:
                continue
            nodes += 1
            key = x + half * (child & 1), y + half * (child >> 1 & 1), z + half * (child >> 2)
            if kind == 3:
                stack[waiting] = key[0], key[1], key[2], half
                waiting += 1
            else:
                if found < leaves.shape[0]:
                    leaves[found] = key[0], key[1], key[2], half, FREE if kind == 1 else SOLID
                found += 1
    return found, nodes, read


@nb.njit(cache=True)
def full_leaves(data: UInt8, node_bytes: int, leaves: Int) -> tuple[int, int, int]:
    """Fill the leaves of an `.ot` tree.

    A node is `node_bytes` of its own, first the log odds as float32, then a byte with a bit for each
    child that follows, depth first. A node without children is a leaf, solid from log odds 0 on.

    Args:
        data: see `binary_leaves`.
        node_bytes: of a node's own.
        leaves: see `binary_leaves`.

    Returns:
        See `binary_leaves`.
    """
    stack = np.zeros((_STACK, 4), dtype=np.int64)
    stack[0, 3] = 1 << DEPTH
    waiting, found, nodes, read = 1, 0, 0, 0
    while waiting > 0:
        waiting -= 1
        x, y, z, edge = stack[waiting]
        half = edge >> 1
        if read + node_bytes + 1 > data.size:
            return found, nodes, -1
        bits = 0
        for byte in range(3, -1, -1):
            bits = bits << 8 | int(data[read + byte])
        negative = bits > 1 << 31  # the sign bit, and not -0
        children = int(data[read + node_bytes])
        read += node_bytes + 1
        nodes += 1
        if children == 0:
            if found < leaves.shape[0]:
                leaves[found] = x, y, z, edge, FREE if negative else SOLID
            found += 1
        elif half == 0:
            return found, nodes, -1
        for child in range(7, -1, -1):
            if children >> child & 1:
                stack[waiting] = (
                    x + half * (child & 1),
                    y + half * (child >> 1 & 1),
                    z + half * (child >> 2),
                    half,
                )
                waiting += 1
    return found, nodes, read


@nb.njit(cache=True)
def paint(leaves: Int, low: Int, state: UInt8) -> None:
    """Give the cells (X, Y, Z), the first of which has the key `low` (3,), the states of the leaves."""
    for leaf in range(leaves.shape[0]):
        x, y, z = leaves[leaf, 0] - low[0], leaves[leaf, 1] - low[1], leaves[leaf, 2] - low[2]
        edge, value = leaves[leaf, 3], leaves[leaf, 4]
        state[x : x + edge, y : y + edge, z : z + edge] = value
