"""RRT* of OMPL (Karaman and Frazzoli 2011), an independent peer of `df_bitstar`."""

from __future__ import annotations

from dataclasses import field

from uavexp.parameters import option
from uavexp.planner.find.base import Finder
from uavexp.planner.find.ompl_rrtstar import OmplRrtstar
from uavexp.planner.find_and_shape import FindAndShape
from uavexp.planner.shape.base import Shaper
from uavexp.planner.shape.corridor_qp import CorridorQp


@option
class Rrtstar(FindAndShape):
    """`find=ompl_rrtstar` and `shape=corridor_qp`."""

    find: Finder = field(default_factory=OmplRrtstar)
    shape: Shaper = field(default_factory=CorridorQp)
