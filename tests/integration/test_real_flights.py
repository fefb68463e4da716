"""Flights through buildings that nobody here made; skipped where the shared data is absent."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import uavexp
from tests.folders import SHARED as DATA
from uavexp.types import Outcome

pytestmark = pytest.mark.skipif(
    not (DATA / "MANIFEST.json").exists(), reason="../shared/data with the real buildings is absent"
)


def fly(world_id: str, pair_number: int, **values: Any) -> Any:
    items = json.loads((DATA / "MANIFEST.json").read_text())["items"]
    item = next(item for item in items if item["id"] == world_id)
    pair = item["start_goal_pairs"][pair_number]
    building = {
        "world": "file",
        "world.path": str(DATA / item["folder"] / "mesh.ply"),
        "world.start_m": pair["start"],
        "world.target_m": pair["goal"],
        "world.flight_bounds_m": item["flight_bounds"],
    }
    return uavexp.fly(**building, strategy="mcr", seed=0, **values)


@pytest.mark.parametrize(
    ("world_id", "pair"), [("falcon_complex_office", 2), ("fuel_pillar", 1), ("intel_lab_25d", 2)]
)
def test_mcr_reaches_the_target_without_contact(world_id: str, pair: int) -> None:
    trial = fly(world_id, pair)
    assert trial.log.outcome is Outcome.REACHED
    assert trial.metrics["collision_count"] == 0
    assert trial.metrics["tracking_error_m"] < 0.08
    straight_m = np.linalg.norm(trial.world.target_m - trial.world.start_m)
    assert trial.metrics["path_length_m"] >= straight_m - 0.3 - 0.05
    inside = trial.world.flight_bounds_m + np.array([[-0.1], [0.1]])
    assert (trial.log.steps.position_m >= inside[0]).all()
    assert (trial.log.steps.position_m <= inside[1]).all()
