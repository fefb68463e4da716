"""Tours within 1 % of the proven optimum on every TSPLIB instance; skipped where the data is absent."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests.folders import SHARED as DATA
from uavexp.inspection.tour import closed_tour, tour_length
from uavexp.inspection.tsplib import read


def instances() -> list[dict[str, Any]]:
    manifest = DATA / "MANIFEST.json"
    items = json.loads(manifest.read_text())["items"] if manifest.exists() else []
    return [one for item in items if item["type"] == "tsp" for one in item["instances"]]


@pytest.mark.skipif(not (DATA / "tsplib").is_dir(), reason="../shared/data/tsplib is absent")
def test_every_instance_has_its_optimum_in_the_manifest() -> None:
    assert {one["name"] for one in instances()} == {file.stem for file in (DATA / "tsplib").glob("*.tsp")}


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("one", instances(), ids=lambda one: str(one["name"]))
def test_a_tour_is_within_one_percent_of_the_optimum(one: dict[str, Any], seed: int) -> None:
    cost = read(DATA / "tsplib" / f"{one['name']}.tsp")
    length = tour_length(cost, closed_tour(cost, seed), closed=True)
    assert one["optimal_length"] <= length <= 1.01 * one["optimal_length"]
