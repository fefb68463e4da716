"""Where in a building a flight starts and ends: given or drawn, in free space, joined with a clearance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uavexp.arrays import Float, Int32
from uavexp.errors import WorldError
from uavexp.formats import Content
from uavexp.scene import Scene
from uavexp.space import SOLID, UNMEASURED
from uavexp.world import task
from uavexp.world.building import Building
from uavexp.world.free_parts import FreeParts, floor_m, notes_of, text
from uavexp.world.widest import widest_path

ABOVE_FLOOR_M = 1.2  # of a drawn start and target, when no height is given
SAMPLE_ATTEMPTS = 100
SAME_M = 0.002  # what the clearance of the widest way is told too small


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Survey:
    """A building as read, and where in it a body can be: all that is known before there is a task.

    Its coordinates are those of the file less an origin.
    """

    path: str  # of the file, named in errors
    content: Content
    building: Building
    flight_bounds_m: Float  # (2, 3)
    clearance_m: float  # of the body's centre
    scene: Scene
    parts: FreeParts  # of its free space, with the clearance

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know of it, a sentence each."""
        return (*self.building.notes, *notes_of(self.parts))

    def told(self, point_m: Float) -> str:
        """A point (3,) as the file has it and as it is typed."""
        return text(point_m + self.building.origin_m)


def given_end(survey: Survey, name: str, given: Sequence[float]) -> Float:
    """An end given in the file's coordinates (3,), in the building's.

    Args:
        survey: of the building.
        name: of the parameter.
        given: x, y, z.

    Raises:
        WorldError: the body cannot be there; it names the nearest place where it can.
    """
    point = np.array(given) - survey.building.origin_m
    low, high = survey.flight_bounds_m
    if (point < low).any() or (point > high).any():
        raise WorldError(
            f"{survey.path}: {name} {survey.told(point)} lies outside the flight bounds "
            f"{survey.told(low)} to {survey.told(high)}"
        )
    state = int(survey.building.space.state_at(point[None])[0])
    clearance = float(survey.scene.distance_m(point[None])[0])
    if state == SOLID:
        why = "lies inside a solid"
    elif state == UNMEASURED:
        why = "lies where the map was never measured"
    elif clearance < survey.clearance_m:
        why = (
            f"lies too near an obstacle: its clearance is {clearance:.2f} m, "
            f"clearance_m={survey.clearance_m:g} is needed"
        )
    else:
        return point
    near = survey.parts.nearest_m(point)
    advice = (
        f"nowhere has the body's centre clearance_m={survey.clearance_m:g} of room"
        if near is None
        else f"the nearest free place is world.{name}={survey.told(near)}"
    )
    raise WorldError(f"{survey.path}: {name} {survey.told(point)} {why}; {advice}")


def drawn_ends(
    survey: Survey, height_m: float | None, least_distance_m: float, rng: np.random.Generator
) -> tuple[Float, Float]:
    """Start and target (3,) each, at one height in the largest free part inside the building.

    Args:
        survey: of the building.
        height_m: of both; None: 1.2 m above the floor of that part.
        least_distance_m: between them.
        rng: draws them.

    Raises:
        WorldError: there are none; it names what would do.
    """
    points, height = _layer(survey, height_m)
    for _ in range(SAMPLE_ATTEMPTS):
        start = points[rng.integers(points.shape[0])]
        far = points[np.linalg.norm(points - start, axis=1) >= least_distance_m]
        if far.shape[0] > 0:
            return start, far[rng.integers(far.shape[0])]
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    raise WorldError(
        f"{survey.path}: no two points at flight_height_m={height:g} in the largest free part, "
        f"{extent:.1f} m across, are least_distance_m={least_distance_m:g} apart; "
        f"world.least_distance_m={0.5 * extent:.1f} would do"
    )


def joining_path(survey: Survey, start: Float, target: Float) -> Float:
    """Shortest known path (P, 3) between two places that keeps the survey's clearance, to `SAME_M`.

    Raises:
        WorldError: there is none; it names the clearance at which there is one.
    """
    asked = (survey.scene, survey.flight_bounds_m, start, target, survey.clearance_m)
    for cell_m in (task.CELL_M, task.FINE_CELL_M):  # a door may fall between the coarser lattice's nodes
        path = task.shortest_path(*asked, cell_m)
        if path.shape[0] > 0:
            return path
    path, widest_m = widest_path(*asked)
    if widest_m >= survey.clearance_m - SAME_M:
        return task.tightened(survey.scene, path, min(widest_m, survey.clearance_m))
    advice = (
        f"they are joined at {_cut(widest_m, 3):.3f} m: world.clearance_m={_cut(widest_m, 2):g}"
        if widest_m >= 0.01
        else "they are not joined at all"
    )
    raise WorldError(
        f"{survey.path}: target {survey.told(target)} cannot be reached from start {survey.told(start)} with "
        f"clearance_m={survey.clearance_m:g}; {advice}"
    )


def _cut(value: float, digits: int) -> float:
    """A number without the digits behind these, never larger than it was."""
    return math.floor(value * 10.0**digits) / 10.0**digits


def _layer(survey: Survey, height_m: float | None) -> tuple[Float, float]:
    """Points (N, 3) of the largest part that has any at the height, and that height."""
    parts = survey.parts
    if parts.largest == 0:
        raise WorldError(
            f"{survey.path}: nowhere within the flight bounds has the body's centre "
            f"clearance_m={survey.clearance_m:g} of room"
        )
    height, fullest = height_m, parts.fullest_height_m()
    if height is None:
        height = round(floor_m(survey.scene, parts) + ABOVE_FLOOR_M, 2)
    points, number = _inside_at(survey, height)
    if points.shape[0] == 0 and height_m is None:  # no floor, or the ceiling is lower
        height = fullest
        points, number = _inside_at(survey, height)
    if points.shape[0] == 0:
        raise WorldError(
            f"{survey.path}: nowhere inside the building at flight_height_m={height:g} has the body's centre "
            f"clearance_m={survey.clearance_m:g} of room; most room is at world.flight_height_m={fullest:.2f}"
        )
    own = number == parts.largest
    return points[own if own.any() else number == np.bincount(number).argmax()], height


def _inside_at(survey: Survey, height_m: float) -> tuple[Float, Int32]:
    """Points (N, 3) at one height that keep the clearance inside the building, and the part of each."""
    low, high = survey.flight_bounds_m[:, 2]
    if not low <= height_m <= high:
        return np.empty((0, 3)), np.empty(0, dtype=np.int32)
    points, _, _ = task.free_layer(survey.scene, survey.flight_bounds_m, height_m, survey.clearance_m)
    number, space = survey.parts.number_at(points), survey.building.space
    kept = (number > 0) & (space.is_inside(points) if survey.parts.enclosed else space.is_free(points))
    return points[kept], number[kept]
