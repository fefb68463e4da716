"""Buildings and maps that nobody here made, against the path lengths of their manifest."""

import json
from typing import Any

import numpy as np
import pytest

from tests.folders import SHARED as DATA
from uavexp.errors import WorldError
from uavexp.geometry import polyline_length_m
from uavexp.scene import Scene
from uavexp.types import World
from uavexp.world.file import File
from uavexp.world.shortest import make_nodes, shortest_lattice_path

MANIFEST = DATA / "MANIFEST.json"
pytestmark = pytest.mark.skipif(not MANIFEST.is_file(), reason=f"no third-party worlds in {DATA}")


def items() -> list[dict[str, Any]]:
    if not MANIFEST.is_file():
        return []
    return [item for item in json.loads(MANIFEST.read_text())["items"] if item["type"] == "world"]


PAIRS = [(item, pair) for item in items() for pair in item["start_goal_pairs"]]
NAMES = [f"{item['id']}-{pair['tag']}" for item, pair in PAIRS]
UNMAPPED = {"octomap_freiburg079"}  # its reference paths keep to measured free space, the mesh does not


def read(item: dict[str, Any], pair: dict[str, Any], **parameters: Any) -> World:
    options = {
        "path": str(DATA / item["folder"] / "mesh.ply"),
        "start_m": pair["start"],
        "target_m": pair["goal"],
        "flight_bounds_m": item["flight_bounds"],
    }
    return File(**(options | parameters)).generate(np.random.default_rng(0))


@pytest.mark.parametrize(("item", "pair"), PAIRS, ids=NAMES)
def test_every_pair_is_joined_and_no_longer_than_the_reference(
    item: dict[str, Any], pair: dict[str, Any]
) -> None:
    clearance = min(0.35, pair["bottleneck_clearance_m"] - 0.03)
    world = read(item, pair, clearance_m=clearance)
    length = world.difficulty.shortest_path_m
    assert pair["straight_line_m"] - 1e-3 <= length
    assert length <= pair["shortcut_path_m"] + 0.01  # found with more clearance, so no shorter
    path = world.shortest_path
    along = np.linspace(0.0, 1.0, 300)[:, None, None]
    points = (path[:-1] + along * np.diff(path, axis=0)).reshape(-1, 3)
    assert Scene(world).distance_m(points).min() >= clearance - 1e-4


@pytest.mark.parametrize(("item", "pair"), PAIRS, ids=NAMES)
def test_lattice_optimum_equals_the_reference(item: dict[str, Any], pair: dict[str, Any]) -> None:
    if item["id"] in UNMAPPED and pair["tag"] == "max_detour":
        pytest.skip("the reference path was restricted to measured free space")
    clearance, cell = pair["path_clearance_used_m"], item["grid_resolution_m"]
    scene = Scene(read(item, pair, clearance_m=0.2))
    bounds = np.array(item["flight_bounds"], dtype=float)
    nodes = make_nodes(scene.grid, bounds, cell, clearance)
    path = shortest_lattice_path(nodes, clearance, np.array(pair["start"]), np.array(pair["goal"]))
    assert polyline_length_m(path) == pytest.approx(pair["grid26_shortest_m"], abs=1e-3)


def test_a_pair_too_narrow_for_the_clearance_names_the_clearance_at_which_it_is_joined() -> None:
    item, pair = next((i, p) for i, p in PAIRS if i["id"] == "ifc_duplex" and p["tag"] == "max_detour")
    with pytest.raises(WorldError, match=r"joined at 0\.43\d m: world\.clearance_m=0\.43"):
        read(item, pair, clearance_m=0.45)


@pytest.mark.parametrize(
    ("folder", "name"),
    [
        ("intel_lab_25d", "map.yaml"),
        ("fuel_pillar", "voxels.npz"),
        ("fuel_pillar", "orig/pillar.pcd"),
        ("falcon_darpa_tunnel", "voxels.npz"),
        ("octomap_freiburg079", "voxels.npz"),
    ],
)
def test_other_formats_of_a_building_agree_with_its_mesh(folder: str, name: str) -> None:
    item, pair = next((i, p) for i, p in PAIRS if i["id"] == folder and p["tag"] == "random_medium")
    clearance = min(0.35, pair["bottleneck_clearance_m"] - 0.03)
    path = str(DATA / item["folder"] / name)
    mesh = read(item, pair, clearance_m=clearance)
    other = read(item, pair, clearance_m=clearance, path=path, unknown="free")
    assert other.difficulty.shortest_path_m == pytest.approx(mesh.difficulty.shortest_path_m, rel=0.01)
