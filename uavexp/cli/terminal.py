"""What the person at the terminal sees: progress, a summary, and the folder last."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from uavexp.records import PICTURE

if TYPE_CHECKING:
    from uavexp.cli.flight import Progress as FlightProgress
    from uavexp.cli.job import Job, Result

_PATIENCE_S = 2.0  # nothing is shown for work that is done sooner
_PLAIN_PERIOD_S = 10.0  # between lines when the output is no terminal
_MAX_ROWS = 60
_TABLE_WIDTH = 150


class Terminal:
    """Writes to standard output; errors go elsewhere, as one line."""

    def __init__(self, console: Console | None = None) -> None:
        # folders and commands must survive a pipe unbroken
        self._console = console or Console(highlight=False, soft_wrap=True)
        self._bar: Progress | None = None
        self._total = self._done = self._successes = 0
        self._last_s = 0.0

    @contextmanager
    def progress(self, total: int, *, cold: bool = False) -> Iterator[None]:
        """Show progress over `total` trials while the block runs; `cold`: no kernel is compiled yet."""
        self._total = total
        what = "1 trial" if total == 1 else f"{total} trials"
        self._say(f"flying {what}" + (" (first run: compiling kernels takes about a minute)" if cold else ""))
        if not self._console.is_terminal:
            yield
            return
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.fields[words]}"),
        )
        with Progress(*columns, console=self._console, transient=True) as self._bar:
            self._bar.add_task("trials", total=total, words="")
            yield
        self._bar = None

    def flying(self, job: Job) -> FlightProgress:
        """Callback for the progress of one flight."""
        name = f"{job.cell.strategy} seed {job.seed}"

        def show(time_s: float, words: str) -> None:
            line = f"{name}: {time_s:.0f} s flown, {words}"
            if self._bar is not None:
                self._bar.update(self._bar.task_ids[0], words=line)
            elif time.monotonic() - self._last_s > (_PLAIN_PERIOD_S if self._done else _PATIENCE_S):
                self._say(line)

        return show

    def finished(self, result: Result) -> None:
        """Note that one trial has ended."""
        self._done += 1
        self._successes += bool(result.row["success"])
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], completed=self._done)
            self._bar.update(self._bar.task_ids[0], description=f"trials ({self._successes} succeeded)")
        elif self._total > 1:
            job = result.job
            self._say(
                f"[{self._done}/{self._total}] {job.cell.strategy} seed {job.seed}: {result.row['outcome']}"
                + (f" ({result.reason})" if result.reason else "")
            )

    def summary(self, results: Sequence[Result], root: Path) -> None:
        """Print the table of trials, how to repeat them, their pictures and, last, the folder."""
        # as wide as it needs: a cut-off number is worse than a wrapped line
        Console(file=self._console.file, width=_TABLE_WIDTH).print(_table(results[:_MAX_ROWS]))
        if len(results) > _MAX_ROWS:
            self._say(f"... and {len(results) - _MAX_ROWS} more in trials.parquet")
        for result in results[:_MAX_ROWS]:
            if result.trial is None:
                self._say(f"seed {result.job.seed} raised: {result.reason}")
            elif result.reason:
                self._say(f"seed {result.job.seed} ended {result.row['outcome']}: {result.reason}")
        for result in results[:_MAX_ROWS]:
            self._say(f"repeat:  {result.job.command}")
            if result.trial is not None:
                self._say(f"picture: {root / result.job.folder / PICTURE}")
        self._say(str(root))

    def _say(self, line: str) -> None:
        self._last_s = time.monotonic()
        self._console.print(line, markup=False)


def _table(results: Sequence[Result]) -> Table:
    table = Table(title=None, box=None, pad_edge=False, header_style="bold")
    for name in ("strategy", "world", "seed", "outcome"):
        table.add_column(name, no_wrap=True)
    for name in (
        "contacts",
        "time s",
        "path m",
        "shortest m",
        "replans",
        "clearance m",
        "tracking m",
        "wall s",
    ):
        table.add_column(name, justify="right", no_wrap=True)
    for result in results:
        row = result.row
        table.add_row(
            row["strategy"],
            row["world"],
            str(row["seed"]),
            row["outcome"],
            _number(row, "collision_count", 0),
            _number(row, "completion_time_s", 1),
            _number(row, "path_length_m", 1),
            _number(row, "shortest_path_m", 1),
            _replans(result),
            _number(row, "min_clearance_m", 2),
            _number(row, "tracking_error_m", 3),
            _number(row, "wall_trial_s", 1),
        )
    return table


def _number(row: dict[str, Any], name: str, digits: int) -> str:
    value = row.get(name)
    return "-" if value is None else f"{value:.{digits}f}"


def _replans(result: Result) -> str:
    """Replans with their causes, the first plan apart."""
    if result.trial is None:
        return "-"
    causes = Counter(item.cause for item in result.trial.log.replans[1:] if item.status == "ok")
    words = ", ".join(f"{count} {cause}" for cause, count in sorted(causes.items()))
    return f"{result.row['replans']}" + (f" ({words})" if words else "")
