"""The interactive view of a flight: what the page's script draws, as plain data."""

from __future__ import annotations

import base64
import gzip
import json
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from uavexp.arrays import Float, Int
from uavexp.bodies import present
from uavexp.causes import cause_named
from uavexp.log import Replan, TrialLog
from uavexp.metrics import path, replanning, tracking
from uavexp.report.flights import RULE, SharedWorld, scene_at, shared_world, three_arms
from uavexp.report.looks import looks_of
from uavexp.report.results import Results
from uavexp.report.search_view import chosen_goals, frontier_m
from uavexp.types import World

MOST_POINTS = 600  # of a path
_ABOVE_FLIGHT_M = 0.3  # the map is cut here at first, so that one looks into the rooms
# the shapes that plotly has in three dimensions, by marker
_SYMBOLS = {"^": "diamond", "D": "circle", "s": "square", "X": "x", "o": "circle-open"}
_OTHER_SYMBOL = "cross"

Json = dict[str, Any]


def section(results: Results) -> str:
    """The part of the page with the flights of one world.

    Raises:
        RecordError: no such flights are stored, or they are damaged.
    """
    shared = shared_world(results, three_arms(results), scene_at(results, "first"))
    script = plotly_file()
    if script is None:
        return (
            "<p>This view needs plotly where the report is made: <code>pip install plotly</code>, then "
            "<code>python -m uavexp.report</code> with this folder again.</p>"
        )
    data = json.dumps(payload(results, shared), sort_keys=True, separators=(",", ":"), allow_nan=False)
    data = data.replace("<", "\\u003c")  # nothing in it may end the script element or begin a comment
    buttons = "\n".join(f'<button data-arm="{escape(arm)}">{escape(arm)}</button>' for arm in shared.logs)
    asset = Path(__file__).with_name("assets") / "flight3d.js"
    return f"""<p>{escape(_caption(shared))}</p>
<div class="controls">
{buttons}
<label>map up to <input id="cut" type="range" step="0.1"> <output id="cut-m"></output></label>
</div>
<p id="headline"></p>
<div id="flight"></div>
<script type="application/json" id="flights">{data}</script>
<script type="text/plain" id="plotly-gz">{_packed(script.read_bytes())}</script>
<script>
{asset.read_text(encoding="utf-8")}</script>"""


def _caption(shared: SharedWorld) -> str:
    return (
        f"The same world for every strategy ({shared.where}; {RULE}). Coloured: what the vehicle's map "
        "held as occupied at the end, cut above the flight. Line: flown path; dashes: reference; markers: "
        "replans by cause. Drag to turn, scroll to zoom, hover for numbers."
    )


def plotly_file() -> Path | None:
    """Plotly's script, if the package is installed (it comes with Open3D)."""
    spec = find_spec("plotly")
    if spec is None or spec.origin is None:
        return None
    file = Path(spec.origin).parent / "package_data" / "plotly.min.js"
    return file if file.is_file() else None


def _packed(data: bytes) -> str:
    return base64.b64encode(gzip.compress(data, compresslevel=9, mtime=0)).decode("ascii")


def payload(results: Results, shared: SharedWorld) -> Json:
    """What the script draws.

    Args:
        results: of the study.
        shared: the world and its flights.

    Returns:
        Plain data; lengths in m, times in s.
    """
    world = shared.world
    looks = looks_of(results, results.arms)
    return {
        "start": _numbers(world.start_m),
        "target": _numbers(world.target_m),
        "shortest": _axes(world.shortest_path),
        "cut_m": round(float(world.start_m[2]) + _ABOVE_FLIGHT_M, 1),
        "height_m": _numbers(world.bounds_m[:, 2]),
        "flights": [
            {"arm": arm, "colour": looks[arm].colour, **_flight(world, log)}
            for arm, log in shared.logs.items()
        ],
    }


