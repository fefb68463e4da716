"""Triangles cover a polygon once, neither less nor more."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uavexp.errors import WorldError
from uavexp.formats import polygons

HERE = Path("here")
L_SHAPE = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]]  # area 3
ARROW = [[0, 0], [2, 1], [0, 2], [0.5, 1]]  # a quad with a notch; area 1.5
KEYHOLE = [[0, 0], [3, 0], [3, 3], [0, 3], [0, 0], [1, 1], [1, 2], [2, 2], [2, 1], [1, 1]]  # a ring: 9 - 1


def areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Signed areas of triangles in the plane."""
    a, b, c = (points[triangles[:, corner], :2] for corner in range(3))
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def check_covers(outline: np.ndarray, triangles: np.ndarray) -> None:
    """No triangle is turned over and together they have the outline's area (shoelace formula)."""
    x, y = outline[:, 0], outline[:, 1]
    expected = 0.5 * float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
    found = areas(outline, triangles)
    assert triangles.shape[0] == outline.shape[0] - 2
    assert (found >= -1e-9).all()
    assert found.sum() == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("outline", [L_SHAPE, ARROW, KEYHOLE], ids=["L", "arrow", "keyhole"])
@pytest.mark.parametrize("shift", range(4))
def test_concave_polygons_are_covered_once(outline: list[list[float]], shift: int) -> None:
    flat = np.roll(np.array(outline, dtype=float), shift, axis=0)
    points = np.column_stack([flat, np.zeros(len(flat))])
    triangles = polygons.triangulate(HERE, points, np.arange(len(flat)), np.array([len(flat)]))
    check_covers(points, triangles)


@settings(max_examples=100, deadline=None)
@given(radii=st.lists(st.floats(0.2, 2.0), min_size=4, max_size=30), turn=st.floats(0.0, 6.0))
def test_star_shaped_polygons_are_covered_once(radii: list[float], turn: float) -> None:
    angle = 2.0 * np.pi * np.arange(len(radii)) / len(radii)
    points = np.array(radii)[:, None] * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    triangles = polygons.triangulate(HERE, points, np.arange(len(radii)), np.array([len(radii)]))
    check_covers(points, triangles)
    c, s = np.cos(turn), np.sin(turn)
    tilted = points @ np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])  # cut alike or not, as large
    again = tilted[polygons.triangulate(HERE, tilted, np.arange(len(radii)), np.array([len(radii)]))]
    area = 0.5 * np.linalg.norm(np.cross(again[:, 1] - again[:, 0], again[:, 2] - again[:, 0]), axis=1).sum()
    assert area == pytest.approx(areas(points, triangles).sum(), rel=1e-6)


def test_polygons_of_every_number_of_corners_are_cut_together() -> None:
    angle = 2.0 * np.pi * np.arange(7) / 7
    points = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    counts = np.array([3, 7, 2, 4, 0, 3])
    corners = np.concatenate([np.arange(count) for count in counts])
    assert polygons.triangulate(HERE, points, corners, counts).shape == (1 + 5 + 2 + 1, 3)


def test_strips_turn_alike_and_begin_anew() -> None:
    square = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], dtype=float)
    assert (areas(square, polygons.strip(np.array([0, 1, 2, 3]))) == 0.5).all()
    two = polygons.strip(np.array([0, 1, 2, -1, 1, 3, 0, 2]))
    assert (areas(square, two) == 0.5).all()
    assert two.shape == (3, 3)
    assert polygons.strip(np.array([0, 1, 1, 2])).shape == (0, 3)  # degenerate ones join strips
    assert polygons.strip(np.array([0, 1])).shape == (0, 3)
    np.testing.assert_array_equal(polygons.fan(np.array([0, 1, 3, 2])), [[0, 1, 3], [0, 3, 2]])


@pytest.mark.parametrize("wrong", [-1, 3, 2**40])
def test_an_index_beyond_the_vertices_is_named(wrong: int) -> None:
    with pytest.raises(WorldError, match=f"here is damaged.*vertex {wrong} of 3"):
        polygons.triangulate(HERE, np.zeros((3, 3)), np.array([0, 1, wrong]), np.array([3]))


def test_a_polygon_of_too_many_corners_is_refused() -> None:
    count = polygons.MAX_CORNERS + 1
    with pytest.raises(WorldError, match="triangulate it"):
        polygons.triangulate(HERE, np.zeros((1, 3)), np.zeros(count, dtype=np.int64), np.array([count]))
