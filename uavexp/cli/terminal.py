"""What the person at the terminal sees: progress, a summary, and the folder last."""

from __future__ import annotations

import math
import shlex
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from uavexp.cli.summary import cell_table, trial_table
from uavexp.config.own_code import own_frame
from uavexp.store.records import LOG, PICTURE, RECORD, read_record
from uavexp.store.study import TRIALS
from uavexp.store.table import pooled_versions

if TYPE_CHECKING:
    from uavexp.store.table import Row
    from uavexp.sweep.agenda import Agenda
    from uavexp.sweep.job import Done, Job

_PATIENCE_S = 2.0  # nothing is shown for work that is done sooner
_PLAIN_PERIOD_S = 10.0  # between lines when the output is no terminal
_MOST_LINES = 50  # so many trials get a line each
_MAX_ROWS = 60
_MAX_FAILURES = 20
_TABLE_WIDTH = 150


class Terminal:
    """Writes to standard output; errors go elsewhere, as one line."""

    def __init__(self, console: Console | None = None, *, bar: bool = True) -> None:
        # folders and commands must survive a pipe unbroken
        self._console = console or Console(highlight=False, markup=False, emoji=False, soft_wrap=True)
        self._draws_bar = bar and self._console.is_terminal  # a debugger needs the line to itself
        self._bar: Progress | None = None
        self._lock = threading.Lock()  # flights report from several threads
        self._notes: set[str] = set()  # of the worlds, that were said
        self._total = self._done = self._successes = 0
        self._begin_s = self._last_s = time.monotonic()

    def say(self, line: str) -> None:
        """Print one line as it is."""
        self._last_s = time.monotonic()
        self._console.print(line)

    def listing(self, agenda: Agenda, folder: Path) -> None:
        """Print what would be flown."""
        self._announce(agenda, "to fly")
        for job in agenda.left:
            self.say(f"{job.name}  {job.payload.command}")
        self.say(str(folder))

    @contextmanager
    def progress(self, agenda: Agenda) -> Iterator[None]:
        """Show progress over the trials that are left while the block runs."""
        self._total, self._begin_s = len(agenda.left), time.monotonic()
        self._announce(agenda, "flying")
        if not self._draws_bar or not self._total:
            yield
            return
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.fields[words]}", markup=False),
        )
        with Progress(*columns, console=self._console, transient=True) as self._bar:
            self._bar.add_task("trials", total=self._total, words="")
            yield
        self._bar = None

    def watch(self, job: Job, time_s: float, words: str) -> None:
        """Note the progress of one flight; before it (NaN) say once what is noted of its world."""
        if math.isnan(time_s):
            with self._lock:
                if words not in self._notes:
                    self._notes.add(words)
                    self.say(f"note: {words}")
            return
        line = f"{job.label}: {time_s:.0f} s flown, {words}"
        with self._lock:
            if self._bar is not None:
                self._bar.update(self._bar.task_ids[0], words=line)
            elif time.monotonic() - self._last_s > (_PLAIN_PERIOD_S if self._done else _PATIENCE_S):
                self.say(self._standing() if self._done and self._total > _MOST_LINES else line)

    def printed(self, text: str) -> None:
        """Pass on what a component has printed."""
        with self._lock:
            self.say(text.rstrip("\n"))

    def finished(self, done: Done) -> None:
        """Note that one trial has ended."""
        flown = done.answer.value
        outcome, reason = (flown.outcome, flown.reason) if flown else ("error", done.answer.reason)
        with self._lock:
            self._done += 1
            self._successes += bool(flown and flown.success)
            if self._bar is not None:
                rate = f"trials ({self._successes} succeeded, {self._successes / self._done:.0%})"
                self._bar.update(self._bar.task_ids[0], completed=self._done, description=rate)
            elif 1 < self._total <= _MOST_LINES:
                why = f" ({reason})" if reason else ""
                self.say(f"{self._standing()}; {done.job.label}: {outcome}{why}")
            elif self._total > 1 and time.monotonic() - self._last_s > _PLAIN_PERIOD_S:
                self.say(self._standing())

    def stopped(self, folder: Path, flown: int, total: int, *, again: bool) -> None:
        """Say what an interrupted command leaves and how to go on."""
        if not flown:
            return
        how = "the same command" if again else f"the same command with out={folder}"
        self.say(f"stopped: {flown} of {total} trials are kept in {folder}; {how} flies the others")

    def flown(self, agenda: Agenda, rows: Sequence[Row]) -> None:
        """Print what has been flown; of an experiment, make and print the report; the folder last.

        Args:
            agenda: what was asked; only its trials are shown.
            rows: of `trials.parquet`.
        """
        self._summary(agenda, rows)
        if agenda.study.name:
            self._report(agenda.study.folder)
        self.say(str(agenda.study.folder))

    def _summary(self, agenda: Agenda, rows: Sequence[Row]) -> None:
        """Tables of trials, how to repeat them, and their pictures."""
        jobs, trials = {job.name: job for job in agenda.jobs}, agenda.study.folder / TRIALS
        if pooled := pooled_versions((row["code"], row["lock"]) for row in rows):
            self.say(pooled)
        rows = [row for row in rows if row["trial"] in jobs]
        few = len(rows) <= _MAX_ROWS
        # as wide as it needs: a cut-off number is worse than a wrapped line
        wide = Console(file=self._console.file, markup=False, emoji=False, width=_TABLE_WIDTH)
        wide.print((trial_table if few else cell_table)(rows, list(agenda.study.axes)))
        for row in rows if few else [row for row in rows if row["status"] != "ok"][:_MAX_FAILURES]:
            if row["reason"]:
                ending = f"ended {row['outcome']}" if row["status"] == "ok" else str(row["status"])
                self.say(f"{jobs[row['trial']].label} {ending}: {row['reason']}")
            if row["status"] == "raised" and (frames := read_record(trials / row["trial"])["traceback"]):
                self.say(f"  in {own_frame(frames)}")
            if row["status"] != "ok":
                self.say(f"record:  {trials / row['trial'] / RECORD}")
        for row in rows if few else []:
            self.say(f"repeat:  {jobs[row['trial']].payload.command}")
            if (picture := trials / row["trial"] / PICTURE).exists():
                self.say(f"picture: {picture}")
        if any((trials / row["trial"] / LOG).exists() for row in rows):
            self.say(f"show:    python -m uavexp.show {shlex.quote(str(agenda.study.folder))}")

    def _report(self, folder: Path) -> None:
        """Make the report, and print where its files are: tables and figures by their folder."""
        from uavexp.report.make import make_report

        self.say("writing the report ...")
        paths = make_report(folder, self.say)
        for place in dict.fromkeys(path if path.parent == folder else path.parent for path in paths):
            self.say(f"report:  {place}")

    def _announce(self, agenda: Agenda, doing: str) -> None:
        finished = len(agenda.jobs) - len(agenda.left)
        words = [f"{doing} {_count(len(agenda.left))}" if agenda.left else "nothing is left to fly"]
        words += [f"{_count(finished)} finished before"] if finished else []
        words += [f"{_count(agenda.again)} failed before and fly again"] if agenda.again else []
        self.say("; ".join(words))
        for name, what in agenda.stock.damaged.items():
            self.say(f"damaged, set aside: {name} ({what})")

    def _standing(self) -> str:
        left_s = (time.monotonic() - self._begin_s) / self._done * (self._total - self._done)
        return f"[{self._done}/{self._total}] {self._successes / self._done:.0%} succeeded" + (
            f", about {_duration(left_s)} left" if self._done < self._total else ""
        )


def _count(trials: int) -> str:
    return "1 trial" if trials == 1 else f"{trials} trials"


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"
