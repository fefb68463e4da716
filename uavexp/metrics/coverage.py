"""What an inspection has seen, and what it cost: figures of the cells and the viewpoints of its log."""

from __future__ import annotations

import math

import numpy as np

from uavexp.arrays import Bool, Float
from uavexp.geometry import polyline_length_m
from uavexp.log import TrialLog
from uavexp.metrics.metric import Metric, Metrics
from uavexp.types import Outcome, World


def coverage(log: TrialLog) -> float:
    """Share of all cells to be seen that were seen; NaN without any."""
    return _share(np.isfinite(log.inspection.cell_seen_s))


def coverage_visible(log: TrialLog) -> float:
    """Share of those cells that can be seen from some place within reach; NaN without any."""
    return _share(np.isfinite(log.inspection.cell_seen_s[log.inspection.cell_visible]))


def coverage_truth(log: TrialLog) -> float:
    """Share of the true surface's cells, blocks included, that can be seen and were; NaN without any."""
    return _share(np.isfinite(log.inspection.true_cell_seen_s[log.inspection.true_cell_visible]))


def over_time(log: TrialLog, times_s: Float) -> Float:
    """Share of the visible cells seen by each time (T,) -> (T,); NaN without any."""
    seen_s = np.sort(log.inspection.cell_seen_s[log.inspection.cell_visible])
    if seen_s.size == 0:
        return np.full(times_s.shape, np.nan)
    return np.searchsorted(seen_s, times_s, side="right") / seen_s.size


def unreachable(log: TrialLog) -> float:
    """Viewpoints that were found blocked or out of reach; NaN when time was up before all were tried."""
    visited_s = log.inspection.viewpoint_visited_s
    return float(np.isinf(visited_s).sum()) if log.outcome is Outcome.INSPECTED else math.nan


def segment_switches(log: TrialLog) -> int:
    """How often two viewpoints in a row, as planned, look at different segments."""
    return int(np.count_nonzero(np.diff(log.inspection.viewpoint_segment)))


def tour_length_m(log: TrialLog, world: World) -> float:
    """Length of straight lines from the start through the viewpoints as planned; NaN without any.

    A lower bound of the tour that was planned, which goes around walls.
    """
    if log.inspection.viewpoint_m.shape[0] == 0:
        return math.nan
    return polyline_length_m(np.concatenate([world.start_m[None], log.inspection.viewpoint_m]))


def scene_kind(log: TrialLog, world: World) -> str:
    """What the reference map does not show: static (nothing), blocks, people, both.

    Empty without a map, or where nothing was to be seen.
    """
    if world.reference is None or not log.inspection.cell_m.size:
        return ""
    known, true = world.reference.triangles, world.triangles
    people, blocks = log.movers.shape.size > 0, not np.array_equal(known, true)
    return {(False, False): "static", (True, False): "blocks", (False, True): "people"}.get(
        (blocks, people), "both"
    )


def _share(seen: Bool) -> float:
    return float(seen.mean()) if seen.size else math.nan


def _share_of_cells(column: str, title: str) -> Metric:
    return Metric(
        column=column, title=title, unit="%", better=1, scale=100.0, missing="nothing was to be seen"
    )


METRICS: Metrics = {
    _share_of_cells("coverage", "Coverage of all targets"): lambda flight: coverage(flight.log),
    _share_of_cells("coverage_visible", "Coverage of the visible"): lambda flight: coverage_visible(
        flight.log
    ),
    _share_of_cells("coverage_truth", "Coverage of the true surface"): lambda flight: coverage_truth(
        flight.log
    ),
    Metric(column="viewpoints", title="Viewpoints", digits=1, is_count=True): (
        lambda flight: len(flight.log.inspection.viewpoint_visited_s)
    ),
    Metric(column="visited", title="Viewpoints visited", digits=1, is_count=True): (
        lambda flight: int(np.isfinite(flight.log.inspection.viewpoint_visited_s).sum())
    ),
    Metric(
        column="unreachable",
        title="Viewpoints not reached",
        better=-1,
        is_count=True,
        missing="time was up before all were tried",
    ): lambda flight: unreachable(flight.log),
    Metric(column="segment_switches", title="Segment switches", digits=1, better=-1, is_count=True): (
        lambda flight: segment_switches(flight.log)
    ),
    Metric(
        column="tour_length_m",
        title="Tour as planned, straight",
        unit="m",
        digits=1,
        better=-1,
        missing="no viewpoint was planned",
    ): lambda flight: tour_length_m(flight.log, flight.world),
    Metric(column="scene_kind"): lambda flight: scene_kind(flight.log, flight.world),
}
