"""Movers in the picture of a flight: where they went, where they were predicted, how near they came."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import patheffects
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb, to_rgba
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Rectangle

from uavexp.arrays import Bool, Float
from uavexp.bodies import distance_m, present
from uavexp.log import Replan, TrialLog
from uavexp.metrics.tracking_movers import GATE_M, near_miss_spans
from uavexp.report import style
from uavexp.types import Bodies, Shape

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CAUSE = "risk"  # of replans that a prediction led to
HORIZON_S = 1.2  # paper 2 predicts so far ahead
MOST_PREDICTIONS = 12  # replans whose predictions are drawn
NEAR_M = 5.0  # predictions farther from the vehicle are not drawn: 4 m/s towards each other over the horizon
HIGHEST_M = 4.0  # the clearance panel is made no higher than this to show the nearest approach
MOST_POINTS = 1000  # of a mover's path
_DOTS_S = np.array([0.3, 0.6, 0.9, HORIZON_S])
_FASTEST_MPS = 10.0  # what is faster did not move there: a recording began anew
_FADED, _FADES_S = 0.12, 30.0  # opacity of a path so long before the end or at take-off; 1 at the end
_AT_END: dict[str, Any] = {"fc": to_rgba(style.PURPLE, 0.6), "ec": style.BLACK, "lw": 0.7}
_HALO = (patheffects.withStroke(linewidth=2.0, foreground="white"),)


def draw(axes: Axes, log: TrialLog) -> None:
    """Draw the movers' paths, fading into the past, their last outlines, and the predictions."""
    for mover in range(log.movers.shape.size):
        _draw_path(axes, log, mover)
    if log.movers.shape.size and log.steps.time_s.size:
        look: dict[str, Any] = {**_AT_END, "zorder": 4.6}
        for left in np.flatnonzero(present(log.movers.position_m[-1])):
            axes.add_patch(outline(log, -1, int(left), **look))
    for number, replan in enumerate(predictive(log), start=1):
        _draw_prediction(axes, log, number, replan)


def draw_near_misses(axes: Axes, log: TrialLog, near_miss_m: float) -> None:
    """Draw every near miss to scale: the limit around the vehicle, and the mover then inside it."""
    look: dict[str, Any] = {"ec": style.VERMILLION, "lw": 1.2}
    for row in near_miss_rows(log, near_miss_m):
        place = (float(log.steps.position_m[row, 0]), float(log.steps.position_m[row, 1]))
        mover = nearest_mover(log, row)
        axes.add_patch(outline(log, row, mover, fc=to_rgba(style.VERMILLION, 0.3), zorder=7.2, **look))
        axes.add_patch(Circle(place, near_miss_m, fc="none", ls=(0, (2, 1)), zorder=7.3, **look))


