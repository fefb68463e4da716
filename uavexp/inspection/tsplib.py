"""TSPLIB files of symmetric tours: EUC_2D and GEO distances (Reinelt 1995, "TSPLIB 95")."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import UavexpError

MAX_NODES = 6000  # the matrix of distances is held whole: 288 MB
_EARTH_KM = 6378.388  # radius, and pi to the digits below: what the published optima were computed with
_PI = 3.141592


class TsplibError(UavexpError):
    """A TSPLIB file is missing, damaged, or of a kind that is not read here."""


def read(path: Path) -> Float:
    """Distances (N, N) of a TSPLIB file, whole numbers.

    Args:
        path: file with EDGE_WEIGHT_TYPE EUC_2D (rounded to the nearest) or GEO.

    Raises:
        TsplibError: in one line.
    """
    kind, node = _parse(path)
    if kind == "EUC_2D":
        apart = np.hypot(*(node[:, None] - node[None]).transpose(2, 0, 1))
        return np.asarray(np.floor(apart + 0.5), dtype=np.float64)
    return _geographic(node)


def _parse(path: Path) -> tuple[str, Float]:
    """Distance kind and coordinates (N, 2)."""
    if not path.is_file():
        raise TsplibError(f"{path} does not exist")
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except UnicodeDecodeError as error:
        raise TsplibError(f"{path} is no text file") from error
    entry: dict[str, str] = {}
    rows: list[list[str]] | None = None
    for line in lines:
        words = line.split()
        if rows is None and ":" in line:
            key, value = line.split(":", 1)
            entry[key.strip().upper()] = value.strip()
        elif words == ["NODE_COORD_SECTION"]:
            rows = []
        elif rows is not None and words:
            if not words[0].isdigit():
                break  # EOF or another section
            rows.append(words)
    kind, count = entry.get("EDGE_WEIGHT_TYPE", ""), entry.get("DIMENSION", "")
    if kind not in ("EUC_2D", "GEO"):
        raise TsplibError(f"{path}: EDGE_WEIGHT_TYPE must be EUC_2D or GEO, got {kind or 'none'}")
    if not count.isdigit() or not 1 <= int(count) <= MAX_NODES:
        raise TsplibError(f"{path}: DIMENSION must be 1 to {MAX_NODES}, got {count or 'none'}")
    if rows is None or len(rows) != int(count):
        raise TsplibError(f"{path}: {count} nodes expected, {len(rows or ())} found")
    try:
        node = np.array([[float(x), float(y)] for _, x, y in rows])
    except ValueError as error:
        raise TsplibError(f"{path}: a node must be a number and two coordinates") from error
    if not np.isfinite(node).all():
        raise TsplibError(f"{path}: coordinates must be finite")
    return kind, node


def _geographic(node: Float) -> Float:
    """Distances in km on the idealised earth; coordinates are degrees and minutes, DDD.MM."""
    degrees = np.trunc(node)
    radians = _PI * (degrees + 5.0 * (node - degrees) / 3.0) / 180.0
    latitude, longitude = radians.T
    q1 = np.cos(longitude[:, None] - longitude[None])
    q2 = np.cos(latitude[:, None] - latitude[None])
    q3 = np.cos(latitude[:, None] + latitude[None])
    angle = np.arccos(np.clip(0.5 * ((1.0 + q1) * q2 - (1.0 - q1) * q3), -1.0, 1.0))
    apart = np.trunc(_EARTH_KM * angle + 1.0)
    np.fill_diagonal(apart, 0.0)
    return np.asarray(apart, dtype=np.float64)


def is_whole(value: float) -> bool:
    """Whether a length is a whole number, as TSPLIB's are."""
    return math.isfinite(value) and value == round(value)
