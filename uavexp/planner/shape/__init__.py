"""Smoothers, usable behind any path planner."""

from __future__ import annotations

from enum import StrEnum

from uavexp.errors import require_option
from uavexp.planner.shape.base import Smoother
from uavexp.planner.shape.corridor_qp import BsplineSmoother, Derivative
from uavexp.planner.shape.time_law import TimeLaw
from uavexp.planner.shape.waypoint_spline import WaypointSpline


class Smoothing(StrEnum):
    """The smoothers."""

    BSPLINE_QP = "bspline_qp"
    NONE = "none"  # a time law along the path, no more
    WAYPOINT_SPLINE = "waypoint_spline"  # through the corners, whatever the limits: for comparison


def make_smoother(name: str, derivative: str = "acceleration") -> Smoother:
    """Build a smoother.

    Args:
        name: `bspline_qp`, `none` or `waypoint_spline`.
        derivative: what `bspline_qp` minimises: acceleration, jerk or snap.

    Raises:
        ConfigError: when a name is unknown.
    """
    kind = require_option("derivative", derivative, Derivative)
    smoothing = require_option("smoothing", name, Smoothing)
    if smoothing is Smoothing.BSPLINE_QP:
        return BsplineSmoother(derivative=kind)
    return TimeLaw() if smoothing is Smoothing.NONE else WaypointSpline()
