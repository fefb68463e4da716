"""Improved A* of paper 2: a price on turning, a rule for vertical steps, a smoothed path."""

from __future__ import annotations

from dataclasses import field

from uavexp.parameters import option
from uavexp.planner.find.base import Finder
from uavexp.planner.find.turning import Turning
from uavexp.planner.find_and_shape import FindAndShape
from uavexp.planner.shape.base import Shaper
from uavexp.planner.shape.scp import Scp


@option
class ImprovedAstar(FindAndShape):
    """`find=turning` and `shape=scp`."""

    find: Finder = field(default_factory=Turning)
    shape: Shaper = field(default_factory=Scp)
