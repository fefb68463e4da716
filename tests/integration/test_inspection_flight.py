"""A whole inspection, flown for real in one small building, and its picture."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest

import uavexp
from uavexp.report.picture import draw
from uavexp.types import Outcome

ROOM = {"world": "rooms", "world.size_m": [6.0, 4.6, 2.6], "mission": "inspect", "mission.blocks": 1}


@pytest.fixture(scope="module")
def flown() -> Any:
    return uavexp.fly(**{**ROOM, "seed": 101})


def test_it_sees_nearly_all_that_can_be_seen_without_contact(flown: Any) -> None:
    assert flown.log.outcome is Outcome.INSPECTED
    assert flown.metrics["success"] is True
    assert flown.metrics["coverage_visible"] > 0.98
    assert 0.95 < flown.metrics["coverage_truth"] <= 1.0
    assert flown.metrics["scene_kind"] == "blocks"


def test_cells_are_seen_while_it_flies(flown: Any) -> None:
    seen_s = flown.log.inspection.cell_seen_s[np.isfinite(flown.log.inspection.cell_seen_s)]
    assert seen_s.min() == 0.0
    assert seen_s.max() <= flown.log.steps.time_s[-1]


def test_it_was_at_every_visited_viewpoint_with_its_yaw_free(flown: Any) -> None:
    log = flown.log
    visited = np.isfinite(log.inspection.viewpoint_visited_s)
    assert visited.sum() >= 0.7 * len(visited)
    row = np.round(log.inspection.viewpoint_visited_s[visited] / log.step_s).astype(int)
    away_m = np.linalg.norm(log.steps.position_m[row] - log.inspection.viewpoint_m[visited], axis=1)
    assert away_m.max() <= 0.35 + 1e-6


def test_the_picture_is_the_same_every_time(flown: Any) -> None:
    pictures = [io.BytesIO(), io.BytesIO()]
    for file in pictures:
        draw(flown.world, flown.log, flown.metrics, "python -m uavexp mission=inspect", file)
    assert pictures[0].getvalue() == pictures[1].getvalue()
    assert pictures[0].getvalue().startswith(b"\x89PNG")
