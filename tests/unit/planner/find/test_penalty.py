"""What a cell's clearance adds to a way through it, by hand."""

from __future__ import annotations

import pytest

from uavexp.planner.find.grid_search import ClearanceRule, penalty

RULE = ClearanceRule(least_m=0.25, safe_m=0.75, scale=2.0, weight=3.0, start_m=0.1, reach2=9.0)


@pytest.mark.parametrize(
    ("clearance_m", "expected"),
    [
        (0.80, 0.0),
        (0.75, 0.0),
        (0.50, 3.0 * 0.5**2),
        (0.25, 3.0 * 1.0**2),
        (0.15, 3.0 * 1.2**2 + 20.0),  # below the limit, next to a start that is there too
    ],
)
def test_a_narrow_cell_costs_the_square_of_what_it_lacks_and_one_below_the_limit_much_more(
    clearance_m: float, expected: float
) -> None:
    assert penalty(clearance_m, RULE) == pytest.approx(expected)
