"""Problems of the voxel path benchmark (Brewer and Sturtevant 2018) against their published optima.

MAP is a .3dmap, or an npz with `size` (3,) and `blocked` (N, 3) cells; SCENARIOS.3dscen has two lines
of heading, then a line for each problem: start and goal cell, optimal cost, and a ratio that is not used.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from uavexp import formats
from uavexp.arrays import Bool, Float
from uavexp.errors import UavexpError
from uavexp.planner.find.voxels.voxel_grid import VoxelGrid

_COLUMNS = 8
_TOLERANCE = 1e-6  # voxels; costs are printed with 8 decimals


class BenchmarkError(UavexpError):
    """A map or a scenario file cannot be used."""


def read_map(path: Path) -> Bool:
    """Free cells (X, Y, Z) of a map file: .3dmap, or another format of `uavexp.formats` that has cells."""
    cells = formats.read(path, formats.Options()).cells
    if cells is None or cells.is_plan:
        raise BenchmarkError(f"{path}: no voxels in it; a .3dmap, or an npz with size and blocked, is needed")
    free: Bool = cells.state == formats.FREE
    return free


def read_scenarios(path: Path, free: Bool) -> Float:
    """Problems (N, 7): start and goal cell, optimal cost."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BenchmarkError(f"{path}: cannot be read ({_line(error)})") from None
    if not lines or not lines[0].startswith("version"):
        raise BenchmarkError(f"{path}: a scenario file begins with the line 'version 1'")
    problems = []
    for number, line in enumerate(lines[2:], start=3):
        if not line.strip():
            continue
        try:
            row = [float(word) for word in line.split()]
        except ValueError:
            row = []
        cells = np.array(row[:6])
        if len(row) != _COLUMNS or not np.isfinite(row).all() or (cells != np.floor(cells)).any():
            raise BenchmarkError(f"{path}: line {number} is not six cells, a cost and a ratio")
        ends = cells.astype(np.int64).reshape(2, 3)
        if ((ends < 0) | (ends >= free.shape)).any() or not free[tuple(ends.T)].all():
            raise BenchmarkError(f"{path}: line {number} starts or ends outside the map or in a blocked cell")
        problems.append(row[:7])
    if not problems:
        raise BenchmarkError(f"{path}: no problem in it")
    return np.array(problems)


def solve(free: Bool, problems: Float) -> dict[str, float | int]:
    """Solve problems (N, 7) and count those with the published cost."""
    grid = VoxelGrid(free)
    ends = problems[:, :6].astype(np.int64).reshape(-1, 2, 3)
    grid.shortest(*ends[0])  # compiles or loads the kernels, untimed
    optimal, expansions, laps_s = 0, 0, []
    for (start, goal), cost in zip(ends, problems[:, 6], strict=True):
        began_s = time.perf_counter()
        answer = grid.shortest(start, goal)
        laps_s.append(time.perf_counter() - began_s)
        optimal += abs(answer.cost - cost) <= _TOLERANCE
        expansions += answer.expansions
    return {
        "problems": len(problems),
        "optimal": int(optimal),
        "expansions": int(expansions),
        "median_ms": round(1e3 * float(np.median(laps_s)), 4),
    }


def main(arguments: Sequence[str]) -> int:
    """Print one line of JSON; 0 when every cost is the published one, 1 when not, 2 for bad input."""
    parser = argparse.ArgumentParser(prog="python -m uavexp.planner.astar", description=__doc__)
    parser.add_argument("map", type=Path, help="MAP.3dmap or MAP.npz")
    parser.add_argument("scenarios", type=Path, help="SCENARIOS.3dscen")
    parser.add_argument("--limit", type=int, help="problems, spread evenly over the file (default: all)")
    options = parser.parse_args(arguments)
    try:
        if options.limit is not None and options.limit < 1:
            raise BenchmarkError(f"--limit must be >= 1, got {options.limit}")
        free = read_map(options.map)
        problems = read_scenarios(options.scenarios, free)
        if options.limit is not None and options.limit < len(problems):
            spread = np.linspace(0, len(problems) - 1, options.limit).round().astype(int)
            problems = problems[spread]
        answer = solve(free, problems)
    except (UavexpError, MemoryError) as error:
        sys.stderr.write(f"error: {_line(error)}\n")
        return 2
    sys.stdout.write(json.dumps(answer) + "\n")
    return 0 if answer["optimal"] == answer["problems"] else 1


def _line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
