"""`trials.parquet` and `replans.parquet`: rows made from stored records, so that no history shows in them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from uavexp.config.build import GROUPS
from uavexp.metrics.evaluate import METRICS
from uavexp.store.records import canonical_json, restore, trial_name, write_atomically

TABLE, REPLANS = "trials.parquet", "replans.parquet"
FIRST = (
    "strategy",
    "world",
    "seed",
    "outcome",
    "success",
    "path_length_m",
    "shortest_path_m",
    "completion_time_s",
    "collision_count",
    "min_clearance_m",
    "min_clearance_esdf_m",
    "replans",
    "tracking_error_m",
)
FIRST_OF_REPLANS = (
    "trial",
    "strategy",
    "world",
    "seed",
    "number",
    "time_s",
    "effective_s",
    "cause",
    "score",
    "blocked_since_s",
    "delay_s",
)
ERROR = "error"  # outcome of a trial that did not run to an end
_WORLD_NUMBERS = ("clutter_density", "narrowest_gap_m", "straight_line_m")
_LAP_KINDS = ("sum_s", "median_s", "p99_s")
_NO_DELAY = {"blocked_since_s": math.nan, "delay_s": math.nan}  # of a record that does not tell
_OF_REPLANS = ("x_m", "y_m", "z_m", "path_change_m", "iterations", "expansions", "near_change")
_TARGET = "_target_"
_OURS = {
    *FIRST, *FIRST_OF_REPLANS, *_OF_REPLANS, *_WORLD_NUMBERS, *GROUPS, *(metric.column for metric in METRICS),
    "status", "reason", "world_digest", "code", "lock",
}  # fmt: skip
_OURS_BEGIN = ("p_", "wall_", "replans_", "goal_")

Row = dict[str, Any]
Record = Mapping[str, Any]


def is_ours(column: str) -> bool:
    """Whether a column holds what was measured or configured, so that no axis may be called like it."""
    return column in _OURS or column.startswith(_OURS_BEGIN)


def row_of(record: Record, wall: Mapping[str, Any], labels: Mapping[str, str]) -> Row:
    """A trial as a row of `trials.parquet`.

    Args:
        record: of `read_record`. One whose status is not ok has no measurements and counts as
            a failure.
        wall: content of its `wall.json`; empty when there is none.
        labels: the trial's place on each axis of its study.
    """
    flown = {"outcome": ERROR, "success": False} | record["metrics"]
    world = record.get("world", {})
    return {
        "strategy": record["strategy"],
        "world": record["options"]["world"],
        "seed": record["seed"],
        **flown,
        **{name: restore(world[name]) for name in _WORLD_NUMBERS if name in world},
        **{group: option for group, option in record["options"].items() if group != "world"},
        **labels,
        "status": record["status"],
        "reason": record["reason"],
        "trial": trial_name(record),
        "world_digest": world.get("digest"),
        "code": record["code"][:12],
        "lock": (record.get("lock") or "")[:12],
        **parameters(record["config"]),
        **_clock(wall),
    }


def with_every_cause(rows: Sequence[Row]) -> list[Row]:
    """The rows with a count of 0 for each cause that another flight replanned for, and this one did not."""
    counted = {name for row in rows for name in row if name.startswith("replans_")}
    return [row | {name: 0 for name in counted - row.keys()} if "replans" in row else row for row in rows]


def pooled_versions(versions: Iterable[tuple[str, ...]]) -> str:
    """A sentence about trials of several versions in one table; empty for one version.

    Args:
        versions: of each trial: the columns `code` and `lock`.
    """
    counts = Counter(versions)
    if len(counts) < 2:
        return ""
    trials = ", ".join(
        f"{count} of {' with '.join(filter(None, version)) or 'an unknown one'}"
        for version, count in sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    )
    return (
        f"Trials of {len(counts)} versions of the code or its packages are pooled here "
        f"(runner.accept_other_code): {trials}."
    )


def replan_rows(record: Record, labels: Mapping[str, str]) -> Iterator[Row]:
    """A trial's planning requests as rows of `replans.parquet`; number 0 is the first plan.

    `blocked_since_s` and `delay_s` are NaN where the flown trajectory was not blocked when the
    plan was asked for (`metrics.replanning.request_delays`).

    Args:
        record: of `read_record`.
        labels: the trial's place on each axis of its study.
    """
    whose = {
        "trial": trial_name(record),
        "strategy": record["strategy"],
        "world": record["options"]["world"],
        **labels,
        "seed": record["seed"],
    }
    for number, replan in enumerate(record.get("replans", ())):
        numbers = {name: restore(value) for name, value in replan.items() if not isinstance(value, list)}
        position = dict(zip(("x_m", "y_m", "z_m"), replan["position_m"], strict=True))
        goal = dict(zip(("goal_x_m", "goal_y_m", "goal_z_m"), replan["goal_m"], strict=True))
        yield {**whose, "number": number, **position, **goal, **_NO_DELAY, **numbers}


def columns_of(rows: Sequence[Row], first: Sequence[str] = FIRST) -> list[str]:
    """Column order: the first ones, other metrics, options, `p_` parameters, `wall_` times."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    rest = [name for name in names if name not in first]
    parameters = sorted(name for name in rest if name.startswith("p_"))
    clock = sorted(name for name in rest if name.startswith("wall_"))
    others = [name for name in rest if not name.startswith(("p_", "wall_"))]
    return [*first, *others, *parameters, *clock]


def write_table(path: Path, rows: Sequence[Row], first: Sequence[str] = FIRST) -> None:
    """Write rows, in the order given, with page checksums; the same rows give the same bytes.

    Values that no column can hold as they are (lists, mixed types) become canonical JSON.

    Args:
        path: of the parquet file.
        rows: what to write; a value that a row lacks is null.
        first: columns that stand first and are there even without any row.
    """
    import pyarrow as pa
    from pyarrow import parquet

    names = columns_of(rows, first)
    table = pa.table({name: _column([row.get(name) for row in rows]) for name in names})
    write_atomically(path, lambda file: parquet.write_table(table, file, write_page_checksum=True))


def parameters(config: Mapping[str, Any]) -> Row:
    """`p_<group>_<parameter>` of every group, `p_<key>` of what belongs to none."""
    row: Row = {}
    for name, value in config.items():
        parts = value if isinstance(value, Mapping) else {"": value}
        for key, item in parts.items():
            if key != _TARGET:
                row |= _parameter(f"p_{name}_{key}".rstrip("_"), item)
    return row


def _parameter(column: str, value: Any) -> Row:
    """A parameter's column; of an option that is held: its name, and columns of its parameters."""
    if isinstance(value, Mapping) and _TARGET in value:
        row: Row = {column: str(value[_TARGET]).rpartition(".")[0].rpartition(".")[2]}
        for key, item in value.items():
            if key != _TARGET:
                row |= _parameter(f"{column}_{key}", item)
        return row
    return {column: None if value is None else restore(value)}


def _clock(wall: Mapping[str, Any]) -> Row:
    row = {name: value for name, value in wall.items() if name.startswith("wall_")}
    if wall.get("command"):
        row["wall_command"] = wall["command"]
    for part, lap in (wall.get("laps") or {}).items():
        row |= {f"wall_{part}_{kind}": lap[kind] for kind in _LAP_KINDS if kind in lap}
    return row


def _column(values: list[Any]) -> list[Any]:
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {int, float} and kinds:
        return [value if value is None or kinds == {int} else float(value) for value in values]
    if len(kinds) <= 1 and kinds <= {bool, str}:
        return values
    return [value if value is None or isinstance(value, str) else canonical_json(value) for value in values]
