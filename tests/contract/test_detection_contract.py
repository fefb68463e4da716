"""What every detector keeps; options are found by glob."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.components import build, numbers, options
from tests.detections import WALLS, bodies_at, room_map, scans, straight
from uavexp.check.hall import LIMITS
from uavexp.check.scans import take_scan
from uavexp.errors import ConfigError
from uavexp.types import Scan, Tracks

pytestmark = pytest.mark.parametrize("option", options("detection"))

PATHS = [straight((4.0, 1.2, 0.86), (0.0, 1.0, 0.0)), straight((6.5, 4.5, 0.86), (-0.6, 0.0, 0.0))]


def detector(option: str) -> Any:
    made = build("detection", option)
    made.reset(LIMITS, np.random.default_rng(0))
    return made


def flown(made: Any) -> list[tuple[Scan, Scan, Tracks]]:
    field = room_map()
    return [
        (scan, *made.detect(scan, field, bodies))
        for scan, bodies in scans(PATHS, 1.5, noise=np.random.default_rng(1))
    ]


def test_a_scan_only_loses_returns(option: str) -> None:
    for before, after, tracks in flown(detector(option)):
        kept = ~np.isnan(after.range_m)
        assert np.array_equal(after.range_m[kept], before.range_m[kept])
        assert after.time_s == before.time_s == tracks.time_s
        assert np.array_equal(after.direction, before.direction)


def test_tracks_are_finite_and_each_has_its_own_identity(option: str) -> None:
    for _, _, tracks in flown(detector(option)):
        assert len(set(tracks.identity.tolist())) == len(tracks)
        for values in (tracks.position_m, tracks.velocity_mps, tracks.covariance, tracks.half_size_m):
            assert np.isfinite(values).all()
        assert (tracks.half_size_m >= 0.0).all()
        assert np.allclose(tracks.covariance, tracks.covariance.transpose(0, 2, 1))
        if len(tracks):
            assert np.linalg.eigvalsh(tracks.covariance).min() >= -1e-9


def test_the_movers_are_found_in_the_end(option: str) -> None:
    *_, (scan, _, tracks) = flown(detector(option))
    apart_m = tracks.position_m[:, None] - bodies_at(PATHS, scan.time_s).position_m
    assert len(tracks) == 2
    assert np.linalg.norm(apart_m, axis=2).min(axis=0).max() < 0.35


def test_reset_forgets_the_last_trial(option: str) -> None:
    made = detector(option)
    first = flown(made)
    made.reset(LIMITS, np.random.default_rng(0))
    again = flown(made)
    for (_, one, tracks), (_, other, others) in zip(first, again, strict=True):
        assert np.array_equal(one.range_m, other.range_m, equal_nan=True)
        assert np.array_equal(tracks.position_m, others.position_m)
        assert np.array_equal(tracks.identity, others.identity)


def test_depth_images_are_taken_like_rays(option: str) -> None:
    made, field = detector(option), room_map()
    for time_s in np.arange(20) * 0.05:
        bodies = bodies_at(PATHS[:1], float(time_s))
        middle = bodies.position_m[0]
        body = (tuple(middle - bodies.half_size_m[0]), tuple(middle + bodies.half_size_m[0]))
        seen = take_scan([*WALLS, body], (1.0, 2.0, 1.2), max_range_m=8.0)
        seen = type(seen)(
            **{name: getattr(seen, name) for name in seen.__slots__} | {"time_s": float(time_s)}
        )
        left, tracks = made.detect(seen, field, bodies)
    assert len(tracks) == 1
    assert np.linalg.norm(tracks.velocity_mps[0] - [0.0, 1.0, 0.0]) < 0.35
    assert np.isnan(left.depth_m).sum() > np.isnan(seen.depth_m).sum()


@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")])
def test_refuses_bad_numbers(option: str, value: float) -> None:
    for name in numbers(build("detection", option)):
        with pytest.raises(ConfigError, match=rf"{name} must .*got"):
            build("detection", option, **{name: value})
