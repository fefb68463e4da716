"""What every kind of cell is worth to the camera."""

from __future__ import annotations

import numpy as np

from uavexp.inspection.reference_surface import Surface
from uavexp.inspection.view_angle import Weights, cell_weights
from uavexp.inspection.visibility import Views


def test_cells_of_every_blocked_viewpoint_gain_weight_but_those_that_were_seen() -> None:
    cells = 8
    surface = Surface(
        point_m=np.zeros((cells, 3)), normal=np.zeros((cells, 3)), area_m2=np.linspace(0.1, 0.8, cells),
        curvature=np.zeros(cells),
    )  # fmt: skip
    views = Views(np.array([0, 2, 4, 6]), np.array([0, 1, 2, 3, 4, 5], dtype=np.int32))
    blocked, scanned = np.array([True, False, True]), np.array([False, True] + 6 * [False])
    worth = cell_weights(surface, views, blocked, scanned, Weights(occluded=5.0, plain=1.0, scanned=0.0))
    assert np.allclose(worth, surface.area_m2 * [5.0, 0.0, 1.0, 1.0, 5.0, 5.0, 1.0, 1.0])
