"""Plain A*, the traditional method of paper 2: shortest voxel path, movers where they are now.

    python -m uavexp.planner.astar MAP.3dmap SCENARIOS.3dscen --limit 200

solves problems of the voxel path benchmark and compares their costs with the published ones.
"""

from __future__ import annotations

import sys
from dataclasses import field

from uavexp.parameters import option
from uavexp.planner.find.base import Finder
from uavexp.planner.find.voxel import Voxel
from uavexp.planner.find_and_shape import FindAndShape, MoversSeen
from uavexp.planner.shape.base import Shaper
from uavexp.planner.shape.scp import Scp


@option
class Astar(FindAndShape):
    """`find=voxel` and `shape=scp`."""

    find: Finder = field(default_factory=Voxel)
    shape: Shaper = field(default_factory=Scp)
    movers: MoversSeen = MoversSeen.CURRENT


if __name__ == "__main__":
    from uavexp.planner.find.voxels.published import main

    sys.exit(main(sys.argv[1:]))
