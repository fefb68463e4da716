"""The plan of a trial: true and mapped obstacles, the flown path, the replans, the contacts."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, ListedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator

from uavexp.arrays import Float
from uavexp.log import TrialLog
from uavexp.metrics import replanning
from uavexp.report import cross_section, movers_view, replan_marks, style
from uavexp.types import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BAND_M = 0.5  # the plan shows what stands within this of the flight height
MARGIN_M = 3.0  # around everything flown
LEAST_CELL_M, MOST_CELLS = 0.025, 2000  # of the section
MOST_SEGMENTS = 4000  # of the flown path
SPEED_COLOURS = LinearSegmentedColormap.from_list("speed", ["#8CC4EA", "#2F86C1", "#0A2F5C"])


def view_m(world: World, *logs: TrialLog) -> Float:
    """Corners (2, 2) of the plan: start, target and everything flown with a margin, inside the world."""
    places = visited_m(world, *logs)[:, :2]
    bounds_m = world.bounds_m[:, :2]
    lower_m = np.maximum(places.min(axis=0) - MARGIN_M, bounds_m[0])
    upper_m = np.minimum(places.max(axis=0) + MARGIN_M, bounds_m[1])
    return np.stack([lower_m, upper_m])


def draw(axes: Axes, world: World, log: TrialLog, view: Float) -> Normalize:
    """Draw the plan on `axes`; return the scale of the path's colours, m/s."""
    draw_truth(axes, world, visited_m(world, log))
    _draw_mapped(axes, log, band_m(world), view)
    axes.plot(world.shortest_path[:, 0], world.shortest_path[:, 1], "--", color=style.BLACK, lw=0.9, zorder=4)
    for replan in log.replans:
        points = replan.trajectory_m
        axes.plot(points[:, 0], points[:, 1], color=style.SKY, lw=0.6, alpha=0.6, zorder=3)
    movers_view.draw(axes, log)
    scale = draw_path(axes, log)
    _draw_events(axes, log)
    draw_task(axes, world)
    frame(axes, view)
    return scale


def frame(axes: Axes, view: Float) -> None:
    """Show this part of the plan (2, 2), to scale."""
    axes.set(xlim=view[:, 0], ylim=view[:, 1], aspect="equal", anchor="N", xlabel="x [m]", ylabel="y [m]")
    tick_m = _tick_m(float(np.max(view[1] - view[0])))
    axes.xaxis.set_major_locator(MultipleLocator(tick_m))
    axes.yaxis.set_major_locator(MultipleLocator(tick_m))


def _tick_m(extent_m: float) -> float:
    """The round distance that makes about ten ticks, the same along both axes."""
    rough_m = max(extent_m, 0.1) / 10.0
    power = 10.0 ** math.floor(math.log10(rough_m))
    return next(step * power for step in (1.0, 2.0, 5.0, 10.0) if step * power >= 0.999 * rough_m)


def visited_m(world: World, *logs: TrialLog) -> Float:
    """Places (N, 3) known to be free: start, target, the shortest and the flown paths.

    An inspection has no target, and a block may stand on the way there: its flown path alone.
    """
    flown = [log.steps.position_m.reshape(-1, 3) for log in logs]
    if any(log.inspection.cell_m.size for log in logs):
        return np.concatenate([world.start_m[None], *flown])
    ends = np.stack([world.start_m, world.target_m])
    return np.concatenate([ends, world.shortest_path.reshape(-1, 3), *flown])


def band_m(world: World) -> tuple[float, float]:
    """Heights shown: around the start's, floor and ceiling left out by the flight bounds."""
    height_m = float(world.start_m[2])
    lowest_m, highest_m = world.flight_bounds_m[:, 2]
    return max(height_m - BAND_M, float(lowest_m)), min(height_m + BAND_M, float(highest_m))