def draw_clearance(axes: Axes, log: TrialLog, near_miss_m: float) -> None:
    """Draw the distance to the nearest mover over time; far ones leave the panel at the top."""
    if not np.isfinite(log.movers.clearance_m).any():
        return
    limited = math.isfinite(near_miss_m)
    stride = max(1, log.steps.time_s.size // 4000)
    distances_m = np.where(np.isfinite(log.movers.clearance_m), log.movers.clearance_m, np.nan)
    nearest_m = 1.2 * float(np.nanmin(distances_m))
    wanted_m = (nearest_m if nearest_m <= HIGHEST_M else 0.0, 2.0 * near_miss_m if limited else 0.0)
    top_m = max(axes.get_ylim()[1], *wanted_m)
    time_s = log.steps.time_s[::stride]
    axes.plot(time_s, distances_m[::stride], color=style.WINE, lw=1.3, label="nearest mover")
    if limited:
        axes.axhline(
            near_miss_m, color=style.WINE, lw=0.8, ls=(0, (1, 1.5)), label=f"near miss, {near_miss_m:g} m"
        )
    axes.set_ylim(top=top_m)


def handles(log: TrialLog, near_miss_m: float) -> list[Line2D | Patch]:
    """Legend of the movers, with counts; nothing for a flight without."""
    count = int(present(log.movers.position_m).any(axis=0).sum()) if log.movers.shape.size else 0
    if not count:
        return []
    left = int(present(log.movers.position_m[-1]).sum())
    shown: list[Line2D | Patch] = [
        Line2D([], [], color=style.PURPLE, lw=1.6, label=f"movers, past fades ({count})"),
        Patch(label=f"movers at the end ({left})", **_AT_END),
    ]
    replans = predictive(log)
    if replans:
        asked = sum(replan.cause == CAUSE for replan in log.replans)
        number = f"{len(replans)}" if len(replans) == asked else f"{len(replans)} of {asked}"
        label = f"predicted over {HORIZON_S:g} s, numbered as its replan ({number})"
        shown.append(Line2D([], [], label=label, **_line_look(is_true=True)))
    false = sum(int(np.count_nonzero(~predicted(log, replan)[2])) for replan in replans)
    if false:
        shown.append(Line2D([], [], label=f"no mover was there ({false})", **_line_look(is_true=False)))
    touched = sum(contact.mover >= 0 for contact in log.contacts)
    if touched:
        look = style.contact_marker(with_mover=True, size_pt=8.0)
        shown.append(Line2D([], [], label=f"mover contact ({touched})", **look))
    missed = len(near_miss_rows(log, near_miss_m))
    if missed:
        look = {"mfc": "none", "mec": style.VERMILLION, "mew": 1.2, "ms": 9}
        shown.append(
            Line2D([], [], marker="o", ls="", label=f"near miss, {near_miss_m:g} m ({missed})", **look)
        )
    return shown


def key_numbers(metrics: Mapping[str, bool | int | float | str]) -> tuple[str, ...]:
    """What the header says of the movers; nothing for a flight without."""
    if "min_mover_clearance_m" not in metrics:
        return ()
    least_m = float(metrics["min_mover_clearance_m"])
    return (
        f"nearest mover {least_m:.2f} m" if math.isfinite(least_m) else "nearest mover –",
        f"near misses {int(metrics['near_misses'])}",
    )


def predictive(log: TrialLog) -> tuple[Replan, ...]:
    """The most urgent replans that a prediction led to, in order of time.

    None within the horizon of a more urgent one: their predictions would lie on each other.
    """
    chosen: list[Replan] = []
    for replan in sorted(log.replans, key=lambda replan: -replan.score):
        apart = all(abs(replan.time_s - other.time_s) >= HORIZON_S for other in chosen)
        if replan.cause == CAUSE and apart and len(chosen) < MOST_PREDICTIONS:
            chosen.append(replan)
    return tuple(sorted(chosen, key=lambda replan: replan.time_s))


def predicted(log: TrialLog, replan: Replan) -> tuple[Float, Float, Bool]:
    """The tracks near the vehicle when a replan was asked for.

    Returns:
        Believed positions and velocities (N, 3), and whether (N,) a mover was within the gate of
        `metrics.tracking_movers`; a track of none is false.
    """
    positions_m, velocities_mps = tracks_at(log, replan.time_s)
    near = np.linalg.norm(positions_m - replan.position_m, axis=1) < NEAR_M
    time_s = log.steps.time_s
    row = min(int(np.searchsorted(time_s, replan.time_s - 0.5 * log.step_s)), time_s.size - 1)
    movers_m = log.movers.position_m[row].astype(np.float64)
    apart_m = np.linalg.norm(positions_m[near, None] - movers_m[None], axis=2)
    return positions_m[near], velocities_mps[near], apart_m.min(axis=1, initial=np.inf) <= GATE_M


def tracks_at(log: TrialLog, time_s: float) -> tuple[Float, Float]:
    """Believed positions and velocities (N, 3) of the movers at the last ESDF update until a time."""
    tick = int(np.searchsorted(log.ticks.tick_s, time_s + 0.5 * log.step_s, side="right")) - 1
    if not 0 <= tick < log.tracks.count.size:
        return np.zeros((0, 3)), np.zeros((0, 3))
    end = int(log.tracks.count[: tick + 1].sum())
    mine = slice(end - int(log.tracks.count[tick]), end)
    return log.tracks.position_m[mine], log.tracks.velocity_mps[mine]


def near_miss_rows(log: TrialLog, near_miss_m: float) -> tuple[int, ...]:
    """Row of the least distance in each near miss, as `metrics.tracking_movers` counts them."""
    spans = near_miss_spans(log.steps.time_s, log.movers.clearance_m, log.contacts, near_miss_m)
    return tuple(int(first + np.argmin(log.movers.clearance_m[first : last + 1])) for first, last in spans)


def nearest_mover(log: TrialLog, row: int) -> int:
    """The mover whose surface is nearest to the vehicle in a row of the log."""
    apart_m = [
        float(distance_m(_body(log, row, mover), log.steps.position_m[row, None])[0])
        for mover in range(log.movers.shape.size)
    ]
    return int(np.argmin(apart_m))


def outline(log: TrialLog, row: int, mover: int, **look: Any) -> Patch:
    """A mover from above, to scale, where it is in a row of the log."""
    x_m, y_m, _ = (float(value) for value in log.movers.position_m[row, mover])
    half_x_m, half_y_m, _ = (float(value) for value in log.movers.half_size_m[mover])
    if log.movers.shape[mover] == Shape.BOX:
        return Rectangle((x_m - half_x_m, y_m - half_y_m), 2.0 * half_x_m, 2.0 * half_y_m, **look)
    return Circle((x_m, y_m), half_x_m, **look)


def _body(log: TrialLog, row: int, mover: int) -> Bodies:
    one = slice(mover, mover + 1)
    return Bodies(
        time_s=float(log.steps.time_s[row]),
        shape=log.movers.shape[one],
        half_size_m=log.movers.half_size_m[one],
        position_m=log.movers.position_m[row, one].astype(np.float64),
        velocity_mps=np.zeros((1, 3)),
    )


def _draw_path(axes: Axes, log: TrialLog, mover: int) -> None:
    stride = max(1, log.steps.time_s.size // MOST_POINTS)
    time_s, places_m = log.steps.time_s[::stride], log.movers.position_m[::stride, mover]
    there = present(places_m)
    speed_mps = np.linalg.norm(np.diff(places_m, axis=0), axis=1) / np.diff(time_s)
    drawn = there[1:] & there[:-1] & (speed_mps < _FASTEST_MPS)
    if not drawn.any():
        return
    segments = np.stack([places_m[:-1, :2], places_m[1:, :2]], axis=1)[drawn]
    colours = np.tile([*to_rgb(style.PURPLE), 1.0], (len(segments), 1))
    age = (time_s[-1] - time_s[1:])[drawn] / min(time_s[-1] - time_s[0], _FADES_S)
    colours[:, 3] = 1.0 - (1.0 - _FADED) * np.minimum(age, 1.0)
    lines = LineCollection(list(segments), colors=colours, linewidths=1.3, capstyle="butt", zorder=1.9)
    axes.add_collection(lines, autolim=False)


def _draw_prediction(axes: Axes, log: TrialLog, number: int, replan: Replan) -> None:
    """Draw where the tracks were believed to go when a replan was asked for, with its number at both."""
    for place_m, velocity_mps, is_true in zip(*predicted(log, replan), strict=True):
        ahead_m = place_m[:2] + _DOTS_S[:, None] * velocity_mps[:2]
        line_m = np.stack([place_m[:2], ahead_m[-1]])
        look = _line_look(is_true)
        axes.plot(line_m[:, 0], line_m[:, 1], zorder=6.2, path_effects=_HALO, **(look | {"marker": ""}))
        axes.plot(ahead_m[:, 0], ahead_m[:, 1], zorder=6.3, **(look | {"ls": ""}))
        _write_number(axes, number, ahead_m[-1])
    axes.plot(*replan.position_m[:2], ".", color=style.WINE, ms=5, zorder=6.3)
    _write_number(axes, number, replan.position_m)


def _line_look(is_true: bool) -> dict[str, Any]:
    """Line2D settings of a prediction: dashed with hollow dots where no mover was."""
    shape = {"ls": "-", "mfc": style.WINE} if is_true else {"ls": (0, (1.5, 1.0)), "mfc": "white"}
    return {"color": style.WINE, "lw": 1.2, "marker": "o", "ms": 3.0, "mew": 0.6, **shape}


def _write_number(axes: Axes, number: int, place_m: Float) -> None:
    axes.annotate(
        str(number),
        (float(place_m[0]), float(place_m[1])),
        (4, 4),
        textcoords="offset points",
        fontsize=7,
        fontweight="bold",
        color=style.WINE,
        path_effects=_HALO,
        clip_on=True,
        zorder=7.5,
    )
