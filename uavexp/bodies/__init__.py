"""Geometry of moving bodies: distances of points, hits of rays, touching boxes."""

from __future__ import annotations

from uavexp.bodies.box_contact import separating_planes, touching
from uavexp.bodies.distance import ABSENT_M, distance_m, present
from uavexp.bodies.ray_hits import cast_rays

__all__ = ["ABSENT_M", "cast_rays", "distance_m", "present", "separating_planes", "touching"]
