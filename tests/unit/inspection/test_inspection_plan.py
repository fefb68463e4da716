"""Whole plans: every reachable cell is seen, every viewpoint visited once, nothing depends on chance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.inspections import START_M, building, surface_in
from uavexp.inspection.inspection_plan import InspectionPlan, Settings, adapt_order, plan_inspection
from uavexp.inspection.visibility import Camera

HALL = building()
SURFACE = surface_in(HALL)


def plan(settings: Settings | None = None, camera: Camera | None = None) -> InspectionPlan:
    return plan_inspection(SURFACE, HALL.field, camera or Camera(), START_M, HALL.flight_bounds_m, settings)


PLAN = plan()


def test_the_viewpoints_see_all_that_can_be_seen() -> None:
    assert PLAN.coverable.mean() > 0.97
    assert PLAN.planned_coverage > 0.99


def test_each_viewpoint_is_visited_once_and_can_be_reached() -> None:
    assert sorted(PLAN.order) == list(range(len(PLAN.viewpoints)))
    assert np.isfinite(PLAN.travel_m).all()
    assert (HALL.field.distance_m(PLAN.viewpoints.position_m) >= 0.45).all()


def test_the_default_lengthens_the_tour_by_five_percent_at_most() -> None:
    assert -1.0 < PLAN.statistics.lengthening <= 0.05 + 1e-9
    assert PLAN.statistics.reordered_switches <= PLAN.statistics.tour_switches


def test_the_same_reference_gives_the_same_plan() -> None:
    again = plan()
    assert again.clusters == PLAN.clusters
    assert again.viewpoints.position_m.tobytes() == PLAN.viewpoints.position_m.tobytes()


@pytest.mark.parametrize("settings", [Settings(clearance_m=1.9), Settings(clearance_m=50.0)])
def test_a_vehicle_that_fits_nowhere_gets_an_empty_plan(settings: Settings) -> None:
    empty = plan(settings)
    assert len(empty.viewpoints) == 0
    assert empty.clusters == ()
    assert empty.statistics.tour_m == 0.0
    assert not empty.coverable.any()


def test_segments_too_small_for_a_viewpoint_are_seen_by_others() -> None:
    coarse = plan(Settings(growing=replace(Settings().growing, min_area_m2=1e3)))
    assert coarse.segments == ()
    assert coarse.planned_coverage > 0.99


def test_the_order_changes_only_when_it_is_worth_it() -> None:
    order = PLAN.order
    there = PLAN.viewpoints.position_m[order[0]]
    kept = adapt_order(PLAN, order, [int(order[0])], [], there)
    assert np.array_equal(kept, order[1:])
    backwards = adapt_order(PLAN, order[::-1], [], [int(order[3])], START_M)
    assert sorted(backwards) == sorted(set(order) - {order[3]})
    assert len(adapt_order(PLAN, order, order, [], there)) == 0
    lost = adapt_order(PLAN, order[::-1], [], [], np.array([99.0, 0.0, 0.0]))
    assert np.array_equal(lost, order[::-1])
