"""That both detectors that look, and the one that is told, find what moves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.components import build
from tests.detections import WALLS, bodies_at, room_map, scans, straight
from uavexp.check.hall import LIMITS
from uavexp.check.scans import take_scan

PATHS = [straight((4.0, 1.2, 0.86), (0.0, 1.0, 0.0)), straight((6.5, 4.5, 0.86), (-0.6, 0.0, 0.0))]


@pytest.fixture(params=["noisy", "sensed", "truth"])
def detection(request: pytest.FixtureRequest) -> Any:
    made = build("detection", request.param)
    made.reset(LIMITS, np.random.default_rng(0))
    return made


def test_two_movers_are_two_tracks_in_the_end(detection: Any) -> None:
    field = room_map()
    for scan, bodies in scans(PATHS, 1.5, noise=np.random.default_rng(1)):
        _, tracks = detection.detect(scan, field, bodies)
    apart_m = tracks.position_m[:, None] - bodies.position_m
    assert len(tracks) == 2
    assert np.linalg.norm(apart_m, axis=2).min(axis=0).max() < 0.35


def test_depth_images_are_taken_like_rays(detection: Any) -> None:
    field = room_map()
    for time_s in np.arange(20) * 0.05:
        bodies = bodies_at(PATHS[:1], float(time_s))
        middle = bodies.position_m[0]
        body = (tuple(middle - bodies.half_size_m[0]), tuple(middle + bodies.half_size_m[0]))
        seen = take_scan([*WALLS, body], (1.0, 2.0, 1.2), max_range_m=8.0)
        left, tracks = detection.detect(replace(seen, time_s=float(time_s)), field, bodies)
    assert len(tracks) == 1
    assert np.linalg.norm(tracks.velocity_mps[0] - [0.0, 1.0, 0.0]) < 0.35
    assert np.isnan(left.depth_m).sum() > np.isnan(seen.depth_m).sum()
