"""A command's trials as tables on the terminal: one line each, or one line per cell."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.table import Table

from uavexp.causes import OTHER
from uavexp.store.table import Row

_CAUSES = "replans_"
_NAMED = {OTHER.name: "by the pilot"}  # column replans_other


def trial_table(rows: Sequence[Row], axes: Sequence[str]) -> Table:
    """One line per trial.

    Args:
        rows: of `trials.parquet`.
        axes: columns that tell cells apart; shown are those in which rows differ, in more than strategy.
    """
    differ = [axis for axis in axes if len({row[axis] for row in rows}) > 1]
    varied = [axis for axis in differ if any(row[axis] != row["strategy"] for row in rows)]
    table = _table(
        (*varied, "strategy", "world", "seed", "outcome"),
        ("contacts", "time s", "path m", "shortest m", "replans", "clearance m", "tracking m", "wall s"),
    )
    for row in rows:
        table.add_row(
            *(row[axis] for axis in varied),
            row["strategy"],
            row["world"],
            str(row["seed"]),
            row["outcome"],
            _number(row, "collision_count", 0),
            _number(row, "completion_time_s", 1),
            _number(row, "path_length_m", 1),
            _number(row, "shortest_path_m", 1),
            _replans(row),
            _number(row, "min_clearance_m", 2),
            _number(row, "tracking_error_m", 3),
            _number(row, "wall_trial_s", 1),
        )
    return table


def cell_table(rows: Sequence[Row], axes: Sequence[str]) -> Table:
    """One line per cell.

    Args:
        rows: of `trials.parquet`.
        axes: columns that tell the cells apart.
    """
    cells: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        cells.setdefault(tuple(row[axis] for axis in axes), []).append(row)
    table = _table(axes, ("n", "did not run", "success %", "contacts", "replans", "clearance m", "wall s"))
    for labels, own in cells.items():
        table.add_row(
            *labels,
            str(len(own)),
            str(sum(row["status"] != "ok" for row in own)),
            f"{100.0 * sum(bool(row['success']) for row in own) / len(own):.0f}",
            _mean(own, "collision_count", 1),
            _mean(own, "replans", 1),
            _mean(own, "min_clearance_m", 2),
            _mean(own, "wall_trial_s", 1),
        )
    return table


def _table(words: Sequence[str], numbers: Sequence[str]) -> Table:
    table = Table(title=None, box=None, pad_edge=False, header_style="bold")
    for name in words:
        table.add_column(name, no_wrap=True)
    for name in numbers:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def _number(row: Row, name: str, digits: int) -> str:
    value = row.get(name)
    return "-" if value is None else f"{value:.{digits}f}"


def _mean(rows: Sequence[Row], name: str, digits: int) -> str:
    values = [row[name] for row in rows if row.get(name) is not None and math.isfinite(row[name])]
    return f"{sum(values) / len(values):.{digits}f}" if values else "-"


def _replans(row: Row) -> str:
    """Replans with their causes, the first plan apart."""
    if row.get("replans") is None:
        return "-"
    causes = {
        name.removeprefix(_CAUSES): count
        for name, count in sorted(row.items())
        if name.startswith(_CAUSES) and isinstance(count, int) and count  # rates and shares are no counts
    }
    words = ", ".join(f"{count} {_NAMED.get(cause, cause)}" for cause, count in causes.items())
    return f"{row['replans']}" + (f" ({words})" if words else "")
