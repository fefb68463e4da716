"""What a picture shows of the search: the frontier of the final map, and the goals in their order."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from tests.logs import make_log, make_replan, make_world, still_curve
from uavexp.log import MapGrid, TrialLog
from uavexp.report import search_view

WORLD = make_world([], target_m=(9.0, 6.0, 1.2))
PATH = np.zeros((2, 3), dtype=np.float32)


def flight(goals_x_m: list[float], free: np.ndarray) -> TrialLog:
    grid = MapGrid(
        origin_m=np.array([0.0, 0.0, 1.0]),
        voxel_size_m=0.5,
        shape=np.array(free.shape),
        free=np.packbits(free.ravel()),
        occupied_s=np.zeros(1, dtype=np.float32),
    )
    replans = tuple(
        make_replan(float(n), "goal", goal_m=np.array([x, 6.0, 1.2]), trajectory_m=PATH)
        for n, x in enumerate(goals_x_m)
    )
    still = still_curve()
    log = make_log(still, still, replans=replans, mapped_m=np.array([[2.25, 0.25, 1.25]], np.float32))
    return TrialLog(**{name: getattr(log, name) for name in log.__slots__} | {"grid": grid})


def test_the_frontier_is_free_beside_what_was_never_seen() -> None:
    """A row of cells: free, free, free, never seen, occupied, free."""
    free = np.array([1, 1, 1, 0, 0, 1], dtype=np.bool_).reshape(6, 1, 1)
    found = search_view.frontier_m(flight([], free), 1.2)
    np.testing.assert_allclose(found, [[1.25, 0.25]])
    assert search_view.frontier_m(flight([], free), 9.0).shape == (0, 2)


def test_goals_are_numbered_in_their_order_without_the_target_and_repetitions() -> None:
    log = flight([3.0, 3.1, 5.0, 9.0], np.ones((6, 1, 1), dtype=np.bool_))
    assert [replan.goal_m[0] for replan in search_view.chosen_goals(WORLD, log)] == [3.0, 5.0]
    axes = Figure().add_subplot()
    search_view.draw(axes, WORLD, log)
    assert [text.get_text() for text in axes.texts] == ["1", "2"]
    assert [handle.get_label() for handle in search_view.handles(WORLD, log)] == ["goals in their order (2)"]
