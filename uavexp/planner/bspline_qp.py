"""A* path, then B-spline smoothing in a corridor of convex free regions (paper 4's second half)."""

from __future__ import annotations

from dataclasses import field

from uavexp.parameters import option
from uavexp.planner.find.base import Finder
from uavexp.planner.find.grid import Grid
from uavexp.planner.find_and_shape import FindAndShape
from uavexp.planner.shape.base import Shaper
from uavexp.planner.shape.corridor_qp import CorridorQp


@option
class BsplineQp(FindAndShape):
    """`find=grid` and `shape=corridor_qp`."""

    find: Finder = field(default_factory=Grid)
    shape: Shaper = field(default_factory=CorridorQp)
