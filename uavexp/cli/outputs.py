"""Output folders: a trial's files, an identity that names it, and the row it becomes."""

from __future__ import annotations

import hashlib
import os
import re
import tempfile
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from uavexp.build import GROUPS, TARGET, TOP_LEVEL
from uavexp.cli.composition import Cell
from uavexp.cli.flight import Trial
from uavexp.errors import ConfigError
from uavexp.logs import arrays_digest, log_arrays, write_log
from uavexp.paths import PACKAGE, outputs_root
from uavexp.records import LOG, PICTURE, RECORD, WALL, canonical_json, digest, seal, write_text
from uavexp.table import TABLE
from uavexp.types import Outcome


def identity(cell: Cell, seed: int) -> dict[str, Any]:
    """What makes a trial this trial: its configuration, files by their contents, and its seed."""
    config = {
        group: {key: _content(group, key, value) for key, value in cell.config[group].items()}
        for group in GROUPS
    }
    numbers = {key: cell.config[key] for key in TOP_LEVEL}
    return {"strategy": cell.strategy, "options": cell.options, "config": {**config, **numbers}, "seed": seed}


def folder_name(cell: Cell, seed: int) -> str:
    """A short readable prefix and a hash of the trial's identity."""
    prefix = re.sub(r"[^A-Za-z0-9_]+", "_", f"{cell.strategy}-{cell.options['world']}")[:40]
    return f"{prefix}-s{seed}-{digest(identity(cell, seed))[:12]}"


def write_trial(trial: Trial, folder: Path, run: dict[str, Any], wall: dict[str, Any]) -> None:
    """Write the files of a flown trial; the record comes last, so that it vouches for the rest.

    Args:
        trial: what was flown.
        folder: of this trial, existing.
        run: code and lock digests.
        wall: clock times and the command, kept beside the record.
    """
    from uavexp.report.picture import draw

    arrays = log_arrays(trial.log)
    write_log(folder / LOG, arrays)
    shown = {**trial.metrics, "seed": trial.seed, "strategy": trial.cell.strategy}
    with _temporary_beside(folder / PICTURE) as path:
        draw(trial.world, trial.log, shown, wall["command"], path)
    write_text(folder / WALL, canonical_json({**wall, "laps": laps(trial)}) + "\n")
    write_text(folder / RECORD, seal(record_of(trial, run, arrays_digest(arrays))))


def record_of(trial: Trial, run: dict[str, Any], log_digest: str) -> dict[str, Any]:
    """Everything a table or figure needs of a flown trial, arrays apart."""
    log, world = trial.log, trial.world
    replans = [
        {
            "time_s": item.time_s,
            "effective_s": item.effective_s,
            "cause": item.cause,
            "score": item.score,
            "position_m": item.position_m,
            "goal_m": item.goal_m,
            "status": item.status,
            "reason": item.reason,
            "path_change_m": item.path_change_m,
            "iterations": item.iterations,
            "expansions": item.expansions,
        }
        for item in log.replans
    ]
    return {
        **identity(trial.cell, trial.seed),
        **run,
        "status": "ok",
        "outcome": log.outcome,
        "reason": log.reason,
        "metrics": trial.metrics,
        "replans": replans,
        "contacts": [
            {"start_s": item.start_s, "end_s": item.end_s, "position_m": item.position_m}
            for item in log.contacts
        ],
        "world": {
            "digest": world.digest,
            "start_m": world.start_m,
            "target_m": world.target_m,
            "clutter_density": world.difficulty.clutter_density,
            "narrowest_gap_m": world.difficulty.narrowest_gap_m,
            "straight_line_m": world.difficulty.straight_line_m,
            "shortest_path_m": world.difficulty.shortest_path_m,
            "detour": world.difficulty.detour,
        },
        "log": log_digest,
    }


def write_failure(
    cell: Cell, seed: int, folder: Path, run: dict[str, Any], wall: dict[str, Any], error: BaseException
) -> None:
    """Write the record of a trial that raised: its reason and its traceback."""
    record = {
        **identity(cell, seed),
        **run,
        "status": "raised",
        "outcome": Outcome.ERROR,
        "reason": reason_of(error),
        "traceback": portable_traceback(error),
        "metrics": {},
    }
    write_text(folder / WALL, canonical_json(wall) + "\n")
    write_text(folder / RECORD, seal(record))


def reason_of(error: BaseException) -> str:
    """Type and message of an error in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def portable_traceback(error: BaseException) -> list[str]:
    """Frames of an error by module file and line, without any path of this machine."""
    frames = traceback.extract_tb(error.__traceback__)
    return [f"{_module_file(frame.filename)}:{frame.lineno} {frame.name}: {frame.line}" for frame in frames]


def laps(trial: Trial) -> dict[str, Any]:
    """Clock times of the parts of a flight: calls, sum, median and 99 % in seconds."""
    return {
        name: {
            "calls": len(times),
            "sum_s": float(np.sum(times)),
            "median_s": float(np.median(times)),
            "p99_s": float(np.quantile(times, 0.99)),
        }
        for name, times in trial.log.wall_s.items()
        if len(times)
    }


@contextmanager
def output_folder(out: str | None, prefix: str) -> Iterator[Path]:
    """The folder a command writes to; if nothing was written in it, it is removed again.

    Args:
        out: as typed, relative to the working directory; None makes `outputs/NNNN-prefix`.
        prefix: of the new folder's name.

    Raises:
        ConfigError: it cannot be written, or holds the trials of an earlier command.
    """
    folder = Path(out).expanduser().absolute() if out is not None else _next_folder(outputs_root(), prefix)
    if (folder / TABLE).exists():
        raise ConfigError(f"out={out} holds the trials of an earlier command; name another folder")
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError as error:
            raise ConfigError(
                f"cannot write to the output folder {folder} ({error.strerror}); use out=DIR"
            ) from error
        yield folder
    finally:
        for path in made:
            try:
                path.rmdir()  # only an empty one
            except OSError:
                break


def _next_folder(root: Path, prefix: str) -> Path:
    numbers = [int(match[1]) for item in root.glob("*") if (match := re.match(r"(\d+)-", item.name))]
    return root / f"{max(numbers, default=0) + 1:04d}-{prefix}"


@contextmanager
def _temporary_beside(path: Path) -> Iterator[Path]:
    """A temporary name in the same folder that becomes `path` when the block succeeds."""
    temporary = path.with_name(f".{path.stem}.part{path.suffix}")
    try:
        yield temporary
        with temporary.open("rb") as file:
            os.fsync(file.fileno())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _content(group: str, key: str, value: Any) -> Any:
    """A file parameter by its contents, so that a record holds no path."""
    if key == TARGET or not isinstance(value, str) or not (key == "path" or key.endswith("_path")):
        return value
    file = Path(value).expanduser()
    try:
        data = file.read_bytes()
        if file.suffix in (".yaml", ".yml"):  # a ROS map names its image
            image = re.search(rb"^image:\s*['\"]?(.+?)['\"]?\s*$", data, re.MULTILINE)
            data += (file.parent / image[1].decode()).read_bytes() if image else b""
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not text"
        raise ConfigError(f"{group}.{key}={value} cannot be read: {reason}") from error
    return f"sha256:{hashlib.sha256(data).hexdigest()}"


def _module_file(filename: str) -> str:
    path = Path(filename)
    if path.is_relative_to(PACKAGE):
        return path.relative_to(PACKAGE.parent).as_posix()
    return "/".join(path.parts[-2:])
