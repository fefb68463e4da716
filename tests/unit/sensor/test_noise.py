"""The noise of the shipped sensors, and how much of a room they measure through it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.components import build
from uavexp.arrays import Float32
from uavexp.check.building import building, scene
from uavexp.check.hall import hovering
from uavexp.scan import RayScan
from uavexp.seeding import Stream, generator


def measured(sensor: str, seed: int) -> Float32:
    """Depths or ranges of one scan."""
    made, here = build("sensor", sensor), hovering(building().start_m)
    made.reset(scene(), generator(seed, Stream.SENSOR))
    scan = made.capture(here, here, 0.0)
    return scan.range_m if isinstance(scan, RayScan) else scan.depth_m


@pytest.mark.parametrize("sensor", ["lidar_rosette", "lidar_spinning", "rgbd"])
def test_another_seed_is_other_noise_on_the_same_room(sensor: str) -> None:
    one, other = measured(sensor, 4), measured(sensor, 5)
    assert one.tobytes() != other.tobytes()
    assert np.isfinite(one).mean() > 0.3
    both = np.isfinite(one) & np.isfinite(other)
    assert np.median(np.abs(one[both] - other[both])) < 0.1
