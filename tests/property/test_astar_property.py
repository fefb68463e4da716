"""Whatever the grid: plain A* is exact, and improved A* solves what can be solved."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.voxel_paths import is_path, random_grid, shortest
from uavexp.planner.find.turning import Form, HorizontalCount, Turning, VerticalRule
from uavexp.planner.find.voxels.voxel_grid import VoxelGrid

SHAPES = st.tuples(st.integers(1, 7), st.integers(1, 7), st.integers(1, 7))


@settings(max_examples=150, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), shape=SHAPES, density=st.floats(0.0, 0.7))
def test_plain_is_exact_and_symmetric(seed: int, shape: tuple[int, int, int], density: float) -> None:
    free, start, goal = random_grid(np.random.default_rng(seed), shape, density)
    grid = VoxelGrid(free)
    there, back = (grid.shortest(np.array(a), np.array(b)) for a, b in ((start, goal), (goal, start)))
    least = shortest(free, start, goal)
    assert there.found == np.isfinite(least)
    if there.found:
        assert abs(there.cost - least) < 1e-9
        assert abs(back.cost - least) < 1e-9
        assert is_path(free, there.cells)


def test_improved_solves_every_solvable_query_of_thousands() -> None:
    rng = np.random.default_rng(11)
    finders = [
        Turning(form=form, vertical_rule=rule, n_horizontal=count)
        for form in Form
        for rule in VerticalRule
        for count in HorizontalCount
    ]
    solvable = 0
    for n in range(3000):
        shape = tuple(int(v) for v in rng.integers(2, 9, 3))
        free, start, goal = random_grid(rng, shape, float(rng.uniform(0.0, 0.6)))
        grid, ends = VoxelGrid(free), (np.array(start), np.array(goal))
        finder = finders[n % len(finders)]
        answer, remark = finder.search(grid, *ends, finder.wish(0.1))
        plain = grid.shortest(*ends)
        assert answer.found == plain.found
        if answer.found:
            solvable += 1
            assert tuple(answer.cells[0]) == start
            assert tuple(answer.cells[-1]) == goal
            assert answer.cost >= plain.cost - 1e-9 or remark
    assert solvable > 1500
