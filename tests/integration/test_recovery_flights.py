"""Faults in flight: each ends, or the flight goes on, without a contact and with its reason."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from uavexp.bodies import ABSENT_M
from uavexp.check.building import building
from uavexp.config.build import build
from uavexp.config.composition import Composer
from uavexp.config.overrides import flatten
from uavexp.log import TrialLog
from uavexp.scan import DepthScan
from uavexp.scene import Scene
from uavexp.trial import Parts, fly
from uavexp.types import Bodies, Outcome, Shape, World
from uavexp.world.boxes import Boxes

SAFETIES = ("none", "committed")
DOOR_M = np.array([8.07, 8.0, 1.5])  # of the hall's only doorway, four metres wide
WALLED = (
    ((11.6, 3.6, 0.0), (12.0, 6.4, 3.0)),
    ((12.0, 3.6, 0.0), (14.0, 4.0, 3.0)),
    ((12.0, 6.0, 0.0), (14.0, 6.4, 3.0)),
)


def parts(**values: Any) -> Parts:
    settings = [setting for key, value in values.items() for setting in flatten(key, value)]
    (cell,) = Composer().command(settings).cells
    return build(cell.config)


def flown(
    safety: str, world: World | None = None, changed: dict[str, Any] | None = None, **values: Any
) -> TrialLog:
    made = parts(strategy="safe", safety=safety, world="rooms", **values)
    return fly(replace(made, **(changed or {})), world or building(), 0)


def hall(*boxes: tuple[tuple[float, ...], tuple[float, ...]], **changed: Any) -> World:
    """The building with more boxes in it."""
    more = Boxes()
    for low, high in boxes:
        more.span(low, high)
    (vertices, triangles), old = more.mesh(), building()
    return replace(
        old,
        vertices_m=np.concatenate([old.vertices_m, vertices]),
        triangles=np.concatenate([old.triangles, triangles + np.int32(len(old.vertices_m))]),
        **changed,
    )


@dataclass(slots=True)
class Faulty:
    """A sensor whose scans are changed."""

    sensor: Any
    change: Callable[[DepthScan], DepthScan]

    @property
    def rate_hz(self) -> float:
        return float(self.sensor.rate_hz)

    def reset(self, *begun: Any) -> None:
        self.sensor.reset(*begun)

    def capture(self, *seen: Any) -> DepthScan:
        return self.change(self.sensor.capture(*seen))


@dataclass(slots=True)
class Shutter:
    """A door that shuts at a time, and stays."""

    shuts_s: float
    half_m: tuple[float, float, float] = (0.1, 2.1, 1.5)

    def reset(self, *_: Any) -> None:
        pass

    def at(self, time_s: float) -> Bodies:
        return Bodies(
            time_s=time_s,
            shape=np.array([Shape.BOX], dtype=np.uint8),
            half_size_m=np.array([self.half_m]),
            position_m=(DOOR_M if time_s >= self.shuts_s else ABSENT_M)[None],
            velocity_mps=np.zeros((1, 3)),
        )


@dataclass(slots=True)
class SeesThrough(Faulty):
    """A sensor that sees a world without its panes of glass."""

    def reset(self, scene: Scene, rng: np.random.Generator) -> None:
        self.sensor.reset(Scene(building()), rng)


def blind(scan: DepthScan) -> DepthScan:
    dark = 4.0 <= scan.time_s < 6.0
    return replace(scan, depth_m=np.full_like(scan.depth_m, np.nan)) if dark else scan


def misplaced(scan: DepthScan) -> DepthScan:
    wrong = abs(scan.time_s - 3.0) < 0.2
    off_m = np.array([0.6, -0.5, 0.0])
    return replace(scan, camera_position_m=scan.camera_position_m + off_m) if wrong else scan


@pytest.mark.parametrize("safety", SAFETIES)
@pytest.mark.parametrize("change", [blind, misplaced], ids=["returns nothing for 2 s", "wrong pose"])
def test_a_sensor_that_fails_for_a_while_is_survived(safety: str, change: Any) -> None:
    made = parts(strategy="safe")
    log = flown(safety, changed={"sensor": Faulty(made.sensor, change)})
    assert (log.outcome, len(log.contacts)) == (Outcome.REACHED, 0)


@pytest.mark.parametrize("safety", SAFETIES)
def test_a_door_that_shuts_behind_the_vehicle_does_not_matter(safety: str) -> None:
    log = flown(safety, changed={"movers": Shutter(shuts_s=6.0)})
    assert (log.outcome, len(log.contacts)) == (Outcome.REACHED, 0)


@pytest.mark.parametrize(("safety", "shuts_s"), [("none", 1.0), ("committed", 1.0), ("committed", 4.2)])
def test_a_door_that_shuts_before_it_makes_the_target_unreachable(safety: str, shuts_s: float) -> None:
    log = flown(safety, changed={"movers": Shutter(shuts_s=shuts_s)})
    assert (log.outcome, len(log.contacts)) == (Outcome.UNREACHABLE, 0)
    assert log.reason


@pytest.mark.parametrize("safety", SAFETIES)
def test_a_target_that_is_walled_in_is_told_soon_after_the_rest_is_seen(safety: str) -> None:
    log = flown(safety, hall(*WALLED))
    assert (log.outcome, len(log.contacts)) == (Outcome.UNREACHABLE, 0)
    explored = flown(safety, hall(*WALLED), mission="explore")
    assert (explored.outcome, len(explored.contacts)) == (Outcome.EXPLORED, 0)
    assert log.steps.time_s[-1] <= 2.0 * explored.steps.time_s[-1]


@pytest.mark.parametrize("safety", SAFETIES)
def test_a_pane_that_no_sensor_sees_is_touched_and_noted_and_flown_around(safety: str) -> None:
    """Half of the doorway is glass; where it was touched once it is not touched again."""
    made = parts(strategy="safe")
    glass = hall(((8.0, 6.0, 0.0), (8.04, 8.6, 3.0)))
    log = flown(safety, glass, {"sensor": SeesThrough(made.sensor, lambda scan: scan)})
    print(log.outcome, log.reason, log.contacts, [(r.time_s, r.cause, r.status) for r in log.replans])
    assert log.outcome is Outcome.REACHED
    touched_m = np.array([contact.position_m for contact in log.contacts])
    assert len(touched_m) >= 1
    apart_m = np.linalg.norm(touched_m[:, None] - touched_m[None], axis=2)[
        ~np.eye(len(touched_m), dtype=bool)
    ]
    assert apart_m.min(initial=np.inf) > 0.2
    assert any(replan.cause == "noted" for replan in log.replans)
