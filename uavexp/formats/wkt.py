"""Floor plans as well-known text (`.wkt`; OGC Simple Features), as JuPedSim and PedPy write them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import shapely

from uavexp.arrays import Float
from uavexp.errors import WorldError
from uavexp.formats import base, prism
from uavexp.formats.base import Content, Options
from uavexp.formats.guard import damaged

_MOST_BYTES = 100_000_000
_DEEPEST = 8  # brackets within brackets: GEOS reads nested collections by recursion
_FARTHEST = 1e9  # beyond it areas have no digits left


def read(path: Path, options: Options) -> Content:
    """Return the walkable area's polygons as a closed surface; what lies outside or in holes is solid.

    Polygons, several or in collections, are joined where they overlap; one geometry, or one a line.
    """
    polygons, warnings = _polygons(path)
    with damaged(path, "wkt"):
        area = shapely.union_all(polygons)
        parts = shapely.get_parts(shapely.normalize(area))
        parts = parts[shapely.area(parts) > 0.0]
        # normalised: shells run clockwise and holes counterclockwise
        rings = [shapely.get_coordinates(ring)[::-1] for ring in shapely.get_rings(parts)]
        pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(parts))
        pieces = shapely.get_parts(pieces)
        if not rings or not np.isclose(shapely.area(pieces).sum(), shapely.area(area), rtol=1e-6):
            raise WorldError(f"world file {path} holds no polygon with an area")
        triangles = shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3]
    height = options.wall_height_m / (options.unit_m or 1.0)  # in the file's unit
    surface = prism.joined([prism.walls(rings, height), prism.floor_and_ceiling(triangles, height)])
    return base.mesh(path, "wkt plan", *surface, warnings=warnings)


def _polygons(path: Path) -> tuple[Float, tuple[str, ...]]:
    """Valid polygons of the file, and a warning when some had to be mended or left out."""
    geometries = _geometries(path, _text(path))
    if not (np.abs(shapely.get_coordinates(geometries)) < _FARTHEST).all():
        raise WorldError(f"world file {path} has coordinates that are not finite or beyond {_FARTHEST:g}")
    warnings = []
    with damaged(path, "wkt"):
        while (collections := shapely.get_type_id(geometries) > 3).any():
            geometries = np.concatenate(
                [geometries[~collections], shapely.get_parts(geometries[collections])]
            )
        polygons = geometries[shapely.get_type_id(geometries) == 3]
        valid = shapely.is_valid(polygons)
        if not valid.all():
            polygons = np.concatenate([polygons[valid], shapely.make_valid(polygons[~valid])])
            warnings.append(f"{np.count_nonzero(~valid)} polygons cross themselves and were mended")
    if not len(polygons):
        raise WorldError(f"world file {path} holds no polygon: a walkable area is needed")
    if len(polygons) < len(geometries):
        warnings.append(f"{len(geometries) - len(polygons)} points or lines were left out")
    return polygons, tuple(warnings)


def _text(path: Path) -> str:
    if path.stat().st_size > _MOST_BYTES:
        raise WorldError(f"world file {path} is larger than the {_MOST_BYTES:g} bytes allowed of a plan")
    text = path.read_bytes().removeprefix(b"\xef\xbb\xbf").decode("latin-1")
    depth = deepest = 0
    for bracket in re.findall(r"[()]", text):
        depth += 1 if bracket == "(" else -1
        deepest = max(deepest, depth)
        if depth < 0:
            break
    if depth > 0:
        raise WorldError(f"world file {path} is truncated: {depth} brackets are not closed")
    if depth < 0 or deepest > _DEEPEST:
        raise WorldError(f"world file {path} is damaged or no wkt file: its brackets do not pair")
    return text


def _geometries(path: Path, text: str) -> Float:
    try:
        found = [shapely.from_wkt(_without_srid(text))]
    except shapely.errors.GEOSException:
        lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
        with damaged(path, "wkt"):
            found = [shapely.from_wkt(_without_srid(line)) for line in lines]
    return np.array(found, dtype=object)


def _without_srid(text: str) -> str:
    return re.sub(r"^\s*SRID=\d+;", "", text, flags=re.IGNORECASE)
