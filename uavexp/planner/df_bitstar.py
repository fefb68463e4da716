"""DF-BIT* (paper 4): batch informed trees of dynamically feasible motions, smoothed."""

from __future__ import annotations

from dataclasses import field

from uavexp.parameters import option
from uavexp.planner.find.base import Finder
from uavexp.planner.find.tree import Tree
from uavexp.planner.find_and_shape import FindAndShape
from uavexp.planner.shape.base import Shaper
from uavexp.planner.shape.corridor_qp import CorridorQp


@option
class DfBitstar(FindAndShape):
    """`find=tree` and `shape=corridor_qp`."""

    find: Finder = field(default_factory=Tree)
    shape: Shaper = field(default_factory=CorridorQp)
