"""Scans of box worlds by the slab method: independent of the package's renderer."""

from __future__ import annotations

import numpy as np

from uavexp.arrays import Float
from uavexp.scan import DepthScan, RayScan

Box = tuple[tuple[float, float, float], tuple[float, float, float]]  # lower and upper corner, m


def camera_rotation(yaw_rad: float, pitch_rad: float = 0.0) -> Float:
    """Camera (x right, y down, z forward) to world of a camera that looks along a yaw, pitch up > 0."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    level = np.array([[s, 0.0, c], [-c, 0.0, s], [0.0, -1.0, 0.0]])
    c, s = np.cos(pitch_rad), np.sin(pitch_rad)
    turned: Float = level @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    return turned


def take_scan(
    boxes: list[Box],
    position_m: tuple[float, float, float],
    yaw_rad: float = 0.0,
    *,
    pitch_rad: float = 0.0,
    size_px: tuple[int, int] = (72, 96),
    focal_px: float = 48.0,
    max_range_m: float = 5.0,
    noise: np.random.Generator | None = None,
) -> DepthScan:
    """Depth image of solid boxes, with the axial noise of Nguyen et al. 2012 if asked for."""
    height, width = size_px
    rotation = camera_rotation(yaw_rad, pitch_rad)
    position = np.asarray(position_m, dtype=np.float64)
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    centre = ((width - 1) / 2, (height - 1) / 2)
    rays = np.stack([(u - centre[0]) / focal_px, (v - centre[1]) / focal_px, np.ones(u.shape)], axis=-1)
    rays = rays @ rotation.T
    depth = np.full((height, width), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for low, high in boxes:
            first, second = (low - position) / rays, (high - position) / rays
            enter = np.minimum(first, second).max(axis=-1)
            leave = np.maximum(first, second).min(axis=-1)
            hit = (enter <= leave) & (leave > 0.0)
            depth = np.where(hit & (enter > 0.0) & (enter < depth), enter, depth)
    if noise is not None:
        near = np.minimum(depth, 10.0)
        depth = depth + noise.normal(size=depth.shape) * (0.0012 + 0.0019 * (near - 0.4) ** 2)
    return DepthScan(
        time_s=0.0,
        depth_m=np.where(depth > max_range_m, np.inf, depth).astype(np.float32),
        focal_px=(focal_px, focal_px),
        centre_px=centre,
        max_range_m=max_range_m,
        camera_position_m=position,
        camera_rotation=rotation,
    )


def ring_directions(rings: int = 64, azimuths: int = 720) -> Float:
    """Unit directions (N, 3) all around, elevations from -80 to 80 degrees."""
    elevation, azimuth = np.meshgrid(
        np.radians(np.linspace(-80.0, 80.0, rings)), 2.0 * np.pi * np.arange(azimuths) / azimuths
    )
    level = np.cos(elevation)
    grid = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1)
    return grid.reshape(-1, 3)


def take_ray_scan(
    boxes: list[Box],
    position_m: tuple[float, float, float],
    direction: Float,
    *,
    time_s: float = 0.0,
    max_range_m: float = 12.0,
    noise: np.random.Generator | None = None,
) -> RayScan:
    """Ranges to solid boxes along unit directions (N, 3), seen from outside, with 2 cm of noise if asked."""
    position = np.asarray(position_m, dtype=np.float64)
    range_m = np.full(len(direction), np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        for low, high in boxes:
            first, second = (low - position) / direction, (high - position) / direction
            enter = np.minimum(first, second).max(axis=-1)
            leave = np.maximum(first, second).min(axis=-1)
            hit = (enter <= leave) & (enter > 0.0) & (enter < range_m)
            range_m = np.where(hit, enter, range_m)
    if noise is not None:
        range_m = range_m + 0.02 * noise.normal(size=range_m.shape)
    return RayScan(
        time_s=time_s,
        origin_m=position,
        direction=direction.astype(np.float32),
        range_m=np.where(range_m > max_range_m, np.inf, range_m).astype(np.float32),
        max_range_m=max_range_m,
    )
