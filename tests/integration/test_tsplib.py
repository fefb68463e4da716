"""Tours within 1 % of the proven optimum on every TSPLIB instance; skipped where the data is absent."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from tests.folders import SHARED as DATA
from uavexp.inspection.tour import closed_tour, tour_length
from uavexp.inspection.tsplib import TsplibError, read

MORE = DATA / "tsplib" / "more" / "archives" / "problems"
needs_more = pytest.mark.skipif(not MORE.is_dir(), reason="../shared/data/tsplib/more is absent")
OPTIMA = {  # as published, one or more of each kind of distance
    "gr17": 2085,  # LOWER_DIAG_ROW
    "bayg29": 1610,  # UPPER_ROW
    "swiss42": 1273,  # FULL_MATRIX
    "att48": 10628,  # ATT
    "hk48": 11461,
    "brazil58": 25395,
    "si175": 21407,  # UPPER_DIAG_ROW
}


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


@needs_more
@pytest.mark.parametrize("name", OPTIMA)
def test_a_tour_over_distances_of_any_kind_is_within_one_percent_of_the_optimum(name: str) -> None:
    cost = read(MORE / "tsp" / f"{name}.tsp")
    length = tour_length(cost, closed_tour(cost, 0), closed=True)
    assert OPTIMA[name] <= length <= 1.01 * OPTIMA[name]


@needs_more
@pytest.mark.parametrize(
    ("name", "optimum"), [("att48", 10628), ("bayg29", 1610), ("bays29", 2020), ("eil51", 426)]
)
def test_a_published_optimal_tour_has_the_published_length(name: str, optimum: int) -> None:
    words = (MORE / "tour" / f"{name}.opt.tour").read_text().split("TOUR_SECTION")[1].split("-1")[0].split()
    cost = read(MORE / "tsp" / f"{name}.tsp")
    assert sorted(map(int, words)) == list(range(1, len(cost) + 1))
    assert tour_length(cost, np.array(words, dtype=np.int64) - 1, closed=True) == optimum


@needs_more
def test_rounded_up_distances_are_those_of_the_formula() -> None:
    node = np.loadtxt(MORE / "tsp" / "dsj1000.tsp", skiprows=6, comments="EOF")[:, 1:]
    cost = read(MORE / "tsp" / "dsj1000.tsp")
    for i, j in [(0, 1), (3, 999), (500, 77)]:
        assert cost[i, j] == np.ceil(np.hypot(*(node[i] - node[j])))


@needs_more
def test_fixed_edges_are_refused() -> None:
    with pytest.raises(TsplibError, match="FIXED_EDGES_SECTION is not read"):
        read(MORE / "tsp" / "linhp318.tsp")
