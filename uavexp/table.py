"""`trials.parquet`: one row per trial, whoever flew it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from uavexp.records import canonical_json, write_atomically

TABLE = "trials.parquet"
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

Row = Mapping[str, Any]


def columns_of(rows: Sequence[Row]) -> list[str]:
    """Column order: the first ones, other metrics, options, `p_` parameters, `wall_` times."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    rest = [name for name in names if name not in FIRST]
    parameters = sorted(name for name in rest if name.startswith("p_"))
    clock = [name for name in rest if name.startswith("wall_")]
    others = [name for name in rest if not name.startswith(("p_", "wall_"))]
    return [*FIRST, *others, *parameters, *clock]


def write_table(path: Path, rows: Sequence[Row]) -> None:
    """Write rows, in the order given, with page checksums.

    Values that no column can hold as they are (lists, mixed types) become canonical JSON.
    """
    import pyarrow as pa
    from pyarrow import parquet

    columns = {name: _column([row.get(name) for row in rows]) for name in columns_of(rows)}
    table = pa.table(columns)
    write_atomically(path, lambda file: parquet.write_table(table, file, write_page_checksum=True))


def _column(values: list[Any]) -> list[Any]:
    kinds = {type(value) for value in values if value is not None}
    if kinds <= {int, float} and kinds:
        return [value if value is None or kinds == {int} else float(value) for value in values]
    if len(kinds) <= 1 and kinds <= {bool, str}:
        return values
    return [value if value is None or isinstance(value, str) else canonical_json(value) for value in values]
