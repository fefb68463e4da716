"""Slow and plain searches on small voxel grids: the oracles of the fast ones."""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Hashable, Iterator

import numpy as np

Cell = tuple[int, int, int]
STEPS = [step for step in itertools.product((-1, 0, 1), repeat=3) if any(step)]


def moves(free: np.ndarray, cell: Cell) -> Iterator[tuple[Cell, Cell]]:
    """Steps and cells that one move reaches, every cell of the box moved through being free."""
    for step in STEPS:
        there = tuple(c + s for c, s in zip(cell, step, strict=True))
        if not all(0 <= t < n for t, n in zip(there, free.shape, strict=True)):
            continue
        box = tuple(slice(min(c, t), max(c, t) + 1) for c, t in zip(cell, there, strict=True))
        if free[box].all():
            yield step, there


def dijkstra(
    start: Hashable,
    onward: Callable[[Hashable], Iterator[tuple[Hashable, float]]],
    done: Callable[[Hashable], bool],
) -> float:
    """Least cost from a state to one that is done; inf when there is none."""
    order = itertools.count()
    heap, best = [(0.0, next(order), start)], {start: 0.0}
    while heap:
        cost, _, state = heapq.heappop(heap)
        if cost > best[state]:
            continue
        if done(state):
            return cost
        for other, price in onward(state):
            if cost + price < best.get(other, math.inf):
                best[other] = cost + price
                heapq.heappush(heap, (cost + price, next(order), other))
    return math.inf


def shortest(free: np.ndarray, start: Cell, goal: Cell) -> float:
    """Length of the shortest path that cuts no corner."""
    return dijkstra(
        start, lambda cell: ((there, math.hypot(*step)) for step, there in moves(free, cell)), goal.__eq__
    )


def turning(free: np.ndarray, start: Cell, goal: Cell, weight: float, rule: str, made_counts: bool) -> float:
    """Least Σ (length + λ (1 - cos θ)) under the vertical rule, from the words of METHODS.md."""

    def may_climb(cell: Cell, made: int) -> bool:
        level = sum(1 for step, _ in moves(free, cell) if step[2] == 0)
        conditions = (
            level == 0,
            abs(cell[2] - goal[2]) > 2,
            (made if made_counts else level) >= 5,
        )
        return {"none": True, "or": any(conditions), "and": all(conditions)}[rule]

    def onward(state: tuple[Cell, Cell | None, int]) -> Iterator[tuple[Hashable, float]]:
        cell, before, made = state
        climb = may_climb(cell, made)
        for step, there in moves(free, cell):
            if step[2] and not climb:
                continue
            cosine = 1.0
            if before is not None:
                cosine = np.dot(step, before) / (math.hypot(*step) * math.hypot(*before))
            steps = 0 if step[2] else min(made + 1, 5)
            yield (there, step, steps), math.hypot(*step) + weight * (1.0 - cosine)

    return dijkstra((start, None, 0), onward, lambda state: state[0] == goal)


def random_grid(rng: np.random.Generator, shape: Cell, density: float) -> tuple[np.ndarray, Cell, Cell]:
    """A grid with two free cells."""
    free = rng.random(shape) >= density
    free[0, 0, 0] = free[-1, -1, -1] = True
    cells = np.argwhere(free)
    start, goal = (tuple(int(v) for v in cells[n]) for n in rng.integers(len(cells), size=2))
    return free, start, goal


def is_path(free: np.ndarray, cells: np.ndarray) -> bool:
    """Whether every step of a path (P, 3) is a move."""
    path = [tuple(int(v) for v in cell) for cell in cells]
    return all(there in [cell for _, cell in moves(free, here)] for here, there in itertools.pairwise(path))
