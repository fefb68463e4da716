"""Smoothers, usable behind any path planner."""

from __future__ import annotations

from enum import StrEnum

from uavexp.errors import require_option
from uavexp.planner.smoothing.base import Smoother
from uavexp.planner.smoothing.bspline_qp import BsplineSmoother, Derivative
from uavexp.planner.smoothing.time_law import TimeLaw


class Smoothing(StrEnum):
    """The smoothers."""

    BSPLINE_QP = "bspline_qp"
    NONE = "none"  # a time law along the path, no more


def make_smoother(name: str, derivative: str = "acceleration") -> Smoother:
    """Build a smoother.

    Args:
        name: `bspline_qp` or `none`.
        derivative: what `bspline_qp` minimises: acceleration, jerk or snap.

    Raises:
        ConfigError: when a name is unknown.
    """
    kind = require_option("derivative", derivative, Derivative)
    if require_option("smoothing", name, Smoothing) is Smoothing.BSPLINE_QP:
        return BsplineSmoother(derivative=kind)
    return TimeLaw()
