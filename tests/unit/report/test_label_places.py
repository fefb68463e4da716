"""Labels of points: each is written once, none on another, none on a point, all inside of the axes."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from uavexp.report.figures import base
from uavexp.report.figures.label_places import Labelled, write_labels

LINES = np.zeros((0, 2, 2))


def boxes_of(points: np.ndarray, names: tuple[str, ...]) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Texts, their boxes (N, 4) in pixels, and the frame."""
    figure = base.new_figure(3.5, 3.0)
    axes = figure.subplots()
    axes.plot(*points.T, "o")
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    figure.draw_without_rendering()
    write_labels(axes, [Labelled(points, names, "black", LINES)])
    renderer = figure.canvas.get_renderer()
    found = np.array([text.get_window_extent(renderer).extents for text in axes.texts])
    return [text.get_text() for text in axes.texts], found, np.array(axes.bbox.extents)


def shared_px2(one: np.ndarray, other: np.ndarray) -> float:
    edges = np.minimum(one[2:], other[2:]) - np.maximum(one[:2], other[:2])
    return float(np.prod(np.maximum(edges, 0.0)))


@pytest.mark.parametrize("seed", range(5))
def test_no_label_lies_on_another_or_beyond_the_frame(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(0.35, 0.65, (8, 2))
    texts, boxes, frame = boxes_of(points, tuple(f"{number / 10:g}" for number in range(1, 9)))
    assert sum(len(text.split(", ")) for text in texts if " to " not in text) <= 8
    for one, other in combinations(boxes, 2):
        assert shared_px2(one, other) == 0.0
    assert (boxes[:, :2] >= frame[:2] - 1.0).all()
    assert (boxes[:, 2:] <= frame[2:] + 1.0).all()


def test_points_that_coincide_share_a_label() -> None:
    points = np.array([[0.5, 0.5], [0.501, 0.5], [0.5, 0.501], [0.9, 0.5]])
    assert boxes_of(points, ("1", "2", "5", "9"))[0] == ["1 to 5", "9"]
    assert boxes_of(points[1:], ("1", "2", "9"))[0] == ["1, 2", "9"]


def test_a_point_without_a_name_has_no_label() -> None:
    assert boxes_of(np.array([[0.5, 0.5]]), ("",))[0] == []
