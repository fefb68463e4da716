"""BIT* of OMPL (Gammell, Srinivasa and Barfoot 2015), an independent peer of `df_bitstar`."""

from __future__ import annotations

from dataclasses import field

from uavexp.parameters import option
from uavexp.planner.find.base import Finder
from uavexp.planner.find.ompl_bitstar import OmplBitstar
from uavexp.planner.find_and_shape import FindAndShape
from uavexp.planner.shape.base import Shaper
from uavexp.planner.shape.corridor_qp import CorridorQp


@option
class Bitstar(FindAndShape):
    """`find=ompl_bitstar` and `shape=corridor_qp`."""

    find: Finder = field(default_factory=OmplBitstar)
    shape: Shaper = field(default_factory=CorridorQp)
