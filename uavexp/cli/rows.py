"""A trial as one flat row of `trials.parquet`."""

from __future__ import annotations

from typing import Any

from uavexp.build import GROUPS, TARGET, TOP_LEVEL
from uavexp.cli.composition import Cell
from uavexp.cli.flight import Trial
from uavexp.types import Outcome


def flown_row(trial: Trial, laps: dict[str, Any], wall_s: float, folder: str) -> dict[str, Any]:
    """Row of a trial that was flown, however it ended.

    Args:
        trial: cell, seed and metrics.
        laps: clock times by part (`outputs.laps`).
        wall_s: clock time of the whole trial, s.
        folder: name of the trial's folder.
    """
    difficulty = trial.world.difficulty
    clock = {
        f"wall_{name}_{kind}": times[kind]
        for name, times in laps.items()
        for kind in ("sum_s", "median_s", "p99_s")
    }
    return {
        **_head(trial.cell, trial.seed),
        **trial.metrics,
        "clutter_density": difficulty.clutter_density,
        "narrowest_gap_m": difficulty.narrowest_gap_m,
        "straight_line_m": difficulty.straight_line_m,
        **_tail(trial.cell, folder, "ok"),
        "wall_trial_s": wall_s,
        **clock,
    }


def failed_row(cell: Cell, seed: int, wall_s: float, folder: str) -> dict[str, Any]:
    """Row of a trial that raised: it counts as a failure and has no measurements."""
    return {
        **_head(cell, seed),
        "outcome": str(Outcome.ERROR),
        "success": False,
        **_tail(cell, folder, "raised"),
        "wall_trial_s": wall_s,
    }


def _head(cell: Cell, seed: int) -> dict[str, Any]:
    return {"strategy": cell.strategy, "world": cell.options["world"], "seed": seed}


def _tail(cell: Cell, folder: str, status: str) -> dict[str, Any]:
    parameters = {
        f"p_{group}_{key}": value
        for group in GROUPS
        for key, value in cell.config[group].items()
        if key != TARGET
    }
    return {
        **{group: option for group, option in cell.options.items() if group != "world"},
        "status": status,
        "trial": folder,
        **parameters,
        **{f"p_{key}": cell.config[key] for key in TOP_LEVEL},
    }
