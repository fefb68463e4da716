"""Where samples are drawn: the flight volume, then the spheroid that holds every better path.

Points no longer a way from start to goal than the best one lie in a prolate spheroid with its foci
there (Gammell, Srinivasa and Barfoot 2014). It is met by drawing from its box, cut to the bounds,
and leaving the lower bounds of the search to refuse what is outside; in a flight volume that is a
thin layer this wastes less than drawing from the spheroid and refusing what is above or below.

The box stands along the horizontal direction from start to goal. So the samples, and with them the
tree, turn and move along with the world.
"""

from __future__ import annotations

from typing import NamedTuple

import numba as nb
import numpy as np

from uavexp.arrays import Float
from uavexp.planner.find.batch_tree.cubic_motion import cubic_coefficients
from uavexp.planner.find.free_space import FreeSpace, look


class Region(NamedTuple):
    """An upright box to draw positions from."""

    origin_m: Float  # (3,) start
    cosine: float  # of the horizontal direction to the goal
    sine: float
    low_m: Float  # (3,) along that direction, across and up, from the origin
    high_m: Float  # (3,)
    volume_m3: float


@nb.njit(cache=True)
def sampled_region(space: FreeSpace, start: Float, goal: Float, longest_m: float) -> Region:
    """Box that holds the spheroid of paths no longer than this, and no more than the bounds.

    Args:
        space: for its bounds.
        start: (>= 3,).
        goal: (>= 3,).
        longest_m: length of the best path; inf when there is none.
    """
    step = goal[:3] - start[:3]
    level = np.sqrt(step[0] ** 2 + step[1] ** 2)
    cosine, sine = (step[0] / level, step[1] / level) if level > 1e-9 else (1.0, 0.0)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for x in (space.low_m[0] - start[0], space.high_m[0] - start[0]):
        for y in (space.low_m[1] - start[1], space.high_m[1] - start[1]):
            along, across = cosine * x + sine * y, cosine * y - sine * x
            low[0], high[0] = min(low[0], along), max(high[0], along)
            low[1], high[1] = min(low[1], across), max(high[1], across)
    low[2], high[2] = space.low_m[2] - start[2], space.high_m[2] - start[2]
    if np.isfinite(longest_m):
        apart = np.sqrt((step**2).sum())
        half = 0.5 * longest_m
        thick = np.sqrt(max(longest_m**2 - apart**2, 0.0)) / 2.0
        tilt = step[2] / apart if apart > 1e-9 else 0.0
        reach = (
            np.sqrt((half**2 - thick**2) * (1.0 - tilt**2) + thick**2),
            thick,
            np.sqrt((half**2 - thick**2) * tilt**2 + thick**2),
        )
        middle = (0.5 * level, 0.0, 0.5 * step[2])
        for k in range(3):
            low[k], high[k] = max(low[k], middle[k] - reach[k]), min(high[k], middle[k] + reach[k])
    volume = max((high[0] - low[0]) * (high[1] - low[1]) * (high[2] - low[2]), 0.0)
    return Region(start[:3].copy(), cosine, sine, low, high, volume)


@nb.njit(cache=True)
def draw(space: FreeSpace, region: Region, top_mps: float, rng: np.random.Generator, state: Float) -> bool:
    """Write a state (6,) of uniform position and velocity; returns whether its position is free.

    Args:
        space: where it must be free.
        region: of positions.
        top_mps: greatest speed; 0: at rest.
        rng: draws three numbers, or six.
        state: (6,) written to.
    """
    offset = np.empty(3)
    for k in range(3):
        offset[k] = region.low_m[k] + rng.random() * (region.high_m[k] - region.low_m[k])
    _place(region, offset, state[:3])
    state[:3] += region.origin_m
    _draw_velocity(region, top_mps, rng, state)
    return bool(look(space, state[0], state[1], state[2])[0])


@nb.njit(cache=True)
def draw_near(
    space: FreeSpace,
    region: Region,
    motion: tuple[Float, Float],
    spread_m: float,
    spread_mps: float,
    rng: np.random.Generator,
    state: Float,
) -> bool:
    """Write a state (6,) that scatters about a solution; returns whether its position is free.

    With equal chance a state of its path or one on the way between two, moved by a normal
    distance and change of velocity; the scatter is drawn up to the one given, so that coarse
    and fine changes are tried.

    Args:
        space: where it must be free.
        region: for its axes.
        motion: states (P, 6) and what the way from each to the next takes (P - 1,), s.
        spread_m: greatest standard deviation of each coordinate.
        spread_mps: of each velocity; 0: the solution is a path of straight lines.
        rng: draws.
        state: (6,) written to.
    """
    path, steps = motion
    n = min(int(rng.random() * (path.shape[0] - 1)), path.shape[0] - 2)
    share = rng.random() if rng.random() < 0.5 else 0.0
    if spread_mps > 0.0:
        _along_cubic(path[n], path[n + 1], steps[n], share, state)
    else:
        state[:] = (1.0 - share) * path[n] + share * path[n + 1]
    scale, offset, turned = rng.random(), np.empty(3), np.empty(3)
    for first, spread in ((0, scale * spread_m), (3, scale * spread_mps)):
        for k in range(3):
            offset[k] = spread * rng.standard_normal()
        _place(region, offset, turned)
        for k in range(3):
            state[first + k] += turned[k]
    return bool(look(space, state[0], state[1], state[2])[0])


@nb.njit(cache=True)
def _along_cubic(start: Float, end: Float, duration_s: float, share: float, state: Float) -> None:
    """Write the state (6,) at a share of the cubic between two states."""
    c, t = cubic_coefficients(start, end, duration_s), share * duration_s
    for k in range(3):
        state[k] = c[0, k] + t * (c[1, k] + t * (c[2, k] + t * c[3, k]))
        state[3 + k] = c[1, k] + t * (2.0 * c[2, k] + 3.0 * t * c[3, k])


@nb.njit(cache=True)
def _draw_velocity(region: Region, top_mps: float, rng: np.random.Generator, state: Float) -> None:
    """Velocity uniform in the ball of this radius."""
    if top_mps == 0.0:
        state[3:] = 0.0
        return
    offset = np.empty(3)
    square = 2.0
    while square > 1.0:
        for k in range(3):
            offset[k] = 2.0 * rng.random() - 1.0
        square = (offset**2).sum()
    _place(region, top_mps * offset, state[3:])


@nb.njit(cache=True)
def _place(region: Region, offset: Float, out: Float) -> None:
    """Turn an offset (3,) from the region's axes to the world's."""
    out[0] = region.cosine * offset[0] - region.sine * offset[1]
    out[1] = region.sine * offset[0] + region.cosine * offset[1]
    out[2] = offset[2]
