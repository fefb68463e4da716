"""Tables on the terminal: what tells one trial from the next is in its line."""

from __future__ import annotations

import io
from typing import Any

from rich.console import Console

from uavexp.cli.summary import trial_table


def printed(rows: list[dict[str, Any]], axes: list[str]) -> list[str]:
    console = Console(file=io.StringIO(), width=150)
    console.print(trial_table(rows, axes))
    return str(console.file.getvalue()).splitlines()  # type: ignore[attr-defined]


def row(cell: str, strategy: str = "mcr") -> dict[str, Any]:
    return {"cell": cell, "strategy": strategy, "world": "rooms", "seed": 0, "outcome": "reached"}


def test_a_sweep_over_planners_names_the_planner_in_each_line() -> None:
    """Used to show the strategy alone, the same in all lines."""
    head, *lines = printed([row("mcr planner=astar"), row("mcr planner=min_acc")], ["cell"])
    assert head.split()[:2] == ["cell", "strategy"]
    assert [line.split()[:2] for line in lines] == [["mcr", "planner=astar"], ["mcr", "planner=min_acc"]]


def test_what_the_strategy_says_is_not_said_twice() -> None:
    head, *_ = printed([row("mcr"), row("tbr", "tbr")], ["cell"])
    assert head.split()[0] == "strategy"


def test_causes_of_ones_own_are_told_by_name_and_shares_are_no_causes() -> None:
    counts = {"replans": 3, "replans_map": 1, "replans_metres": 2, "replans_near_change_share": 1.0}
    assert "3 (1 map, 2 metres)" in printed([row("mine") | counts], ["cell"])[1]
