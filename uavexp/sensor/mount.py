"""Where a sensor sits on the vehicle."""

from __future__ import annotations

import math
from collections.abc import Sequence

from uavexp.errors import require


def require_mount(mount_offset_m: Sequence[float], mount_pitch_deg: float) -> None:
    """Raise `ConfigError` unless an offset (3,) and a pitch can be a mount."""
    require(
        len(mount_offset_m) == 3 and all(math.isfinite(x) for x in mount_offset_m),
        f"mount_offset_m must be three finite numbers [x, y, z], got {list(mount_offset_m)}",
    )
    require(
        -90.0 <= mount_pitch_deg <= 90.0,
        f"mount_pitch_deg must be -90 to 90 deg, got {mount_pitch_deg}",
    )
