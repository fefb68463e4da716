"""Who is told how a command goes on; the command line's is `uavexp.cli.terminal`."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol

from uavexp.store.table import Row
from uavexp.sweep.agenda import Agenda
from uavexp.sweep.job import Done, Job


class Audience(Protocol):
    """Hears of a command from its first line to its end."""

    def say(self, line: str) -> None:
        """Pass on one line."""

    def listing(self, agenda: Agenda, folder: Path) -> None:
        """Tell what would be flown."""

    def progress(self, agenda: Agenda) -> AbstractContextManager[None]:
        """Follow the trials that are left while the block runs."""

    def watch(self, job: Job, time_s: float, words: str) -> None:
        """Note the progress of one flight, or at NaN s a note of its world; called from several threads."""

    def printed(self, text: str) -> None:
        """Pass on whole lines that the components of a single trial have printed; from another thread."""

    def finished(self, done: Done) -> None:
        """Note that one trial has ended."""

    def stopped(self, folder: Path, flown: int, total: int, *, again: bool) -> None:
        """Tell what an interrupted command leaves and how to go on."""

    def flown(self, agenda: Agenda, rows: Sequence[Row]) -> None:
        """Tell what a command that went to its end leaves: the rows of `trials.parquet`."""
