"""What lies aside: the points within the radius of a place, whenever it was set aside, and no others."""

from __future__ import annotations

import numpy as np

from uavexp.explorer.aside import lie_aside


def test_points_lie_aside_within_the_radius_of_any_place_set_aside() -> None:
    points_m = np.array([[0.0, 0.0, 0.0], [0.29, 0.0, 0.0], [0.31, 0.0, 0.0], [5.0, 5.0, 1.2]])
    places = [(1.0, np.zeros(3)), (9.0, np.array([5.0, 5.0, 1.0]))]
    assert lie_aside(points_m, places, 0.3).tolist() == [True, True, False, True]
    assert lie_aside(points_m, places[:1], 0.3).tolist() == [True, True, False, False]
    assert not lie_aside(points_m, [], 0.3).any()
