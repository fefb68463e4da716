"""Draw starts and targets in every building and map of ../shared/data:
`python -m benchmarks.drawn_ends [draws]`.

Prints one row per file, and how many of the drawn places lie outside of measured free space, told by what
the drawing does not use: a place in a map or voxel file is looked up in the cells as they were read; one in a
mesh or cloud has to be joined, with 0.2 m of clearance, with a place that the manifest says is free. Where
there is no such independent truth, only the clearance of 0.35 m is held against the triangles. Files without
room for a task are named with their reason.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from uavexp.arrays import Bool, Float
from uavexp.errors import UavexpError, one_line
from uavexp.formats import FREE, READERS, Cells
from uavexp.world.file import File
from uavexp.world.free_parts import free_parts
from uavexp.world.survey import Survey, drawn_ends

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
FOLDERS = ("worlds", "worlds_extra", "ros_maps", "barn", "clouds", "floorplans", "gazebo", "voxel_path")
LEAST_M = 3.0  # between start and target: some maps are small
LARGEST_BYTES = 30_000_000


def main(draws: int) -> int:
    """Draw, print, and return 1 when a place is wrong."""
    manifest = json.loads((DATA / "MANIFEST.json").read_text())["items"]
    places = {
        item["folder"]: np.array(
            [pair[end] for pair in item["start_goal_pairs"] for end in ("start", "goal")]
        )
        for item in manifest
        if item["type"] == "world"
    }
    table = Table("file", "kind", "drawn", "wrong", "held against", box=None)
    total = wrong = 0
    for path in _files():
        name = str(path.relative_to(DATA))
        known = next((free for folder, free in places.items() if name.startswith(folder + "/")), None)
        try:
            survey = File(path=str(path)).survey()
            ends = np.array(
                [drawn_ends(survey, None, LEAST_M, np.random.default_rng(n)) for n in range(draws)]
            )
        except UavexpError as error:
            table.add_row(name, "-", "-", "-", one_line(error).replace(str(path), path.name)[:100])
            continue
        good, by = _judged(survey, ends.reshape(-1, 3), known)
        total, wrong = total + good.size, wrong + int(np.count_nonzero(~good))
        table.add_row(name, survey.content.kind, str(good.size), str(np.count_nonzero(~good)), by)
    Console(width=200).print(table)
    sys.stdout.write(f"{total} drawn starts and targets, {wrong} outside measured free space\n")
    return int(wrong > 0)


def _files() -> list[Path]:
    found = [path for folder in FOLDERS for path in sorted((DATA / folder).rglob("*")) if path.is_file()]
    return [
        path
        for path in found
        if path.suffix.lower() in READERS
        and path.suffix.lower() not in (".txt", ".dae")
        and path.stat().st_size <= LARGEST_BYTES
        and not any(part in ("models", "res") for part in path.parts)
    ]


def _judged(survey: Survey, points: Float, known: Float | None) -> tuple[Bool, str]:
    """Which places (N, 3) are free by a truth that the drawing does not use, and by which one."""
    clear: Bool = survey.scene.distance_m(points) >= 0.35 - 1e-4
    cells = survey.content.cells
    if cells is not None and cells.is_plan:
        return clear & _measured(cells, points), "the map's cells"
    if cells is not None and (cells.state == FREE).any() and (cells.state == 0).any():
        return clear & _measured(cells, points), "the file's measured cells"
    if known is not None:
        parts = free_parts(survey.scene, survey.flight_bounds_m, 0.2, survey.building.space)
        joined = np.unique(parts.number_at(known - survey.building.origin_m))
        return clear & np.isin(parts.number_at(points), joined[joined > 0]), "places of the manifest"
    return clear, "triangles only"


def _measured(cells: Cells, points: Float) -> Bool:
    """Whether cells that hold points (N, 3) were measured free; z does not matter in a plan."""
    c, s = math.cos(cells.yaw_rad), math.sin(cells.yaw_rad)
    x, y, z = (points - cells.origin).T
    index = np.floor(np.column_stack([c * x + s * y, c * y - s * x, z]) / cells.size).astype(np.int64)
    if cells.is_plan:
        index[:, 2] = 0
    inside: Bool = ((index >= 0) & (index < cells.state.shape)).all(axis=1)
    free = np.zeros(len(points), dtype=np.bool_)
    free[inside] = cells.state[tuple(index[inside].T)] == FREE
    return free


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 6))
