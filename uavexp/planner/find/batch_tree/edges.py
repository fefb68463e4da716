"""Edges of a batch search: what they cost, and the dynamics filter of paper 4.

An edge enters the heap only if its whole motion keeps the limits. Kinodynamic: a cubic within them
exists. Straight: the corner between it and the edge before can be rounded within their nearer halves
at `corner_mps` or more, v² tan(angle / 2) <= a_max * half the shorter edge.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float
from uavexp.planner.find.batch_tree.cubic_motion import cubic_time, least_time
from uavexp.planner.find.batch_tree.tree_rows import NONE, TreeRows


class EdgeRule(NamedTuple):
    """What an edge is."""

    kinodynamic: bool
    corner_mps: float  # 0: straight edges are not filtered
    longest_m: float
    top_mps: float
    strongest_mps2: float


@nb.njit(cache=True)
def bound(rule: EdgeRule, a: Float, b: Float) -> float:
    """Lower bound on the cost of getting from one state to another."""
    if rule.kinodynamic:
        return float(least_time(a, b, rule.top_mps, rule.strongest_mps2))
    return float(np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2))


@nb.njit(cache=True)
def cost(rule: EdgeRule, a: Float, b: Float) -> float:
    """Cost of an edge on an empty map: its least time, inf if no motion keeps the limits; or its length."""
    if not rule.kinodynamic:
        return float(bound(rule, a, b))
    return float(cubic_time(a, b, np.inf, rule.top_mps, rule.strongest_mps2))


@nb.njit(cache=True)
def fits(tree: TreeRows, tail: int, head: int, rule: EdgeRule) -> bool:
    """Whether the corner at `tail`, between the edge to it and the one to `head`, can be rounded."""
    before = tree.parent[tail]
    if rule.kinodynamic or rule.corner_mps == 0.0 or before == NONE:
        return True
    into, out, along = 0.0, 0.0, 0.0
    for k in range(3):
        a, b = tree.state[tail, k] - tree.state[before, k], tree.state[head, k] - tree.state[tail, k]
        into, out, along = into + a * a, out + b * b, along + a * b
    into, out = np.sqrt(into), np.sqrt(out)
    cosine = along / max(into * out, 1e-12)
    half_tangent = np.sqrt(max(1.0 - cosine, 0.0) / max(1.0 + cosine, 1e-12))
    return bool(rule.corner_mps**2 * half_tangent <= rule.strongest_mps2 * 0.5 * min(into, out))


@nb.njit(cache=True)
def corners_fit(tree: TreeRows, tail: int, head: int, rule: EdgeRule) -> bool:
    """Whether the new edge's corners fit as the tree is now: at `tail`, and at `head` into its children."""
    if rule.kinodynamic or rule.corner_mps == 0.0:
        return True
    if not fits(tree, tail, head, rule):
        return False
    before = tree.parent[head]
    tree.parent[head] = tail
    child, fit = tree.child[head], True
    while child != NONE and fit:
        fit = fits(tree, head, child, rule)
        child = tree.sibling[child]
    tree.parent[head] = before
    return fit
