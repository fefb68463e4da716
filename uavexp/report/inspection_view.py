"""The plan and the panel of an inspection: what was seen and what was not, from where, and when."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

from uavexp.arrays import Bool, Float
from uavexp.log import TrialLog
from uavexp.metrics import clearance, coverage, path
from uavexp.report import movers_view, plan_view, style
from uavexp.types import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize

HIDDEN = "#8A6FB0"  # cells that no place within reach sees
CELL_M = 0.12  # side of a cell as drawn; neighbours stay apart
ARROW_M = 0.35  # length of a viewpoint's arrow
_BASE = (0, 2, 6, 4)  # corners of a box's underside, in the order around it (`world.boxes`)


def is_inspection(log: TrialLog) -> bool:
    """Whether a flight had a surface to see."""
    return log.inspection.cell_m.size > 0


def draw(axes: Axes, world: World, log: TrialLog, view: Float) -> Normalize:
    """Draw truth, blocks, people, cells, viewpoints and the flown path; return the scale of its colours."""
    plan_view.draw_truth(axes, world, plan_view.visited_m(world, log))
    for corners in blocks_m(world):
        axes.add_patch(
            Polygon(list(corners[_BASE, :2]), fc=style.ORANGE, ec=style.BLACK, lw=0.5, alpha=0.8, zorder=1)
        )
    movers_view.draw(axes, log)
    _draw_cells(axes, log, view)
    _draw_viewpoints(axes, log)
    scale = plan_view.draw_path(axes, log)
    plan_view.draw_contacts(axes, log)
    axes.plot(*world.start_m[:2], "o", color="white", mec=style.BLACK, mew=1.4, ms=8, zorder=6)
    plan_view.frame(axes, view)
    return scale


def draw_coverage(axes: Axes, log: TrialLog) -> None:
    """Draw the share of the visible cells seen over time, and the visits as ticks."""
    time_s, visited_s = log.steps.time_s, log.inspection.viewpoint_visited_s
    axes.plot(time_s, 100.0 * coverage.over_time(log, time_s), color=style.GREEN, lw=1.4, label="coverage")
    for at_s in visited_s[np.isfinite(visited_s)]:
        axes.axvline(at_s, ymax=0.06, color=style.BLUE, lw=0.7)
    axes.set(xlabel="time [s]", ylabel="visible cells seen [%]", ylim=(0.0, 103.0))


def handles(world: World, log: TrialLog) -> list[Line2D | Patch]:
    """Legend of plan and panel, with counts."""
    counts = [int(np.count_nonzero(of_kind)) for of_kind in kinds(log)]
    visited = int(np.isfinite(log.inspection.viewpoint_visited_s).sum())
    missed = len(log.inspection.viewpoint_visited_s) - visited

    def dot(colour: str, label: str) -> Line2D:
        return Line2D([], [], color=colour, marker="s", ls="", ms=4, mew=0, label=label)

    shown: list[Line2D | Patch] = [
        dot(style.GREEN, f"seen ({counts[0]})"),
        dot(style.VERMILLION, f"not seen ({counts[2]})"),
        dot(HIDDEN, f"hidden from everywhere ({counts[1]})"),
        Line2D([], [], color=style.BLUE, marker=">", ls="-", ms=4, lw=1, label=f"viewpoint ({visited})"),
        Line2D([], [], color=style.BLACK, marker="x", ls="", ms=5, label=f"not reached ({missed})"),
        Line2D([], [], color=plan_view.SPEED_COLOURS(0.7), lw=2.2, label="flown"),
        Line2D([], [], color="white", marker="o", ls="", mec=style.BLACK, mew=1.3, ms=7, label="start"),
    ]
    if len(blocks_m(world)):
        shown.append(
            Patch(fc=style.ORANGE, ec=style.BLACK, label=f"unforeseen block ({len(blocks_m(world))})")
        )
    return [*shown, *plan_view.contact_handles(log)]


def key_numbers(log: TrialLog) -> str:
    """Coverage, viewpoints and the flight, for the header."""
    visible, all_ = coverage.coverage_visible(log), coverage.coverage(log)
    share = f"{100.0 * visible:.2f} %" if math.isfinite(visible) else "–"
    visited = int(np.isfinite(log.inspection.viewpoint_visited_s).sum())
    return "    ".join(
        (
            f"seen {share} of what can be seen ({100.0 * all_:.1f} % of all)",
            f"viewpoints {visited} of {len(log.inspection.viewpoint_visited_s)}",
            f"path {path.path_length_m(log):.1f} m",
            f"time {path.completion_time_s(log):.1f} s",
            f"contacts {len(log.contacts)}",
            f"least clearance {clearance.smallest_m(log.steps.clearance_m):.2f} m",
        )
    )


def kinds(log: TrialLog) -> tuple[Bool, Bool, Bool]:
    """Cells (C,) seen, hidden from everywhere, and not seen although they could be."""
    seen = np.isfinite(log.inspection.cell_seen_s)
    return seen, ~seen & ~log.inspection.cell_visible, ~seen & log.inspection.cell_visible


def blocks_m(world: World) -> Float:
    """Corners (B, 8, 3) of the boxes that the mission has put behind the known geometry; else none."""
    known = 0 if world.reference is None else len(world.reference.vertices_m)
    added = np.asarray(world.vertices_m[known:], dtype=np.float64)
    if world.reference is None or len(added) % 8:
        return np.zeros((0, 8, 3))
    return added.reshape(-1, 8, 3)


def _draw_cells(axes: Axes, log: TrialLog, view: Float) -> None:
    """Draw every cell from above, what was not seen on top and larger."""
    width_pt = axes.get_window_extent().width / axes.figure.dpi * 72.0
    cell_pt = max(CELL_M / float(view[1, 0] - view[0, 0]) * width_pt, 1.2)
    colours = (style.GREEN, HIDDEN, style.VERMILLION)
    for order, (chosen, colour) in enumerate(zip(kinds(log), colours, strict=True)):
        places = np.unique(np.round(log.inspection.cell_m[chosen, :2].astype(np.float64), 2), axis=0)
        size_pt = cell_pt + 0.7 * order
        axes.plot(places[:, 0], places[:, 1], "s", color=colour, ms=size_pt, mew=0, zorder=2 + 0.1 * order)


def _draw_viewpoints(axes: Axes, log: TrialLog) -> None:
    visited = np.isfinite(log.inspection.viewpoint_visited_s)
    place, yaw_rad = log.inspection.viewpoint_m, log.inspection.viewpoint_yaw_rad
    axes.quiver(
        place[:, 0],
        place[:, 1],
        ARROW_M * np.cos(yaw_rad),
        ARROW_M * np.sin(yaw_rad),
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.0015,
        color=style.BLUE,
        zorder=5.5,
    )
    axes.plot(place[~visited, 0], place[~visited, 1], "x", color=style.BLACK, ms=5, mew=1.2, zorder=5.6)
