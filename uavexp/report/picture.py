"""The picture of one trial: where it flew, why it replanned, how near it came, how well it tracked."""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from uavexp.log import TrialLog
from uavexp.metrics import replanning
from uavexp.report import inspection_view, movers_view, plan_view, replan_marks, search_view, style
from uavexp.report.picture_layout import LEFT_IN, WIDTH_IN, Page, lay_out
from uavexp.types import World

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize

Values = Mapping[str, bool | int | float | str]

DPI = 120
MOST_POINTS = 4000  # of a curve over time


def draw(world: World, log: TrialLog, metrics: Values, title: str, path: Path | IO[bytes]) -> None:
    """Write the picture of one trial as a PNG; the same trial gives the same bytes.

    Args:
        world: the truth.
        log: the flight; may be empty or a single row (an error before the first step).
        metrics: of `uavexp.metrics.evaluate`, with `seed` and `strategy` when there are any.
        title: the command that repeats the trial.
        path: PNG file to write, or an open one.
    """
    with style.house_style():
        view = plan_view.view_m(world, log)
        size_m = view[1] - view[0]
        inspects = inspection_view.is_inspection(log)
        near_miss_m = _number(metrics, "near_miss_distance_m")
        movers = movers_view.handles(log, near_miss_m)
        sheet = lay_out((float(size_m[0]), float(size_m[1])), len(movers))
        FigureCanvasAgg(sheet.figure)
        draw_plan = inspection_view.draw if inspects else plan_view.draw
        speed_scale = draw_plan(sheet.plan, world, log, view)
        if not inspects:
            search_view.draw(sheet.plan, world, log)
        movers_view.draw_near_misses(sheet.plan, log, near_miss_m)
        _draw_speed_bar(sheet.speed_bar, speed_scale)
        _draw_clearance(sheet.clearance, log, _number(metrics, "safety_threshold_m"), near_miss_m)
        if inspects:
            inspection_view.draw_coverage(sheet.tracking, log)
            _finish_panel(sheet.tracking, log, legend=False)
        else:
            _draw_tracking(sheet.tracking, log)
        rest = inspection_view.handles(world, log) if inspects else _handles(world, log)
        _draw_legend(sheet, rest, sheet.legend_corner, sheet.legend_columns)
        if movers:
            _draw_legend(sheet, movers, sheet.movers_corner, sheet.movers_columns)
        _draw_header(sheet, world, log, metrics, title)
        sheet.figure.savefig(path, dpi=DPI, format="png", metadata={"Software": None})


def _number(metrics: Values, name: str) -> float:
    return float(metrics.get(name, math.nan))


def _draw_speed_bar(axes: Axes, scale: Normalize) -> None:
    bar = axes.figure.colorbar(
        ScalarMappable(scale, plan_view.SPEED_COLOURS),
        cax=axes,
        orientation="horizontal",
        label="flown speed [m/s]",
    )
    bar.outline.set_linewidth(0.4)
    axes.tick_params(length=2, pad=1.5, labelsize=7)
    axes.xaxis.labelpad = 1.0


