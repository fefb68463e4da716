"""Where the parts of a trial's picture stand on the page, in inches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH_IN = 11.0
LEFT_IN, RIGHT_IN, BOTTOM_IN, HEADER_IN = 0.6, 0.25, 0.5, 0.68
PANEL_IN, PANEL_GAP_IN = 1.35, 0.16
LEGEND_IN, AXIS_LABEL_IN = 0.62, 0.42
LEGEND_ROW_IN = 0.16
PLAN_HEIGHT_IN = (2.2, 6.6)  # least and greatest
SIDE_PLAN_HEIGHT_IN, SIDE_PLAN_WIDTH_IN = 7.0, 5.6
COLUMN_GAP_IN = 0.75
BAR_IN = 1.7


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """A figure with its four parts."""

    figure: Figure
    plan: Axes
    clearance: Axes
    tracking: Axes
    speed_bar: Axes
    legend_corner: tuple[float, float]  # upper left, share of the figure
    legend_columns: int
    movers_corner: tuple[float, float]  # of the movers' own legend
    movers_columns: int


def lay_out(size_m: tuple[float, float], mover_entries: int = 0) -> Page:
    """Return a page for a plan of this size: panels below a wide plan, beside a tall one.

    Args:
        size_m: width and height of the plan.
        mover_entries: of the movers' legend, which stands above the other one.
    """
    aspect = size_m[1] / size_m[0]
    return _below(aspect, mover_entries) if aspect <= 1.0 else _beside(aspect, mover_entries)


def _below(aspect: float, mover_entries: int) -> Page:
    width = WIDTH_IN - LEFT_IN - RIGHT_IN
    plan = min(max(width * aspect, PLAN_HEIGHT_IN[0]), PLAN_HEIGHT_IN[1])
    clearance_y = BOTTOM_IN + PANEL_IN + PANEL_GAP_IN
    legend_y = clearance_y + PANEL_IN + 0.3
    legend_top = legend_y + LEGEND_IN
    movers_top = legend_top + LEGEND_ROW_IN * -(-mover_entries // 5)
    plan_y = movers_top + AXIS_LABEL_IN
    figure = Figure(figsize=(WIDTH_IN, plan_y + plan + HEADER_IN))
    return Page(
        figure=figure,
        plan=_axes(figure, LEFT_IN, plan_y, width, plan),
        clearance=_axes(figure, LEFT_IN, clearance_y, width, PANEL_IN),
        tracking=_axes(figure, LEFT_IN, BOTTOM_IN, width, PANEL_IN),
        speed_bar=_axes(figure, WIDTH_IN - RIGHT_IN - BAR_IN, legend_y + 0.4, BAR_IN, 0.1),
        legend_corner=_corner(figure, LEFT_IN - 0.1, legend_top),
        legend_columns=6,
        movers_corner=_corner(figure, LEFT_IN - 0.1, movers_top),
        movers_columns=5,
    )


def _beside(aspect: float, mover_entries: int) -> Page:
    plan_width = min(SIDE_PLAN_HEIGHT_IN / aspect, SIDE_PLAN_WIDTH_IN)
    x = LEFT_IN + plan_width + COLUMN_GAP_IN
    width = WIDTH_IN - RIGHT_IN - x
    movers = LEGEND_ROW_IN * -(-mover_entries // 2)
    panel = 2.2 - 0.5 * movers
    clearance_y = BOTTOM_IN + panel + PANEL_GAP_IN
    top = BOTTOM_IN + SIDE_PLAN_HEIGHT_IN
    figure = Figure(figsize=(WIDTH_IN, top + HEADER_IN))
    return Page(
        figure=figure,
        plan=_axes(figure, LEFT_IN, BOTTOM_IN, plan_width, SIDE_PLAN_HEIGHT_IN),
        clearance=_axes(figure, x, clearance_y, width, panel),
        tracking=_axes(figure, x, BOTTOM_IN, width, panel),
        speed_bar=_axes(figure, x + 0.05, clearance_y + panel + 0.7, BAR_IN, 0.1),
        legend_corner=_corner(figure, x - 0.1, top - 0.05 - movers),
        legend_columns=2,
        movers_corner=_corner(figure, x - 0.1, top - 0.05),
        movers_columns=2,
    )


def _axes(figure: Figure, x: float, y: float, width: float, height: float) -> Axes:
    across, up = figure.get_size_inches()
    return figure.add_axes((x / across, y / up, width / across, height / up))


def _corner(figure: Figure, x: float, y: float) -> tuple[float, float]:
    across, up = figure.get_size_inches()
    return x / across, y / up
