"""`python -m uavexp.world FILE`: see a building before anything flies in it.

Prints what was read and what was understood of it, and draws a picture; nothing flies.
"""

from __future__ import annotations

import json
import math
import os
import shlex
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from uavexp.arrays import Float
from uavexp.config.build import build
from uavexp.config.composition import Composer
from uavexp.config.overrides import parse_settings, quoted
from uavexp.errors import ConfigError, WorldError, one_line
from uavexp.formats import FREE, SOLID, UNMEASURED
from uavexp.geometry import polyline_length_m
from uavexp.interrupts import exit_code_of
from uavexp.seeding import Stream, generator
from uavexp.types import World
from uavexp.world.file import File
from uavexp.world.free_parts import Part, parts_told, text
from uavexp.world.survey import Survey
from uavexp.world.widest import bottleneck_m

_USAGE = """usage: python -m uavexp.world FILE [world.KEY=VALUE ...] [seed=0] [--json] [--out PICTURE.png]

Reads a building, says what was understood of it, draws a picture; nothing flies.
  world.unit_m=0.001        length of one unit of the file, m
  world.up_axis=y           the file's axis that points up
  seed=0                    draws start and target, as a flight of that seed would
  --json                    one line of JSON in place of text
  --out PICTURE.png         where the picture goes; default: FILE's name with .world.png, here
All parameters of a file's world: python -m uavexp --help world
"""
_WIDEST_M = 1.0  # beyond this clearance a bottleneck is not looked for


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """What was typed."""

    file: str
    settings: tuple[str, ...]
    picture: Path
    as_json: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Understood:
    """A building, and the task in it or why there is none."""

    survey: Survey
    parts: tuple[Part, ...]
    world: World | None
    bottleneck_m: float  # NaN without a task
    refusal: str  # empty with a task


def main(typed: Sequence[str]) -> int:
    """Show a world and return the exit code: 0; 2 it cannot be read or has no task; 130 interrupted."""
    os.environ["MPLBACKEND"] = "Agg"
    if not typed or {"-h", "--help"} & set(typed):
        (sys.stdout if typed else sys.stderr).write(_USAGE)
        return 0 if typed else 2
    return exit_code_of(lambda: _show(_asked(typed)))


def _asked(typed: Sequence[str]) -> Asked:
    words = list(typed)
    picture = None
    if "--out" in words:
        place = words.index("--out")
        if place + 1 == len(words) or not words[place + 1].endswith(".png"):
            raise ConfigError("--out needs the name of a .png file")
        picture = Path(words[place + 1])
        del words[place : place + 2]
    as_json = "--json" in words
    words = [word for word in words if word != "--json"]
    if option := next((word for word in words if word.startswith("-")), None):
        raise ConfigError(f"unknown option {option}; see --help")
    files = [word for word in words if not word.startswith(("world.", "world_seed=", "seed="))]
    if len(files) != 1:
        raise ConfigError(f"one file is needed, got {', '.join(files) or 'none'}; see --help")
    return Asked(
        file=files[0],
        settings=tuple(word for word in words if word not in files),
        picture=picture or Path(f"{Path(files[0]).stem}.world.png"),
        as_json=as_json,
    )


def _show(asked: Asked) -> int:
    from uavexp.report import world_view  # matplotlib, a second

    begin_s = time.monotonic()
    understood = _understand(asked)
    facts = facts_of(understood)
    title = f"{Path(asked.file).name}: {facts[0]}"
    if asked.picture.resolve() == Path(asked.file).resolve():
        raise ConfigError(f"--out {asked.picture} is the file itself")
    try:
        world_view.draw(_shown(understood), title, facts[1:], warnings_of(understood), asked.picture)
    except OSError as error:
        raise ConfigError(f"{asked.picture} cannot be written: {error.strerror}") from error
    if asked.as_json:
        sys.stdout.write(json.dumps(as_json(understood), allow_nan=False) + "\n")
    else:
        lines = [title, *facts[1:], *(f"warning: {line}" for line in warnings_of(understood))]
        if understood.world is not None:
            words = [f"world.path={asked.file}", *asked.settings]
            lines.append(f"fly it:  {shlex.join(['python', '-m', 'uavexp', 'world=file', *words])}")
        took_s = time.monotonic() - begin_s
        sys.stdout.write("\n".join([*lines, f"picture: {asked.picture} ({took_s:.1f} s)"]) + "\n")
    if understood.refusal:
        raise WorldError(understood.refusal)
    return 0


