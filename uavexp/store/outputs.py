"""What a trial leaves behind: an identity that names it, and the contents of its files."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from uavexp import formats
from uavexp.config.build import GROUPS, TARGET, top_level
from uavexp.config.composition import Cell
from uavexp.errors import ConfigError, WorldError
from uavexp.flight import Trial
from uavexp.log import Replan
from uavexp.store.logs import arrays_digest, log_arrays, pack
from uavexp.store.records import LOG, RECORD, WALL, Status, canonical_json, seal
from uavexp.types import Outcome

_REPLAN = (
    "time_s",
    "effective_s",
    "cause",
    "score",
    "position_m",
    "goal_m",
    "status",
    "reason",
    "path_change_m",
    "iterations",
    "expansions",
    "near_change",
)  # what a record holds of a replan; its curves are in the log


def identity(cell: Cell) -> dict[str, Any]:
    """What makes a cell this cell: its configuration, files by their contents."""
    config = {group: _by_contents(group, cell.config[group]) for group in GROUPS}
    numbers = {key: cell.config[key] for key in top_level()}
    return {"strategy": cell.strategy, "options": cell.options, "config": {**config, **numbers}}


def trial_files(trial: Trial, head: Mapping[str, Any], wall: Mapping[str, Any]) -> dict[str, bytes]:
    """Contents of the files of a flown trial.

    Args:
        trial: what was flown.
        head: its identity, code and lock digests.
        wall: clock times and the command, kept beside the record.
    """
    arrays = log_arrays(trial.log)
    return {
        LOG: pack(arrays),
        WALL: _json({**wall, "laps": laps(trial)}),
        RECORD: seal({**head, **measured(trial), "log": arrays_digest(arrays)}).encode(),
    }


def failure_files(
    status: Status, reason: str, trace: Sequence[str], head: Mapping[str, Any], wall: Mapping[str, Any]
) -> dict[str, bytes]:
    """Contents of the files of a trial that did not run to its end: its reason and its traceback."""
    record = {
        **head,
        "status": status,
        "outcome": Outcome.ERROR,
        "reason": reason,
        "traceback": trace,
        "metrics": {},
    }
    return {WALL: _json(wall), RECORD: seal(record).encode()}


def measured(trial: Trial) -> dict[str, Any]:
    """Everything a table or figure needs of a flown trial, arrays apart."""
    from uavexp.metrics.replanning import request_delays

    log, world = trial.log, trial.world
    return {
        "status": Status.OK,
        "outcome": log.outcome,
        "reason": log.reason,
        "metrics": trial.metrics,
        "replans": [
            {**_replan(item), **delay._asdict()}
            for item, delay in zip(log.replans, request_delays(log), strict=True)
        ],
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
    }


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


def _replan(replan: Replan) -> dict[str, Any]:
    return {name: getattr(replan, name) for name in _REPLAN}


def _json(value: Any) -> bytes:
    return (canonical_json(value) + "\n").encode()


def _by_contents(group: str, parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters with files by their contents, so that a record holds no path."""
    folder = str(parameters.get("folder", ""))
    return {
        key: "" if key == "folder" else _content(group, key, value, folder)
        for key, value in parameters.items()
    }


def _content(group: str, key: str, value: Any, folder: str) -> Any:
    if key == TARGET or not isinstance(value, str) or not (key == "path" or key.endswith("_path")):
        return value
    try:
        digest = hashlib.sha256()
        for file in formats.files(formats.located(folder, value)):
            digest.update(file.read_bytes())
    except (OSError, WorldError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ConfigError(f"{group}.{key}={value} cannot be read: {reason}") from error
    return f"sha256:{digest.hexdigest()}"
