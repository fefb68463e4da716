"""Binary heap of cells for graph search, on arrays that outlive the search.

`key` and `place` are indexed by cell: its priority, and where in `heap` it stands, so that a
key can be lowered in place. A cell that was taken out has the place -1.
"""

from __future__ import annotations

import numba as nb

from uavexp.arrays import Float, Int32


@nb.njit(cache=True, inline="always")
def sift_up(heap: Int32, place: Int32, key: Float, position: int) -> None:
    """Restore the order after the key at this position of the heap has become smaller."""
    cell = heap[position]
    while position > 0:
        above = (position - 1) >> 1
        if key[heap[above]] <= key[cell]:
            break
        heap[position] = heap[above]
        place[heap[position]] = position
        position = above
    heap[position] = cell
    place[cell] = position


@nb.njit(cache=True, inline="always")
def pop(heap: Int32, place: Int32, key: Float, size: int) -> int:
    """Take the cell of least key out of a heap of `size` cells and mark it closed (-1)."""
    top = heap[0]
    place[top] = -1
    last = heap[size - 1]
    size -= 1
    if size > 0:
        position = 0
        while True:
            child = 2 * position + 1
            if child >= size:
                break
            if child + 1 < size and key[heap[child + 1]] < key[heap[child]]:
                child += 1
            if key[heap[child]] >= key[last]:
                break
            heap[position] = heap[child]
            place[heap[position]] = position
            position = child
        heap[position] = last
        place[last] = position
    return int(top)
