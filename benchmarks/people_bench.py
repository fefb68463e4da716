"""`python -m benchmarks.people_bench [FILE ...]`: do social movers make way as recorded people do?

One person after the other is taken out of a recording and walks through it again, the others as recorded:
from the recorded place and velocity, wanting the mean velocity of the own track, for `WALK_S`. Blind: so it
goes. Social: the force of `uavexp.movers.social`; the files have no walls, so the sides of the area that all
tracks cover, the narrower way across, stand for them. Told are quantiles of
the least distance to another one's centre, the share of walks in which it was below 0.3 m (recorded people's
shoulders touch at about 0.4 m), how far from the recorded place the walk has ended, and the mean speed.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numba as nb
import numpy as np
from rich.console import Console
from rich.table import Table

from uavexp.arrays import Float
from uavexp.movers import track_files
from uavexp.movers.social import RELAX_S, force_of, wall_force

DATA = Path(__file__).resolve().parents[2] / "shared" / "data" / "tracks" / "pedpy"
FILES = (DATA / "bi-directional" / "bi_corr_400_b_03.txt", DATA / "jupedsim" / "trajectories.sqlite")
WALK_S, STEP_S = 4.0, 0.02
TOUCH_M = 0.3
HALF_M = 0.2  # of a person


@nb.njit(cache=True)
def walk(
    place: Float, velocity: Float, wanted: Float, others: Float, drift: Float, sides: Float, social: bool
) -> Float:
    """Places (K, 2) of one that walks among others (K, N, 2) with velocities (K, N, 2); NaN: not there."""
    places, at, going = np.empty((len(others), 2)), place.copy(), velocity.copy()
    for k in range(len(others)):
        places[k] = at
        push = (wanted - going) / RELAX_S
        for n in range(others.shape[1] if social else 0):
            if not np.isnan(drift[k, n, 0]):
                push += force_of(others[k, n] - at, going - drift[k, n], 0.0)
        for side in sides if social else sides[:0]:
            apart = side - at
            apart[np.isnan(side)] = 0.0
            push += wall_force(apart, HALF_M)
        going = going + STEP_S * push
        at = at + STEP_S * going
    return places


def resampled(path: Path) -> Float:
    """Places (K, N, 2) of all people of a file at every step; NaN where somebody is not there."""
    tracks = list(track_files.read(path, track_files.Options()).values())
    times_s = np.arange(min(t[0, 0] for t in tracks), max(t[-1, 0] for t in tracks), STEP_S)
    return np.stack(
        [
            np.stack([np.interp(times_s, t[:, 0], t[:, c], np.nan, np.nan) for c in (1, 2)], axis=1)
            for t in tracks
        ],
        axis=1,
    )


def sides_of(places: Float) -> Float:
    """Places (2, 2) of the walls: a coordinate each, the other is NaN."""
    low, high = np.nanmin(places, axis=(0, 1)) - HALF_M, np.nanmax(places, axis=(0, 1)) + HALF_M
    sides = np.stack([low, high])
    sides[:, np.argmax(high - low)] = np.nan
    return sides


def compared(places: Float) -> dict[str, Float]:
    """Rows (W, 3) of each kind of walker: least distance, error at the end, mean speed."""
    velocity = np.gradient(places, STEP_S, axis=0)
    sides, steps = sides_of(places), round(WALK_S / STEP_S)
    rows: dict[str, list[tuple[float, ...]]] = {"recorded": [], "social": [], "blind": []}
    for person in range(places.shape[1]):
        there = np.flatnonzero(np.isfinite(velocity[:, person, 0]))
        for first in there[: len(there) - steps : steps]:
            walked = slice(first, first + steps)
            true = places[walked, person]
            wanted = (places[there[-1], person] - places[there[0], person]) / (STEP_S * (len(there) - 1))
            others, drift = np.delete(places[walked], person, 1), np.delete(velocity[walked], person, 1)
            begin = (places[first, person], velocity[first, person], wanted, others, drift, sides)
            kinds = {"recorded": true, "social": walk(*begin, True), "blind": walk(*begin, False)}
            if not np.isfinite(true).all() or not np.isfinite(others).any():
                continue
            for kind, own in kinds.items():
                rows[kind].append((
                    np.nanmin(np.linalg.norm(others - own[:, None], axis=2)),
                    np.linalg.norm(own[-1] - true[-1]),
                    np.linalg.norm(np.diff(own, axis=0), axis=1).mean() / STEP_S,
                ))  # fmt: skip
    return {kind: np.array(found) for kind, found in rows.items()}


def main() -> None:
    """Print a table of each file."""
    for path in [Path(name) for name in sys.argv[1:]] or FILES:
        found = compared(resampled(path))
        table = Table("walker", "least distance 1 / 10 / 50 %, m", f"below {TOUCH_M} m, %", "error after "
                      f"{WALK_S:g} s, m", "speed 10 / 50 / 90 %, m/s", title=f"{path.name}: "
                      f"{len(found['blind'])} walks")  # fmt: skip
        for kind, rows in found.items():
            least, error, speed = rows.T
            table.add_row(
                kind,
                " / ".join(f"{value:.2f}" for value in np.quantile(least, [0.01, 0.1, 0.5])),
                f"{100.0 * (least < TOUCH_M).mean():.1f}",
                f"{error.mean():.2f}",
                " / ".join(f"{value:.2f}" for value in np.quantile(speed, [0.1, 0.5, 0.9])),
            )
        Console(width=110).print(table)


if __name__ == "__main__":
    main()
