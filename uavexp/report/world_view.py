"""The picture of a world before anything flies in it: what was understood, from above and from the side."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from uavexp.arrays import Bool, Float, UInt8
from uavexp.report import plan_view, style
from uavexp.space import FREE, OUTSIDE, SOLID, SURFACE, UNMEASURED, Space

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DPI = 120
WIDTH_IN, LEAST_IN, MOST_IN = 10.0, 1.2, 8.0  # of the figure; least and most height of a section
MARGIN_IN, GAP_IN, LINE_IN = 0.6, 0.55, 0.17  # left and right; between sections; of a line of text
MOST_CELLS = 1000  # of a section along its longer side
LEAST_CELL_M = 0.02
JOINED = 5  # beside the states of space: free, and joined with the largest part
LOOK = {
    JOINED: ("#CBE8D5", "free and joined"),
    FREE: ("#FFFFFF", "free, but not joined or too tight"),
    SURFACE: ("#4A4A4A", "surface"),
    SOLID: ("#9A9A9A", "solid"),
    UNMEASURED: ("#E3D0EA", "never measured"),
    OUTSIDE: ("#DCE9F3", "outside"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """What is drawn of a world; lengths in m."""

    space: Space
    is_joined: Callable[[Float], Bool]  # whether points (N, 3) belong to the largest free part (N,)
    box_m: Float  # (2, 3) of the geometry
    flight_bounds_m: Float  # (2, 3)
    middle_m: Float  # (3,) through which the two sections go
    ends_m: Float  # (2, 3) start and target; (0, 3): none
    path_m: Float  # (P, 3) shortest path; (0, 3): none


def draw(shown: Shown, title: str, facts: Sequence[str], warnings: Sequence[str], path: Path) -> None:
    """Write the picture as a PNG.

    Args:
        shown: the world.
        title: what was read, in bold.
        facts: a line each.
        warnings: a sentence each; wrapped.
        path: of the file.
    """
    told = [line for warning in warnings for line in textwrap.wrap(f"! {warning}", 150)]
    size_m = np.diff(shown.box_m, axis=0)[0]
    along = int(size_m[1] > size_m[0])  # the building's longer side, from left to right in both sections
    width_in = WIDTH_IN - 2.0 * MARGIN_IN
    plan_in = float(np.clip(width_in * size_m[1 - along] / size_m[along], LEAST_IN, MOST_IN))
    side_in = float(np.clip(width_in * size_m[2] / size_m[along], LEAST_IN, 0.5 * MOST_IN))
    head_in = 0.45 + LINE_IN * (len(facts) + len(told)) + 0.7
    height_in = head_in + plan_in + GAP_IN + side_in + 0.55
    with style.house_style():
        figure = Figure(figsize=(WIDTH_IN, height_in))
        FigureCanvasAgg(figure)
        _write(figure, title, facts, told)
        left, wide = MARGIN_IN / WIDTH_IN, width_in / WIDTH_IN
        plan = figure.add_axes((left, 1.0 - (head_in + plan_in) / height_in, wide, plan_in / height_in))
        side = figure.add_axes((left, 0.5 / height_in, wide, side_in / height_in))
        states = _draw_section(plan, shown, (along, 1 - along)) | _draw_section(side, shown, (along, 2))
        plan.set_title(f"plan at z = {shown.middle_m[2]:.2f} m", loc="left", fontsize=8)
        across = "xy"[1 - along]
        where = f"section at {across} = {shown.middle_m[1 - along]:.2f} m; ends and path are projected"
        side.set_title(where, loc="left", fontsize=8)
        figure.legend(
            handles=_handles(shown, states),
            loc="upper left",
            bbox_to_anchor=(left, 1.0 - (head_in - 0.66) / height_in),
            ncols=5,
            borderaxespad=0.0,
            handlelength=1.3,
        )
        figure.savefig(path, dpi=DPI, format="png", metadata={"Software": None})


def _write(figure: Figure, title: str, facts: Sequence[str], told: Sequence[str]) -> None:
    height_in, left = figure.get_figheight(), MARGIN_IN / WIDTH_IN
    figure.text(left, 1.0 - 0.22 / height_in, title, fontsize=12, fontweight="bold", va="center")
    for number, line in enumerate([*facts, *told]):
        look: dict[str, Any] = {"color": style.VERMILLION} if number >= len(facts) else {}
        figure.text(
            left, 1.0 - (0.45 + LINE_IN * number) / height_in, line, fontsize=8.5, va="center", **look
        )


def _draw_section(axes: Axes, shown: Shown, plane: tuple[int, int]) -> set[int]:
    """Draw the section along two axes through the middle; the states that it shows."""
    states, extent = _section(shown, plane)
    order = list(LOOK)
    numbers = np.searchsorted(np.sort(order), states)
    axes.imshow(
        numbers.T,
        cmap=ListedColormap([LOOK[state][0] for state in sorted(order)]),
        vmin=-0.5,
        vmax=len(order) - 0.5,
        origin="lower",
        extent=extent,
        interpolation="antialiased",
        interpolation_stage="rgba",  # blend colours, never the states themselves
        zorder=0,
    )
    u, v = plane
    low_m, high_m = shown.flight_bounds_m
    axes.add_patch(
        Rectangle(
            (low_m[u], low_m[v]),
            high_m[u] - low_m[u],
            high_m[v] - low_m[v],
            fill=False,
            ec=style.BLUE,
            lw=0.8,
            ls=(0, (1, 2)),
            zorder=3,
        )
    )
    if len(shown.path_m):
        axes.plot(shown.path_m[:, u], shown.path_m[:, v], "--", color=style.BLACK, lw=1.2, zorder=4)
    for place, marker in zip(shown.ends_m, _END_LOOKS, strict=False):
        axes.plot(place[u], place[v], ls="", zorder=5, **marker)
    plan_view.frame(axes, shown.box_m[:, list(plane)])
    axes.set(xlabel=f"{'xyz'[u]} [m]", ylabel=f"{'xyz'[v]} [m]", anchor="NW")
    if plane == (1, 0):
        axes.invert_yaxis()  # a plan that is turned, not mirrored
    return set(np.unique(states).tolist())


def _section(shown: Shown, plane: tuple[int, int]) -> tuple[UInt8, tuple[float, float, float, float]]:
    """States (U, V) of a plane through the middle over the geometry's box, and its extent."""
    low_m, high_m = shown.box_m[:, list(plane)]
    cell_m = max(LEAST_CELL_M, float(np.max(high_m - low_m)) / MOST_CELLS)
    counts = np.maximum(1, np.ceil((high_m - low_m) / cell_m).astype(np.int64))
    u, v = (low_m[axis] + (np.arange(counts[axis]) + 0.5) * cell_m for axis in (0, 1))
    places = np.empty((counts[0], counts[1], 3))
    places[:] = shown.middle_m
    places[..., plane[0]], places[..., plane[1]] = u[:, None], v[None, :]
    flat = places.reshape(-1, 3)
    states = shown.space.state_at(flat)
    states[shown.is_joined(flat) & (states != SURFACE) & (states != SOLID)] = JOINED
    upper_m = low_m + counts * cell_m
    return states.reshape(counts), (low_m[0], upper_m[0], low_m[1], upper_m[1])


_END_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": "white", "marker": "o", "mec": style.BLACK, "mew": 1.5, "ms": 8},
    {"color": style.YELLOW, "marker": "*", "mec": style.BLACK, "mew": 0.9, "ms": 14},
)


def _handles(shown: Shown, states: set[int]) -> list[Line2D | Patch]:
    lines: list[Line2D | Patch] = [
        Patch(facecolor=colour, edgecolor=style.FAINT, label=words)
        for state, (colour, words) in LOOK.items()
        if state in states
    ]
    lines.append(Line2D([], [], color=style.BLUE, lw=0.8, ls=(0, (1, 2)), label="flight bounds"))
    if len(shown.path_m):
        lines.append(Line2D([], [], color=style.BLACK, lw=1.2, ls="--", label="shortest path"))
    for look, words in zip(_END_LOOKS, ("start", "target"), strict=True) if len(shown.ends_m) else ():
        lines.append(Line2D([], [], ls="", label=words, **look))
    return lines
