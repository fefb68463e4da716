"""ROS occupancy maps (`map.yaml` and its pgm): which cells are occupied, free, unknown."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml  # type: ignore[import-untyped]  # with omegaconf

from uavexp.arrays import Bool, Float
from uavexp.errors import WorldError

MAX_PIXELS = 100_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class RosMap:
    """A plan; cell (i, j) lies at origin + turned by yaw (i, j) * resolution, x right, y up."""

    occupied: Bool  # (X, Y)
    unknown: Bool  # (X, Y)
    resolution_m: float
    origin_m: tuple[float, float]
    yaw_rad: float


def read(path: Path) -> RosMap:
    """Return the map of a yaml file.

    The rules of ROS map_server: the image's first row is the map's far (high y) one;
    occupancy p = (255 - value) / 255, or value / 255 with `negate`; occupied when p >
    occupied_thresh, free when p < free_thresh, unknown between; `mode: raw` is refused.

    Raises:
        WorldError: either file is missing, damaged, or lacks a key.
    """
    entries = _entries(path)
    if str(entries.get("mode", "trinary")) not in ("trinary", "scale"):
        raise WorldError(f"world file {path}: mode must be trinary or scale, got {entries['mode']!r}")
    resolution = _number(path, "resolution", entries["resolution"])
    if not resolution > 0.0:
        raise WorldError(f"world file {path}: resolution must be > 0 m, got {resolution}")
    origin = entries["origin"]
    if not isinstance(origin, list) or len(origin) != 3:
        raise WorldError(f"world file {path}: origin must be [x, y, yaw], got {origin!r}")
    x, y, yaw = (_number(path, "origin", value) for value in origin)
    occupied_above = _number(path, "occupied_thresh", entries.get("occupied_thresh", 0.65))
    free_below = _number(path, "free_thresh", entries.get("free_thresh", 0.196))
    value = read_pgm(path.parent / str(entries["image"]))
    share = value if _number(path, "negate", entries.get("negate", 0)) else 1.0 - value
    plan = share[::-1].T  # image rows run down, the map's y runs up
    occupied = plan > occupied_above
    return RosMap(
        occupied=occupied,
        unknown=~occupied & ~(plan < free_below),
        resolution_m=resolution,
        origin_m=(x, y),
        yaw_rad=yaw,
    )


def image_path(path: Path) -> Path:
    """Return the image that a map's yaml file names."""
    return path.parent / str(_entries(path)["image"])


def _entries(path: Path) -> dict[str, Any]:
    try:
        entries: Any = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise WorldError(f"world file {path} is no yaml file") from error
    if not isinstance(entries, dict):
        raise WorldError(f"world file {path} is no ROS map: it holds no keys")
    missing = [key for key in ("image", "resolution", "origin") if key not in entries]
    if missing:
        raise WorldError(f"world file {path} is no ROS map: {', '.join(missing)} missing")
    return entries


def _number(path: Path, name: str, value: object) -> float:
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise WorldError(f"world file {path}: {name} must be a number, got {value!r}")
    return float(value)


def read_pgm(path: Path) -> Float:
    """Return the brightness (rows, columns), 0 to 1, of a pgm image, binary (P5) or plain (P2)."""
    if not path.is_file():
        raise WorldError(f"map image {path} does not exist")
    data = path.read_bytes()
    token = rb"(?:\s|#[^\n]*\n)+"
    head = re.match(rb"(P[25])" + token + rb"(\d+)" + token + rb"(\d+)" + token + rb"(\d+)\s", data)
    if head is None:
        raise WorldError(f"map image {path} is no pgm image (P5 or P2)")
    width, height, greatest = int(head[2]), int(head[3]), int(head[4])
    if not (0 < width * height <= MAX_PIXELS and 0 < greatest < 65536):
        raise WorldError(f"map image {path} has an absurd size: {width} x {height}, up to {greatest}")
    if head[1] == b"P5":
        kind = np.dtype(">u2") if greatest > 255 else np.dtype("u1")
        body = data[head.end() :]
        found = len(body) // kind.itemsize
        values = np.frombuffer(body, dtype=kind, count=min(found, width * height))
    else:
        try:
            values = np.array(data[head.end() :].split()[: width * height], dtype=np.float64)
        except ValueError as error:
            raise WorldError(f"map image {path} holds something else than numbers") from error
    if values.size < width * height:
        raise WorldError(
            f"map image {path} is truncated: {width * height} pixels expected, {values.size} found"
        )
    return values.reshape(height, width).astype(np.float64) / greatest