def draw_truth(axes: Axes, world: World, free_m: Float) -> None:
    """Draw the true obstacles at flight height.

    Args:
        axes: to draw on.
        world: the truth.
        free_m: places (N, 3) known to be free; what does not join up with them is solid.
    """
    extent_m = float(np.max(world.bounds_m[1, :2] - world.bounds_m[0, :2]))
    cell_m = max(LEAST_CELL_M, extent_m / MOST_CELLS)
    plan = cross_section.cut(world, band_m(world), free_m, cell_m)
    axes.imshow(
        plan.cells.T,
        cmap=ListedColormap(["#FFFFFF", style.SOLID, style.SURFACE]),
        vmin=0,
        vmax=2,
        origin="lower",
        extent=(plan.lower_m[0], plan.upper_m[0], plan.lower_m[1], plan.upper_m[1]),
        interpolation="antialiased",
        interpolation_stage="rgba",  # blend colours, never the classes themselves
        zorder=0,
    )


def _draw_mapped(axes: Axes, log: TrialLog, heights_m: tuple[float, float], view: Float) -> None:
    """Draw a square per column of voxels mapped as occupied, half a voxel wide."""
    mapped_m = log.mapped_m.reshape(-1, 3)
    inside = (mapped_m[:, 2] >= heights_m[0]) & (mapped_m[:, 2] <= heights_m[1])
    columns_m = np.unique(np.round(mapped_m[inside, :2].astype(np.float64), 3), axis=0)
    if not columns_m.size:
        return
    gaps_m = np.diff(np.unique(columns_m[:, 0]))
    voxel_m = float(gaps_m.min()) if gaps_m.size else 0.1
    width_pt = axes.get_window_extent().width / axes.figure.dpi * 72.0
    size_pt = 0.5 * voxel_m / float(view[1, 0] - view[0, 0]) * width_pt
    axes.plot(
        columns_m[:, 0], columns_m[:, 1], "s", color=style.MAPPED, ms=max(size_pt, 0.7), mew=0, zorder=2
    )


def draw_path(axes: Axes, log: TrialLog) -> Normalize:
    """Draw the flown path in the colours of its speed."""
    speed_mps = np.linalg.norm(log.steps.velocity_mps.reshape(-1, 3), axis=1)
    scale = Normalize(0.0, max(0.5, math.ceil(2.0 * speed_mps.max(initial=0.0)) / 2.0))
    stride = max(1, speed_mps.size // MOST_SEGMENTS)
    points = log.steps.position_m.reshape(-1, 3)[::stride, :2]
    if points.shape[0] > 1:
        segments = list(np.stack([points[:-1], points[1:]], axis=1))
        lines = LineCollection(
            segments, linewidths=2.2, capstyle="round", cmap=SPEED_COLOURS, norm=scale, zorder=5.1
        )
        lines.set_array(speed_mps[::stride][:-1])
        axes.plot(points[:, 0], points[:, 1], color="white", lw=3.8, zorder=5.0)
        axes.add_collection(lines, autolim=False)
    return scale


def _draw_events(axes: Axes, log: TrialLog) -> None:
    size_pt = marker_size_pt(log)
    for replan in replanning.failed(log):
        axes.plot(*replan.position_m[:2], zorder=7, **replan_marks.failed_marker(replan.cause, size_pt))
    for replan in replanning.executed(log):
        axes.plot(*replan.position_m[:2], zorder=7.1, **replan_marks.marker(replan.cause, size_pt))
    draw_contacts(axes, log)


def draw_contacts(axes: Axes, log: TrialLog) -> None:
    """Mark contacts, those with movers apart from those with what stands."""
    for contact in log.contacts:
        axes.plot(*contact.position_m[:2], zorder=8, **style.contact_marker(contact.mover >= 0, 9.5))


def contact_handles(log: TrialLog) -> list[Line2D]:
    """The legend's entry for contacts with what stands, with their count; none without."""
    count = sum(contact.mover < 0 for contact in log.contacts)
    label = f"{'wall ' if log.movers.shape.size else ''}contact ({count})"
    look = style.contact_marker(with_mover=False, size_pt=9.0)
    return [Line2D([], [], label=label, **look)] if count else []


def marker_size_pt(log: TrialLog) -> float:
    """Size of a replan's marker: smaller when there are many."""
    return 7.5 if len(log.replans) < 40 else 5.0


def draw_task(axes: Axes, world: World) -> None:
    """Mark start and target."""
    axes.plot(*world.start_m[:2], "o", color="white", mec=style.BLACK, mew=1.4, ms=8, zorder=6)
    axes.plot(*world.target_m[:2], "*", color=style.YELLOW, mec=style.BLACK, mew=0.9, ms=15, zorder=6)
