"""The failed trials in `report.html`: how each ended, its picture, and the command that repeats it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

import pandas as pd

from uavexp.report.comparison import SCENE
from uavexp.report.html_parts import code, grid, row
from uavexp.report.results import ARM, OK, Results
from uavexp.store.records import PICTURE
from uavexp.store.study import TRIALS, Study, read_wall
from uavexp.store.table import TABLE

MOST_FAILED = 300  # rows of the table of failed trials
_ARRIVED = "reached"  # outcome of a flight that failed by a contact alone


def failed_trials(results: Results) -> str:
    """How many of each arm failed and how, then every trial without success."""
    study, flights = results.study, results.trials
    failed = flights[~flights["success"].astype(bool)]
    if failed.empty:
        return "<p>Every trial succeeded.</p>"
    rest = len(failed) - MOST_FAILED
    more = f" The first {MOST_FAILED} are shown, {rest} more are in {TABLE}." if rest > 0 else ""
    head = ("arm", "scene", "seed", "ended", "contacts", "picture", "command that repeats it")
    rows = (_failed_row(study, item) for item in failed.head(MOST_FAILED).to_dict("records"))
    return (
        f"<p>{len(failed)} of {len(flights)} trials did not reach their target without contact.</p>\n"
        + _by_ending(results, failed)
        + f"<p>Where no picture is kept, the command makes it.{more}</p>\n"
        + grid(head, rows, table_class="failed")
    )


def _by_ending(results: Results, failed: pd.DataFrame) -> str:
    """A row per arm with failures, a column per way of ending."""
    ended = pd.Series([_ending(item) for item in failed.to_dict("records")], index=failed.index)
    counts = pd.crosstab(failed[ARM], ended).reindex([arm for arm in results.arms if arm in set(failed[ARM])])
    rows = (
        row((escape(str(arm)), f"{int(found.sum())} of {results.panel.n(str(arm))}", *map(str, found)))
        for arm, found in counts.iterrows()
    )
    return grid(("arm", "failed", *map(str, counts.columns)), rows)


def _failed_row(study: Study, item: Mapping[Any, Any]) -> str:
    folder = study.folder / TRIALS / str(item["trial"])
    command = item.get("wall_command")
    if not isinstance(command, str):  # a table has NaN where there is none
        command = read_wall(folder).get("command") or ""
    cells = (
        escape(str(item[ARM])),
        escape(str(item[SCENE])),
        str(item["seed"]),
        escape(" ".join((_ending(item), *_reason(item)))),
        _whole(item.get("collision_count")),
        _picture(str(item["trial"])) if (folder / PICTURE).is_file() else "not kept",
        code(command) if command else "–",
    )
    return row(cells)


def _picture(trial: str) -> str:
    address = escape(f"{TRIALS}/{trial}/{PICTURE}")
    return f'<a href="{address}"><img class="thumb" loading="lazy" alt="picture" src="{address}"></a>'


def _ending(item: Mapping[Any, Any]) -> str:
    """Outcome, or for a trial that did not run to its end its status."""
    if item.get("status", OK) != OK:
        return str(item["status"])
    return f"{_ARRIVED} after contact" if item["outcome"] == _ARRIVED else str(item["outcome"])


def _reason(item: Mapping[Any, Any]) -> Iterator[str]:
    if isinstance(item.get("reason"), str) and item["reason"]:
        yield f"({item['reason']})"


def _whole(number: Any) -> str:
    return "–" if number is None or pd.isna(number) else f"{number:.0f}"
