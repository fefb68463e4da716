"""Short tours by a Lin-Kernighan search: closed, or open from a fixed start, with a fixed end or not.

LKH (Helsgaun 2000), which paper 3 calls, and its wrappers are for non-commercial use only;
this is a search of the same family (`tour_kernels`). Budgets are kicks, never seconds: the
same costs and seed give the same tour.

`python -m uavexp.inspection.tour FILE.tsp` prints one line of JSON {nodes, length, seconds}.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from uavexp.arrays import Float, Int, Int32
from uavexp.errors import UavexpError, require
from uavexp.inspection import tour_array, tour_kernels, tsplib

NEIGHBOURS = 8  # length of the neighbour lists
KICKS_PER_NODE = 10
LEAST_KICKS = 5000


def closed_tour(cost: Float, seed: int = 0, kicks: int | None = None) -> Int:
    """Nodes (N,) of a short closed tour, node 0 first.

    Args:
        cost: symmetric travel costs (N, N), finite.
        seed: of the kicks.
        kicks: budget of the search; None: `KICKS_PER_NODE`, `LEAST_KICKS` at least.

    Raises:
        ConfigError: the costs are no finite symmetric matrix.
    """
    _check(cost)
    nodes = cost.shape[0]
    if nodes <= 3:
        return np.arange(nodes)
    if nodes == 4:  # too small for an Or-opt move; three tours are possible
        tours = [np.array(order) for order in ((0, 1, 2, 3), (0, 1, 3, 2), (0, 2, 1, 3))]
        return min(tours, key=lambda order: tour_length(cost, order, closed=True))
    near = tour_array.nearest(cost, min(NEIGHBOURS, nodes - 1))
    start = tour_array.nearest_neighbour_tour(cost, 0)
    budget = max(LEAST_KICKS, KICKS_PER_NODE * nodes) if kicks is None else kicks
    tour: Int32 = tour_kernels.search(cost, near, start, budget, np.random.default_rng(seed))
    tour = np.roll(tour, -int(np.argmin(tour)))
    if tour[-1] < tour[1]:  # one of the two directions, always the same
        tour[1:] = tour[:0:-1].copy()
    return np.asarray(tour, dtype=np.int64)


def open_tour(cost: Float, end: int | None = None, seed: int = 0, kicks: int | None = None) -> Int:
    """Nodes (N,) of a short path through all nodes that begins at node 0.

    Closed by a dummy node next to the start: joined to it at a cost so low that no search
    breaks the edge, to the end likewise, or to every node free of charge when the end is free.

    Args:
        cost: symmetric travel costs (N, N), finite.
        end: last node; None: any.
        seed: of the kicks.
        kicks: budget of the search; None: as `closed_tour`.

    Raises:
        ConfigError: the costs are no finite symmetric matrix, or the end is no other node.
    """
    _check(cost)
    nodes = cost.shape[0]
    require(end is None or 0 < end < nodes, f"end must be a node from 1 to {nodes - 1}, got {end}")
    if nodes <= 2:
        return np.arange(nodes)
    bond = -(1.0 + 2.0 * nodes * float(cost.max()))
    closed = np.zeros((nodes + 1, nodes + 1))
    closed[:nodes, :nodes] = cost
    closed[0, nodes] = closed[nodes, 0] = bond
    if end is not None:
        closed[end, nodes] = closed[nodes, end] = bond
    tour = closed_tour(closed, seed, kicks)  # 0 first: the dummy is second or last
    return tour[:-1] if tour[-1] == nodes else np.append(0, tour[:1:-1])


def tour_length(cost: Float, order: Int, *, closed: bool) -> float:
    """Cost of visiting nodes in this order (N,), with the way back when `closed`."""
    legs = float(cost[order[:-1], order[1:]].sum())
    return legs + float(cost[order[-1], order[0]]) if closed and len(order) > 1 else legs


def _check(cost: Float) -> None:
    square = cost.ndim == 2 and cost.shape[0] == cost.shape[1]
    require(square and cost.shape[0] > 0, f"cost must have shape (N, N), got {cost.shape}")
    require(bool(np.isfinite(cost).all()), "cost must be finite: drop nodes that cannot be reached")
    require(bool(np.array_equal(cost, cost.T)), "cost must be symmetric")


def main(arguments: Sequence[str] | None = None) -> int:
    """Solve one TSPLIB file and print its tour's length; 2 when it cannot be read."""
    parser = argparse.ArgumentParser(prog="python -m uavexp.inspection.tour", description="Closed tour.")
    parser.add_argument("file", type=Path, help="TSPLIB file of type TSP")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    begin = time.perf_counter()
    try:
        cost = tsplib.read(given.file)
        length = tour_length(cost, closed_tour(cost, given.seed), closed=True)
    except UavexpError as error:
        print(f"error: {error}", file=sys.stderr)  # noqa: T201
        return 2
    seconds = round(time.perf_counter() - begin, 3)
    print(json.dumps({"nodes": cost.shape[0], "length": round(length), "seconds": seconds}))  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
