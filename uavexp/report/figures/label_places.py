"""Where the labels of points stand so that none lies on another, on a point or on a line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.patheffects import withStroke

from uavexp.arrays import Float
from uavexp.report.figures import base

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MARKER_PT = 4.0  # half the edge of a marker
_SAME_PT = 8.0  # points of one curve that are nearer have one label
_WIDTH_EM, _HEIGHT_EM = 0.64, 1.1  # of a letter, at most
_DISTANCES_PT = (8.0, 14.0, 22.0, 32.0)  # of a label from its point
_ANGLES = np.deg2rad([45.0, -45.0, 135.0, -135.0, 0.0, 180.0, 90.0, -90.0])
_STEP_PT = 4.0  # between places on a line that labels keep off
_FAR_PT = 0.5  # area that a label pays for each pt of its distance


@dataclass(frozen=True, slots=True)
class Labelled:
    """The points of one curve, in the order they are joined, and what each is called."""

    points: Float  # (N, 2) in data coordinates
    names: tuple[str, ...]
    colour: str
    lines: Float  # (L, 2, 2) straight ones that are drawn: through the points, intervals


def write_labels(axes: Axes, curves: Sequence[Labelled]) -> None:
    """Write every label beside its point, with a line to it where it stands apart.

    The axes must have their final place and scale.
    """
    to_pt = 72.0 / axes.figure.dpi
    placed_pt = [axes.transData.transform(curve.points) * to_pt for curve in curves]
    frame_pt = np.array(axes.bbox.extents) * to_pt
    taken = [box for points_pt in placed_pt for box in _around(points_pt)]
    for curve in curves:
        ends_pt = axes.transData.transform(curve.lines.reshape(-1, 2)) * to_pt
        taken += [box for begin, end in ends_pt.reshape(-1, 2, 2) for box in _along(begin, end)]
    for points_pt, curve in zip(placed_pt, curves, strict=True):
        for place_pt, point, text in _merged(points_pt, curve):
            offset_pt, box = _best_offset(place_pt, text, taken, frame_pt)
            taken.append(box)
            _write(axes, text, point, offset_pt, curve.colour)


def _merged(points_pt: Float, curve: Labelled) -> list[tuple[Float, Float, str]]:
    """Place, point and text of each label; neighbours on a curve that nearly coincide share one."""
    groups: list[list[int]] = []
    for index, place_pt in enumerate(points_pt):
        near = groups and float(np.linalg.norm(place_pt - points_pt[groups[-1][0]])) < _SAME_PT
        groups[-1].append(index) if near else groups.append([index])
    return [
        (points_pt[group[0]], curve.points[group[0]], _text([curve.names[index] for index in group]))
        for group in groups
        if any(curve.names[index] for index in group)
    ]


def _text(names: Sequence[str]) -> str:
    return f"{names[0]} to {names[-1]}" if len(names) > 2 else ", ".join(names)


def _around(points_pt: Float) -> list[Float]:
    return [np.concatenate([point - _MARKER_PT, point + _MARKER_PT]) for point in points_pt]


def _along(begin_pt: Float, end_pt: Float) -> list[Float]:
    """Small boxes on a line."""
    steps = max(2, int(np.linalg.norm(end_pt - begin_pt) / _STEP_PT))
    points_pt = begin_pt + np.linspace(0.0, 1.0, steps)[:, None] * (end_pt - begin_pt)
    return [np.concatenate([point - 1.0, point + 1.0]) for point in points_pt]


def _best_offset(place_pt: Float, text: str, taken: Sequence[Float], frame_pt: Float) -> tuple[Float, Float]:
    """Middle of a label from its point, and the box it fills: of all places the one that covers least."""
    half = 0.5 * base.SMALL_PT * np.array([_WIDTH_EM * len(text), _HEIGHT_EM])
    ways = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
    others = np.array(taken)
    best, least = (np.zeros(2), np.zeros(4)), np.inf
    for distance_pt in _DISTANCES_PT:
        for way in ways:
            offset_pt = way * (distance_pt + half * np.abs(way) - 0.5 * _MARKER_PT)
            box = np.concatenate([place_pt + offset_pt - half, place_pt + offset_pt + half])
            outside = 4.0 * half[0] * half[1] - _overlaps(box, frame_pt[None])[0]
            cost = _overlaps(box, others).sum() + 4.0 * outside + _FAR_PT * distance_pt
            if cost < least:
                best, least = (offset_pt, box), float(cost)
    return best


def _overlaps(box: Float, others: Float) -> Float:
    """Areas (N,) that a box (4,) shares with others (N, 4): left, bottom, right, top."""
    edges = np.minimum(box[2:], others[:, 2:]) - np.maximum(box[:2], others[:, :2])
    return np.asarray(np.prod(np.maximum(edges, 0.0), axis=1))


def _write(axes: Axes, text: str, point: Float, offset_pt: Float, colour: str) -> None:
    is_far = float(np.linalg.norm(offset_pt)) > 2.0 * _DISTANCES_PT[0]
    note = axes.annotate(
        text, (float(point[0]), float(point[1])), (float(offset_pt[0]), float(offset_pt[1])),
        textcoords="offset points", ha="center", va="center", fontsize=base.SMALL_PT, color=colour,
        arrowprops={"arrowstyle": "-", "lw": 0.4, "color": base.GREY, "shrinkA": 0.0} if is_far else None,
    )  # fmt: skip
    note.set_path_effects([withStroke(linewidth=1.2, foreground="white")])
    note.set_in_layout(False)  # a label at the edge must not shrink the plane
