"""A film of a flight: the plan view, with the map as it grew, above the clearance; drawn by Pillow."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from uavexp.arrays import Float
from uavexp.bodies import present
from uavexp.causes import cause_named
from uavexp.errors import ConfigError
from uavexp.export.map_voxels import mapped_until_m, spacing_m
from uavexp.log import TrialLog
from uavexp.store.stored_trial import StoredTrial
from uavexp.types import Shape

FRAMES_PER_S = 12
MOST_S = 12.0  # of film: a longer flight is shown faster
REST_S = 1.0  # the last picture stays
WIDTH, MOST_HEIGHT, STRIP = 720, 720, 110  # pixels; even, as video wants them
_MARGIN_M = 1.5  # around what was flown
_BAND_M = 0.5  # of the map, about the flight height
_TEXT, _WALL, _FLOWN, _MOVER = "#1b1b1b", "#2a2a2a", "#0072B2", "#882255"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plan:
    """Where the plan view lies in the picture."""

    low_m: Float  # (2,)
    high_m: Float  # (2,)
    scale: float  # pixels per m

    @property
    def height(self) -> int:
        return 2 * round(0.5 * self.scale * float(self.high_m[1] - self.low_m[1])) + 2

    def pixels(self, points_m: Float) -> list[tuple[float, float]]:
        """Pixels of places (N, 2 or 3); y of the world points up."""
        x = (points_m[:, 0] - self.low_m[0]) * self.scale
        y = (self.high_m[1] - points_m[:, 1]) * self.scale
        return list(zip(x.tolist(), y.tolist(), strict=True))


def film_bytes(trial: StoredTrial, suffix: str) -> bytes:
    """The film of a flight.

    Args:
        trial: that was flown.
        suffix: `.gif`, or `.mp4`, which needs the package imageio-ffmpeg.

    Raises:
        ConfigError: another suffix, or the package is missing.
    """
    frames = list(pictures(trial))
    frames += frames[-1:] * round(REST_S * FRAMES_PER_S)
    if suffix == ".gif":
        return _gif(frames)
    if suffix == ".mp4":
        return _mp4(frames)
    raise ConfigError(f"a film ends in .gif or .mp4, got {suffix or 'no suffix'!r}")


def pictures(trial: StoredTrial) -> Iterator[Image.Image]:
    """The pictures of a film, equally far apart in the flight."""
    log, plan = trial.log, _plan_of(trial)
    begin_s, end_s = float(log.steps.time_s[0]), float(log.steps.time_s[-1])
    count = max(2, round(min(MOST_S, end_s - begin_s) * FRAMES_PER_S))
    for time_s in np.linspace(begin_s, end_s, count).tolist():
        picture = Image.new("RGB", (WIDTH, plan.height + STRIP), "white")
        pen = ImageDraw.Draw(picture)
        _draw_map(pen, plan, log, time_s)
        _draw_movers(pen, plan, log, time_s)
        _draw_flight(pen, plan, trial, time_s)
        _draw_clearance(pen, plan.height, log, time_s)
        yield picture


def _plan_of(trial: StoredTrial) -> _Plan:
    places_m = trial.log.steps.position_m[:, :2]
    if trial.world is not None:
        places_m = np.vstack([places_m, trial.world.target_m[None, :2]])
    low_m, high_m = places_m.min(axis=0) - _MARGIN_M, places_m.max(axis=0) + _MARGIN_M
    scale = float(min(WIDTH / (high_m[0] - low_m[0]), MOST_HEIGHT / (high_m[1] - low_m[1])))
    spare_m = WIDTH / scale - (high_m[0] - low_m[0])
    aside_m = np.array([0.5 * spare_m, 0.0])
    return _Plan(low_m=low_m - aside_m, high_m=high_m + aside_m, scale=scale)


def _draw_map(pen: Any, plan: _Plan, log: TrialLog, time_s: float) -> None:
    mapped_m = mapped_until_m(log, time_s).reshape(-1, 3)
    height_m = float(np.median(log.steps.position_m[:, 2]))
    near_m = mapped_m[np.abs(mapped_m[:, 2] - height_m) <= _BAND_M]
    half = 0.5 * spacing_m(log.mapped_m.reshape(-1, 3).astype(np.float64)) * plan.scale
    for x, y in plan.pixels(np.unique(np.round(near_m[:, :2], 3), axis=0)):
        pen.rectangle((x - half, y - half, x + half, y + half), fill=_WALL)


def _draw_movers(pen: Any, plan: _Plan, log: TrialLog, time_s: float) -> None:
    if not log.movers.shape.size:
        return
    places_m = log.movers.position_m[_row(log, time_s)].astype(np.float64)
    for index in np.flatnonzero(present(places_m)):
        ((x, y),) = plan.pixels(places_m[index][None])
        wide, deep = (plan.scale * log.movers.half_size_m[index, :2]).tolist()
        draw = pen.rectangle if log.movers.shape[index] == Shape.BOX else pen.ellipse
        draw((x - wide, y - deep, x + wide, y + deep), fill=_MOVER)


def _draw_flight(pen: Any, plan: _Plan, trial: StoredTrial, time_s: float) -> None:
    log, row = trial.log, _row(trial.log, time_s)
    taken = [item for item in log.replans if item.effective_s <= time_s and len(item.trajectory_m)]
    if taken:
        colour = cause_named(taken[-1].cause).colour
        pen.line(plan.pixels(taken[-1].trajectory_m.astype(np.float64)), fill=colour, width=3)
    stride = max(1, row // 800)
    flown = plan.pixels(np.vstack([log.steps.position_m[:row:stride], log.steps.position_m[row]]))
    pen.line(flown, fill=_FLOWN, width=4)
    for item in log.replans:
        if item.time_s <= time_s:
            _dot(pen, plan, item.position_m, 6, cause_named(item.cause).colour)
    _dot(pen, plan, log.steps.position_m[0], 7, "white", "start")
    if trial.world is not None:
        _dot(pen, plan, trial.world.target_m, 9, "#F0E442", "target")
    _dot(pen, plan, log.steps.position_m[row], 9, _FLOWN)


def _draw_clearance(pen: Any, top: int, log: TrialLog, time_s: float) -> None:
    row, end_s = _row(log, time_s), max(float(log.steps.time_s[-1]), log.step_s)
    most_m = max(1.0, float(log.steps.clearance_m.max()))
    bottom, deep = top + STRIP - 8, STRIP - 44
    stride = max(1, len(log.steps.time_s) // WIDTH)
    x = log.steps.time_s[::stride] / end_s * WIDTH
    y = bottom - np.clip(log.steps.clearance_m[::stride], 0.0, None) / most_m * deep
    curve = list(zip(x.tolist(), y.tolist(), strict=True))
    pen.rectangle((0, top, WIDTH, top + STRIP), fill="white")
    pen.line([(0, top), (WIDTH, top)], fill="#c8c8c8")
    pen.line(curve, fill="#bcd6e8", width=2)
    pen.line(curve[: row // stride + 1], fill=_FLOWN, width=3)
    asked = [item for item in log.replans if item.time_s <= time_s]
    why = (
        f"   plan {len(asked) - 1}: {asked[-1].cause}, {cause_named(asked[-1].cause).label}" if asked else ""
    )
    words = f"{time_s:5.1f} s   clearance {log.steps.clearance_m[row]:.2f} m{why}"
    pen.text((10, top + 8), words, fill=_TEXT, font=ImageFont.load_default(18))


def _dot(pen: Any, plan: _Plan, place_m: Float, radius: int, colour: str, word: str = "") -> None:
    ((x, y),) = plan.pixels(place_m[None])
    pen.ellipse((x - radius, y - radius, x + radius, y + radius), fill=colour, outline="black", width=2)
    font = ImageFont.load_default(16)
    fits = x + radius + 4 + font.getlength(word) < pen.im.size[0]  # else it stands on the other side
    pen.text(
        (x + radius + 4 if fits else x - radius - 4, y),
        word,
        fill=_TEXT,
        font=font,
        anchor="lm" if fits else "rm",
    )


def _row(log: TrialLog, time_s: float) -> int:
    return int(np.searchsorted(log.steps.time_s, time_s, side="right")) - 1


def _gif(frames: list[Image.Image]) -> bytes:
    film = io.BytesIO()
    palette = frames[-1].quantize(64)  # one for all: nothing flickers
    small = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    small[0].save(
        film, format="GIF", save_all=True, append_images=small[1:], duration=1000 // FRAMES_PER_S, loop=0
    )
    return film.getvalue()


def _mp4(frames: list[Image.Image]) -> bytes:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise ConfigError(f"--mp4 needs imageio-ffmpeg ({error}): pip install imageio-ffmpeg") from error
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "film.mp4"
        writer = imageio_ffmpeg.write_frames(
            str(file), frames[0].size, fps=FRAMES_PER_S, macro_block_size=2, ffmpeg_log_level="error"
        )
        writer.send(None)
        for frame in frames:
            writer.send(frame.tobytes())
        writer.close()
        return file.read_bytes()
