"""Geometry of moving bodies: distances of points, hits of rays, touching boxes."""

from __future__ import annotations

from uavexp.bodies.boxes import separating_planes, touching
from uavexp.bodies.points import ABSENT_M, distance_m, present
from uavexp.bodies.rays import cast_rays

__all__ = ["ABSENT_M", "cast_rays", "distance_m", "present", "separating_planes", "touching"]
