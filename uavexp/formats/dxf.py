"""Floor plans as AutoCAD drawings (`.dxf`, text or binary)."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from ezdxf.enums import InsertUnits
from ezdxf.filemanagement import readfile
from ezdxf.path import make_path
from ezdxf.units import conversion_factor

from uavexp.arrays import Float
from uavexp.errors import WorldError
from uavexp.formats import base, prism
from uavexp.formats.base import Content, Options
from uavexp.formats.guard import damaged

LINES = ("LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE")
MOST_ENTITIES = 500_000  # blocks unpacked
_DEEPEST = 16  # blocks within blocks
_SAGITTA = 1e-4  # of a curve's extent, by which its polyline may miss it
_TAIL = 64  # bytes in which a drawing's mark of its end stands

logging.getLogger("ezdxf").addHandler(logging.NullHandler())  # its warnings stay off the terminal


def read(path: Path, options: Options) -> Content:
    """Return the lines of the model space as thin walls, with floor and ceiling over their bounding box.

    `options.layers` says which layers are walls; none: all that are switched on. Coordinates stand
    as in the drawing; its unit is the header's ($INSUNITS).
    """
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - _TAIL))
        if b"EOF" not in file.read():
            raise WorldError(f"world file {path} is truncated or no dxf file: its end, EOF, is missing")
    with damaged(path, "dxf"):
        drawing = readfile(path)
        walls = _walls(path, drawing, options.layers)
        unit_m = _unit_m(drawing)
        lines, layers, left = _lines(path, drawing, walls, bool(options.layers))
    if not lines:
        raise WorldError(
            f"world file {path} holds no {' '.join(LINES)} on the layers {' '.join(sorted(walls))}"
        )
    height = options.wall_height_m / (options.unit_m or unit_m or 1.0)  # in the drawing's unit
    corners = np.concatenate(lines)
    floor = prism.rectangle(corners.min(axis=0), corners.max(axis=0))
    surface = prism.joined([prism.walls(lines, height), prism.floor_and_ceiling(floor, height)])
    content = base.mesh(path, "dxf plan", *surface, warnings=tuple(_warnings(options, layers, left)))
    return replace(content, unit_m=unit_m)


def _walls(path: Path, drawing: Any, asked: tuple[str, ...]) -> set[str]:
    """Names, in small letters, of the layers that are walls."""
    used = {entity.dxf.layer.lower() for entity in drawing.modelspace()} | {"0"}
    table = {layer.dxf.name.lower(): layer for layer in drawing.layers}
    there = used | set(table)  # a layer need not stand in the table
    missing = [name for name in asked if name.lower() not in there]
    if missing:
        raise WorldError(
            f"world file {path} has no layer {' '.join(missing)}; its layers are {' '.join(sorted(there))}"
        )
    if asked:
        return {name.lower() for name in asked}
    return there - {name for name, layer in table.items() if layer.is_off() or layer.is_frozen()}


def _lines(
    path: Path, drawing: Any, walls: set[str], asked: bool
) -> tuple[list[Float], Counter[str], Counter[str]]:
    """Polylines (P, 2) on the layers of walls; how many of each layer; what was left out, by its reason."""
    lines: list[Float] = []
    layers: Counter[str] = Counter()
    left: Counter[str] = Counter()
    for layer, entity in _entities(path, drawing.modelspace()):
        if layer.lower() not in walls:
            if not asked:
                left[f"on layer {layer}"] += 1  # switched off
            continue
        line = _polyline(path, entity)
        if line is None:
            left[entity.dxftype()] += 1
        elif len(line) > 1:
            layers[layer] += 1
            lines.append(line)
    return lines, layers, left


def _entities(path: Path, entities: Iterable[Any]) -> Iterator[tuple[str, Any]]:
    """Layer and entity of everything drawn, blocks unpacked; layer 0 of a block is its insert's."""
    waiting = [(iter(entities), "0")]
    seen = 0
    while waiting:
        entity = next(waiting[-1][0], None)
        if entity is None:
            waiting.pop()
            continue
        seen += entity.mcount if entity.dxftype() == "INSERT" else 1
        inherited = waiting[-1][1]
        layer = inherited if entity.dxf.layer == "0" else entity.dxf.layer
        if seen > MOST_ENTITIES or len(waiting) > _DEEPEST:
            raise WorldError(
                f"world file {path} unpacks to more than {MOST_ENTITIES} lines, or blocks within "
                f"{_DEEPEST} blocks: explode it, or give fewer layers"
            )
        if entity.dxftype() != "INSERT":
            yield layer, entity
        elif entity.mcount > 1:
            waiting.append((entity.multi_insert(), inherited))
        else:
            waiting.append((entity.virtual_entities(), layer))


def _polyline(path: Path, entity: Any) -> Float | None:
    """Points (P, 2) of a line or curve, None for what is no line."""
    if entity.dxftype() not in LINES or (
        entity.dxftype() == "POLYLINE" and not (entity.is_2d_polyline or entity.is_3d_polyline)
    ):
        return None
    course = make_path(entity)
    control = np.array([(point.x, point.y) for point in course.control_vertices()]).reshape(-1, 2)
    if not np.isfinite(control).all():
        raise WorldError(f"world file {path} has a {entity.dxftype()} whose points are NaN or infinite")
    extent = float(np.ptp(control, axis=0).max()) if len(control) else 0.0
    if extent == 0.0:
        return control[:0]
    points = [(point.x, point.y) for point in course.flattening(_SAGITTA * extent)]
    return np.array(points, dtype=np.float64)


def _warnings(options: Options, layers: Counter[str], left: Counter[str]) -> Iterator[str]:
    if not options.layers and len(layers) > 1:
        names = ", ".join(f"{name} ({count})" for name, count in sorted(layers.items()))
        yield f"lines of all layers became walls, {names}: world.layers=[...] takes some"
    if left:
        yield "left out: " + ", ".join(f"{count} {kind}" for kind, count in sorted(left.items()))


def _unit_m(drawing: Any) -> float | None:
    """Length of the unit that the drawing's header names; None: it names none."""
    try:
        unit = InsertUnits(int(drawing.header.get("$INSUNITS", 0)))
    except (TypeError, ValueError):
        return None
    return None if unit is InsertUnits.Unitless else conversion_factor(unit, InsertUnits.Meters)
