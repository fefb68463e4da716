"""Metrics: pure functions of a trial's log and the world it was flown in."""

from uavexp.metrics.summary import Metrics, evaluate

__all__ = ["Metrics", "evaluate"]