def _understand(asked: Asked) -> Understood:
    words = ["world=file", f"world.path={quoted(asked.file)}", *asked.settings]
    command = Composer().command(parse_settings(words))
    if len(command.cells) * len(command.seeds) != 1:
        raise ConfigError("one world is shown at a time: give one value of each parameter, and one seed")
    parts = build(command.cells[0].config)
    maker, seed = parts.world, command.seeds[0] if parts.world_seed is None else parts.world_seed
    if not isinstance(maker, File):
        raise ConfigError("python -m uavexp.world shows files; other worlds have no file")
    survey = maker.survey()
    told = tuple(parts_told(survey.parts))
    try:
        world = maker.world_of(survey, generator(seed, Stream.WORLD))
    except WorldError as error:
        return Understood(
            survey=survey, parts=told, world=None, bottleneck_m=math.nan, refusal=one_line(error)
        )
    narrowest_m = bottleneck_m(survey.scene, survey.flight_bounds_m, world.start_m, world.target_m, _WIDEST_M)
    return Understood(survey=survey, parts=told, world=world, bottleneck_m=narrowest_m, refusal="")


def warnings_of(understood: Understood) -> list[str]:
    """What a person should know, a sentence each; the refusal last."""
    return [*understood.survey.notes, *([understood.refusal] if understood.refusal else [])]


def facts_of(understood: Understood) -> list[str]:
    """What was read and understood, a line each."""
    survey, world = understood.survey, understood.world
    content, building = survey.content, survey.building
    counts = {
        "vertices": len(content.vertices), "triangles": len(content.triangles), "points": len(content.points)
    }  # fmt: skip
    size_m = np.diff(_box_m(survey), axis=0)[0]
    lines = [
        content.kind + "".join(f", {count:,} {name}" for name, count in counts.items() if count),
        "size " + " x ".join(f"{edge:.4g}" for edge in size_m) + f" m, from {text(_box_m(survey)[0])} to "
        f"{text(_box_m(survey)[1])}"
        + (f"; its origin {text(building.origin_m)} was taken off" if building.origin_m.any() else ""),
    ]
    if cells := _cells(survey):
        lines.append("cells: " + ", ".join(f"{count:,} {name}" for name, count in cells.items()))
    if understood.parts:
        whole = sum(part.floor_m2 for part in understood.parts)
        largest = understood.parts[0].floor_m2
        lines.append(
            f"free parts: {len(understood.parts)}; the largest has {largest:.1f} m² of floor, "
            f"{largest / whole:.0%} of all"
        )
    if world is not None:
        lines.append(
            f"start {text(world.start_m)}, target {text(world.target_m)}: "
            f"{world.difficulty.straight_line_m:.1f} m straight, shortest path "
            f"{world.difficulty.shortest_path_m:.1f} m, least clearance on the widest way "
            + ("more than " if understood.bottleneck_m > _WIDEST_M else "")
            + f"{min(understood.bottleneck_m, _WIDEST_M):.2f} m"
        )
    return lines


def as_json(understood: Understood) -> dict[str, Any]:
    """The same for programs; null where there is no task."""
    survey, world = understood.survey, understood.world
    content, space = survey.content, survey.building.space
    ends = [] if world is None else [world.start_m, world.target_m]
    return {
        "kind": content.kind,
        "vertices": len(content.vertices),
        "triangles": len(content.triangles),
        "points": len(content.points),
        "bounds_m": np.round(_box_m(survey), 4).tolist(),
        "origin_m": survey.building.origin_m.tolist(),
        "cells": _cells(survey),
        "parts": [
            {"floor_m2": round(part.floor_m2, 2), "middle_m": np.round(part.middle_m, 3).tolist()}
            for part in understood.parts
        ],
        "start_m": None if world is None else world.start_m.tolist(),
        "target_m": None if world is None else world.target_m.tolist(),
        "ends_free": None if world is None else bool(space.is_free(np.array(ends)).all()),
        "shortest_path_m": None if world is None else round(polyline_length_m(world.shortest_path), 3),
        "bottleneck_m": None if world is None else understood.bottleneck_m,
        "warnings": warnings_of(understood),
    }


def _cells(survey: Survey) -> dict[str, int] | None:
    """Cells by state, of a file that has cells."""
    cells = survey.content.cells
    if cells is None:
        return None
    counts = np.bincount(cells.state.ravel(), minlength=3)
    return {"occupied": int(counts[SOLID]), "free": int(counts[FREE]), "unmeasured": int(counts[UNMEASURED])}


def _box_m(survey: Survey) -> Float:
    vertices = survey.building.vertices_m
    return np.stack([vertices.min(axis=0), vertices.max(axis=0)]).astype(np.float64)


def _shown(understood: Understood) -> Any:
    from uavexp.report.world_view import Shown

    survey, world = understood.survey, understood.world
    parts, box_m = survey.parts, _box_m(survey)
    if world is not None:
        middle_m = world.start_m
    elif understood.parts:
        middle_m = understood.parts[0].middle_m
    else:
        middle_m = box_m.mean(axis=0)
    return Shown(
        space=survey.building.space,
        is_joined=lambda points_m: parts.number_at(points_m) == parts.largest,
        box_m=box_m,
        flight_bounds_m=survey.flight_bounds_m,
        middle_m=middle_m,
        ends_m=np.empty((0, 3)) if world is None else np.stack([world.start_m, world.target_m]),
        path_m=np.empty((0, 3)) if world is None else world.shortest_path,
    )
