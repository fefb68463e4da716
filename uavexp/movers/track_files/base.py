"""What a file of people's tracks holds, whatever its format, and how its rows become tracks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from uavexp.arrays import Float
from uavexp.errors import WorldError

MOST_BYTES = 2**29
MOST_ROWS = 2_000_000  # 1 GiB while they are read
_LINES_OF_A_HEADER = 1000
FARTHEST_M = 1e6
LATEST_S = 1e10  # clocks count seconds since 1970 at most

Row = tuple[int, str, object, object, object]  # line or row of the file; person; time or frame, x, y: numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What a file may leave open; given, it holds whatever the file says."""

    unit_m: float | None = None  # m, of the file's lengths
    frame_rate_hz: float | None = None  # Hz, of the file's frames


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """A file, read but neither checked nor in seconds and metres."""

    rows: Sequence[Row]
    names: tuple[str, str, str] = ("frame", "x", "y")  # of the three numbers, for errors
    counts_frames: bool = True  # or seconds
    unit_m: float = 1.0  # as the file says
    frame_rate_hz: float | None = None  # None: it does not say


def text_of(path: Path) -> str:
    """The text of a file, without a byte order mark.

    Raises:
        WorldError: it is no UTF-8 text, or too long.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise WorldError(f"{path} is no UTF-8 text; save it as such") from error
    check_count(text.count("\n") - _LINES_OF_A_HEADER, path)
    return text


def check_count(rows: int, path: Path) -> None:
    """Refuse more rows than memory is meant for."""
    if rows > MOST_ROWS:
        raise WorldError(f"{path}: more than {MOST_ROWS} rows; cut the recording")


def number(value: object, name: str, path: Path, line: int) -> float:
    """A finite number, from text or as it is.

    Raises:
        WorldError: it is none; names file and line.
    """
    try:
        found = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        found = math.nan
    if not math.isfinite(found):
        raise WorldError(f"{path}:{line}: {name} must be a finite number, got {str(value)[:40]!r}")
    return found


def _numbers(recording: Recording, path: Path) -> Float:
    """Times or frames, x and y (N, 3), as the file has them."""
    try:
        found = np.array([row[2:] for row in recording.rows], dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        found = np.full((1, 3), np.nan)
    if np.isfinite(found).all():
        return found
    return np.array(  # slowly, to tell which one is none
        [
            [number(value, name, path, line) for value, name in zip(values, recording.names, strict=True)]
            for line, _, *values in recording.rows
        ]
    )


def tracks_of(recording: Recording, path: Path, options: Options) -> dict[str, Float]:
    """Tracks (N, 3) of time s, x m and y m by person, who stand in the order of the file.

    The rows of a person are sorted by time; a row that stands there twice counts once.

    Raises:
        WorldError: no rows or too many, no frame rate, a place or time out of bounds, or a person
            in two places at one time.
    """
    rows = recording.rows
    if not rows:
        raise WorldError(f"{path}: no rows")
    check_count(len(rows), path)
    people = list(dict.fromkeys(row[1] for row in rows))
    number_of = {person: index for index, person in enumerate(people)}
    line = np.array([row[0] for row in rows])
    whose = np.array([number_of[row[1]] for row in rows])
    unit_m = recording.unit_m if options.unit_m is None else options.unit_m
    samples = _numbers(recording, path) * [_period_s(recording, path, options), unit_m, unit_m]
    _check_bounds(samples, line, path)
    order = np.lexsort([samples[:, 0], whose])  # stable: rows of one time keep their order
    samples, whose, line = samples[order], whose[order], line[order]
    same = (np.diff(whose) == 0) & (np.diff(samples[:, 0]) == 0.0)
    moved = same & (np.diff(samples[:, 1:], axis=0) != 0.0).any(axis=1)
    if moved.any():
        n = int(moved.argmax()) + 1
        raise WorldError(
            f"{path}:{line[n]}: person {people[whose[n]]} is at {samples[n, 0]:g} s in another place than "
            f"in line {line[n - 1]}"
        )
    kept = np.append(True, ~same)
    samples, whose = samples[kept], whose[kept]
    parts = np.split(samples, np.flatnonzero(np.diff(whose)) + 1)
    return dict(zip(people, parts, strict=True))


def _period_s(recording: Recording, path: Path, options: Options) -> float:
    """Seconds from one count of the file's clock to the next."""
    if not recording.counts_frames:
        if options.frame_rate_hz is not None:
            raise WorldError(f"{path}: frame_rate_hz does not apply, it has times, not frames; leave it out")
        return 1.0
    rate_hz = recording.frame_rate_hz if options.frame_rate_hz is None else options.frame_rate_hz
    if rate_hz is None:
        raise WorldError(f"{path}: it counts frames and does not say how fast; give movers.frame_rate_hz=")
    if not 1e-3 <= rate_hz <= 1e6:
        raise WorldError(
            f"{path}: the frame rate must be 0.001 to 1e6 Hz, got {rate_hz:g}; give movers.frame_rate_hz="
        )
    return 1.0 / rate_hz


def _check_bounds(samples: Float, line: Float, path: Path) -> None:
    beyond = (np.abs(samples) > [LATEST_S, FARTHEST_M, FARTHEST_M]).any(axis=1)
    if beyond.any():
        n = int(beyond.argmax())
        raise WorldError(
            f"{path}:{line[n]}: {samples[n, 0]:.3g} s, {samples[n, 1]:.3g} m, {samples[n, 2]:.3g} m is too "
            "far; are its unit and frame rate right?"
        )