def _flight(world: World, log: TrialLog) -> Json:
    stride = max(1, -(-log.steps.time_s.size // MOST_POINTS))
    rows = np.unique(np.append(np.arange(0, log.steps.time_s.size, stride), log.steps.time_s.size - 1))
    speed_mps = np.linalg.norm(log.steps.velocity_mps[rows], axis=1)
    error_m = tracking.distances_m(log.steps.position_m, log.steps.reference_position_m)[rows]
    hover = [
        f"{time:.1f} s<br>{speed:.2f} m/s<br>clearance {clearance:.2f} m<br>tracking error {error:.3f} m"
        for time, speed, clearance, error in zip(
            log.steps.time_s[rows], speed_mps, log.steps.clearance_m[rows], error_m, strict=True
        )
    ]
    return {
        "headline": _headline(log),
        "flown": _axes(log.steps.position_m[rows]),
        "hover": hover,
        "reference": _axes(log.steps.reference_position_m[rows]),
        "contacts": _axes(np.array([contact.position_m for contact in log.contacts]).reshape(-1, 3)),
        "replans": [_replan(number, replan) for number, replan in enumerate(replanning.executed(log), 1)],
        "goals": _axes(np.array([replan.goal_m for replan in chosen_goals(world, log)]).reshape(-1, 3)),
        "frontier": _frontier(log, float(world.start_m[2])),
        "map": voxels(log.mapped_m),
        **({"movers": _movers(log, rows[::3])} if log.movers.shape.size else {}),
    }


def _frontier(log: TrialLog, height_m: float) -> list[list[float]]:
    """The frontier that the flight left at a height, thinned."""
    cells_m = frontier_m(log, height_m)
    cells_m = cells_m[:: max(1, -(-len(cells_m) // MOST_POINTS))]
    return _axes(np.column_stack([cells_m, np.full(len(cells_m), height_m)]))


def _movers(log: TrialLog, rows: Int) -> Json:
    """Paths of all movers one after the other, null where one is not there, and their last places."""
    places_m = log.movers.position_m[rows].astype(np.float64)
    there = present(places_m)
    broken_m = np.pad(
        np.where(there[..., None], places_m, np.nan), ((0, 1), (0, 0), (0, 0)), constant_values=np.nan
    )
    paths = broken_m.transpose(2, 1, 0).reshape(3, -1)
    return {
        "count": int(there.any(axis=0).sum()),
        "paths": [[None if np.isnan(value) else round(float(value), 3) for value in axis] for axis in paths],
        "last": _axes(places_m[-1, there[-1]]),
    }


def _headline(log: TrialLog) -> str:
    return (
        f"{log.outcome}: {path.path_length_m(log):.1f} m in {path.completion_time_s(log):.1f} s, "
        f"{len(replanning.executed(log))} replans, {len(log.contacts)} contacts, least clearance "
        f"{log.steps.clearance_m.min():.2f} m"
    )


def _replan(number: int, replan: Replan) -> Json:
    cause = cause_named(replan.cause)
    moved = f"<br>path moved by {replan.path_change_m:.2f} m" if np.isfinite(replan.path_change_m) else ""
    changed = f"<br>{len(replan.changed_m)} changed voxels" if len(replan.changed_m) else ""
    return {
        "at": _numbers(replan.position_m),
        "cause": replan.cause,
        "colour": cause.colour,
        "symbol": _SYMBOLS.get(cause.marker, _OTHER_SYMBOL),
        "hover": f"replan {number}: {replan.cause}<br>{replan.time_s:.1f} s{moved}{changed}",
    }


def voxels(mapped_m: Any) -> Json:
    """Occupied voxels as whole numbers on their grid.

    Args:
        mapped_m: centres (N, 3) on a regular grid.

    Returns:
        `size_m`, `origin_m` (centre of voxel 0, 0, 0) and `index`: all x, then all y, then all z as
        little-endian int16, packed by gzip and base64.
    """
    centres_m = np.asarray(mapped_m, dtype=np.float64).reshape(-1, 3)
    if not len(centres_m):
        return {"size_m": 0.1, "origin_m": [0.0, 0.0, 0.0], "index": _packed(b"")}
    origin_m = centres_m.min(axis=0)
    size_m = _spacing_m(centres_m)
    index = np.unique(np.rint((centres_m - origin_m) / size_m).astype("<i2"), axis=0)
    return {
        "size_m": round(size_m, 4),
        "origin_m": _numbers(origin_m),
        "index": _packed(index.T.tobytes()),
    }


def _spacing_m(centres_m: Float) -> float:
    """Edge of a voxel: the least distance of two different coordinates."""
    gaps_m = np.concatenate([np.diff(np.unique(np.round(axis, 3))) for axis in centres_m.T])
    return float(np.round(gaps_m.min(), 3)) if gaps_m.size else 0.1


def _axes(points_m: Float) -> list[list[float]]:
    """Points (N, 3) as three lists, mm."""
    return [_numbers(axis) for axis in np.asarray(points_m).reshape(-1, 3).T]


def _numbers(values: Any) -> list[float]:
    return [round(float(value), 3) for value in values]