def _draw_clearance(axes: Axes, log: TrialLog, safety_threshold_m: float, near_miss_m: float) -> None:
    """Draw true and mapped clearance over time, with the thresholds and the contacts."""
    stride = max(1, log.steps.time_s.size // MOST_POINTS)
    time_s, clearance_m = log.steps.time_s[::stride], log.steps.clearance_m[::stride]
    ticks = log.ticks
    if len(ticks.tick_s):  # a judged recording has none
        axes.plot(ticks.tick_s, ticks.esdf_clearance_m, color=style.ORANGE, lw=1.0, label="in the map (ESDF)")
    axes.plot(time_s, clearance_m, color=style.BLUE, lw=1.3, label="true")
    if math.isfinite(safety_threshold_m):
        limit_m = safety_threshold_m
        axes.axhline(
            limit_m, color=style.BLACK, lw=0.8, ls=(0, (4, 2)), label=f"safe clearance, {limit_m:g} m"
        )
        below: dict[str, Any] = {"where": clearance_m < limit_m, "color": style.VERMILLION, "alpha": 0.45}
        axes.fill_between(time_s, clearance_m, limit_m, lw=0, **below)
    for contact in log.contacts:
        axes.axvspan(contact.start_s, contact.end_s, color=style.VERMILLION, alpha=0.25, lw=0)
        axes.plot(contact.start_s, 0.0, clip_on=False, **style.contact_marker(contact.mover >= 0, 7.0))
    axes.set_ylim(bottom=0.0)
    movers_view.draw_clearance(axes, log, near_miss_m)
    axes.set_ylabel("clearance [m]")
    axes.tick_params(labelbottom=False)
    _finish_panel(axes, log)


def _draw_tracking(axes: Axes, log: TrialLog) -> None:
    """Draw the tracking error over time, with a tick for every replan."""
    stride = max(1, log.steps.time_s.size // MOST_POINTS)
    error_m = np.linalg.norm(log.steps.position_m - log.steps.reference_position_m, axis=-1)
    axes.plot(log.steps.time_s[::stride], error_m[::stride], color=style.BLUE, lw=1.1)
    size_pt = plan_view.marker_size_pt(log) - 1.5
    for replan in replanning.failed(log):
        replan_marks.draw_above(axes, replan.time_s, replan_marks.failed_marker(replan.cause, size_pt))
    replan_marks.draw_replans(axes, log, size_pt)
    axes.set_ylim(bottom=0.0)
    axes.set(xlabel="time [s]", ylabel="tracking error [m]")
    _finish_panel(axes, log, legend=False)


def _finish_panel(axes: Axes, log: TrialLog, *, legend: bool = True) -> None:
    axes.grid(visible=True)
    axes.spines[["top", "right"]].set_visible(False)
    end_s = float(log.steps.time_s[-1]) if log.steps.time_s.size else 0.0
    axes.set_xlim(0.0, max(end_s, 1.0))
    if log.steps.time_s.size < 2:
        axes.text(0.5, 0.5, "no flight", transform=axes.transAxes, ha="center", va="center", color="#606060")
    elif legend:
        columns = 5 if axes.get_position().width > 0.6 else 3
        axes.legend(
            loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, handlelength=1.6, borderaxespad=0.1
        )


def _handles(world: World, log: TrialLog) -> list[Line2D | Patch]:
    low_m, high_m = plan_view.band_m(world)
    # a judged recording has no shortest path, no plans and no map
    shortest = Line2D([], [], color=style.BLACK, lw=0.9, ls="--", label="true shortest path (3D)")
    plans = Line2D([], [], color=style.SKY, lw=1.0, label="plans")
    mapped = Line2D([], [], color=style.MAPPED, marker="s", ls="", ms=3, mew=0, label="mapped there")
    return [
        Line2D([], [], color=plan_view.SPEED_COLOURS(0.7), lw=2.2, label="flown"),
        *([shortest] if len(world.shortest_path) > 1 else []),
        *([plans] if any(len(replan.trajectory_m) for replan in log.replans) else []),
        Patch(color=style.SURFACE, label=f"true, z {low_m:.1f} to {high_m:.1f} m"),
        Patch(color=style.SOLID, label="solid or shut off there"),
        *([mapped] if len(log.mapped_m) else []),
        Line2D([], [], color="white", marker="o", ls="", mec=style.BLACK, mew=1.3, ms=7, label="start"),
        Line2D(
            [], [], color=style.YELLOW, marker="*", ls="", mec=style.BLACK, mew=0.8, ms=12, label="target"
        ),
        *search_view.handles(world, log),
        *_event_handles(log),
    ]


def _draw_legend(
    sheet: Page, handles: list[Line2D | Patch], corner: tuple[float, float], columns: int
) -> None:
    sheet.figure.legend(
        handles=handles,
        loc="upper left",
        bbox_to_anchor=corner,
        ncols=columns,
        handlelength=1.5,
        labelspacing=0.35,
        borderaxespad=0.0,
    )


def _event_handles(log: TrialLog) -> list[Line2D]:
    """One entry per cause that occurred, in order of first occurrence, with its count."""
    taken = Counter(replan.cause for replan in replanning.executed(log))
    failed = len(replanning.failed(log))
    handles = [
        Line2D([], [], label=f"replan: {cause} ({count})", **replan_marks.marker(cause, 8.0))
        for cause, count in taken.items()
    ]
    if failed:
        hollow: dict[str, Any] = {"marker": "o", "mfc": "white", "mec": "#606060", "mew": 1.2, "ms": 6.5}
        handles.append(Line2D([], [], ls="", label=f"hollow: no plan found ({failed})", **hollow))
    return [*handles, *plan_view.contact_handles(log)]


def _draw_header(sheet: Page, world: World, log: TrialLog, metrics: Values, title: str) -> None:
    """Write what was flown, how it ended, the key numbers, and the command that repeats it."""
    height_in = sheet.figure.get_figheight()
    left = LEFT_IN / WIDTH_IN
    names = [str(metrics[name]) for name in ("strategy",) if name in metrics] + [world.name]
    names += [f"seed {metrics['seed']}"] if "seed" in metrics else []
    ending = str(metrics.get("outcome", log.outcome)) + (
        f" ({textwrap.shorten(log.reason, 80, placeholder=' …')})" if log.reason else ""
    )
    head = f"{' · '.join(names)}: {ending}"
    sheet.figure.text(left, 1.0 - 0.23 / height_in, head, fontsize=12, fontweight="bold", va="center")
    inspects = inspection_view.is_inspection(log)
    numbers = inspection_view.key_numbers(log) if inspects else _key_numbers(metrics)
    numbers = "    ".join((numbers, *movers_view.key_numbers(metrics)))
    size = min(9.0, 9.0 * 140 / len(numbers))
    sheet.figure.text(left, 1.0 - 0.43 / height_in, numbers, fontsize=size, va="center")
    command = textwrap.shorten(title, 170, placeholder=" …")
    size = min(8.0, 8.0 * 150 / max(len(command), 1))
    look: dict[str, Any] = {"fontsize": size, "family": "DejaVu Sans Mono", "color": "#505050"}
    sheet.figure.text(left, 1.0 - 0.59 / height_in, command, va="center", **look)


def _key_numbers(metrics: Values) -> str:
    def value(name: str, digits: int, unit: str = "") -> str:
        number = _number(metrics, name)
        return f"{number:.{digits}f}{unit}" if math.isfinite(number) else "–"

    return "    ".join(
        (
            f"path {value('path_length_m', 1, ' m')} (shortest {value('shortest_path_m', 1, ' m')})",
            f"time {value('completion_time_s', 1, ' s')}",
            f"contacts {value('collision_count', 0)}",
            f"least clearance {value('min_clearance_m', 2, ' m')}",
            f"replans {value('replans', 0)}",
            f"tracking RMSE {value('tracking_error_m', 3, ' m')}",
        )
    )
