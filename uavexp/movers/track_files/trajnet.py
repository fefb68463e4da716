"""TrajNet++ (Kothari, Kreiss and Alahi 2021): lines of JSON, scenes and the rows of tracks.

`{"scene": {"fps": 2.5, ...}}` and `{"track": {"f": 780, "p": 1, "x": 8.46, "y": 3.59}}`, in m. The rate is
that of the rows, while frames keep the numbers of a faster video: it is `fps` times the least step from one
frame of a person to the next. Rows that are predictions (`prediction_number`) are left out.
"""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

from uavexp.errors import WorldError
from uavexp.movers.track_files.base import Recording, Row, number, text_of


def read(path: Path) -> Recording:
    """Rows of the tracks."""
    rows: list[Row] = []
    frames: dict[float, set[float]] = {}  # by person
    rates_hz: set[float] = set()
    for place, line in enumerate(text_of(path).splitlines(), start=1):
        item = _parsed(path, place, line) if line.strip() else {}
        scene, track = item.get("scene"), item.get("track")
        if isinstance(scene, dict) and scene.get("fps") is not None:
            rates_hz.add(number(scene["fps"], "fps", path, place))
        if isinstance(track, dict) and track.get("prediction_number") is None:
            person, frame = (number(track.get(name), name, path, place) for name in "pf")
            rows.append((place, f"{person:.17g}", frame, track.get("x"), track.get("y")))
            frames.setdefault(person, set()).add(frame)
    if len(rates_hz) > 1:
        found = ", ".join(f"{rate:g}" for rate in sorted(rates_hz)[:5])
        raise WorldError(f"{path}: its scenes have different rates, {found} fps; make a file of each")
    steps = (b - a for seen in frames.values() for a, b in pairwise(sorted(seen)))
    rate_hz = rates_hz.pop() * min(steps, default=1.0) if rates_hz else None
    return Recording(rows=rows, names=("f", "x", "y"), frame_rate_hz=rate_hz)


def _parsed(path: Path, place: int, line: str) -> dict[str, Any]:
    try:
        item = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise WorldError(f"{path}:{place}: no JSON: {error}") from error
    return item if isinstance(item, dict) else {}
