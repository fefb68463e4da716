"""Minimum-acceleration trajectories: A* path, then sequential convex programming (paper 1)."""

from __future__ import annotations

from dataclasses import field

from uavexp.parameters import option
from uavexp.planner.find.base import Finder
from uavexp.planner.find.grid import Grid
from uavexp.planner.find_and_shape import FindAndShape
from uavexp.planner.shape.base import Shaper
from uavexp.planner.shape.scp import Scp


@option
class MinAcc(FindAndShape):
    """`find=grid` and `shape=scp`."""

    find: Finder = field(default_factory=Grid)
    shape: Shaper = field(default_factory=Scp)
