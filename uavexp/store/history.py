"""A study folder's own history: `run.json`, an entry for every time a command flew into it."""

from __future__ import annotations

import platform
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import uavexp
from uavexp.paths import checkout_root
from uavexp.store.records import canonical_json, write_text
from uavexp.store.study import RUN, read_runs

FLYING = "flying, or killed"  # how a run ended, for as long as it has not said


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One time a command flies."""

    typed: Sequence[str]  # the command line
    how: Mapping[str, Any]  # it flies: backend, workers, machine
    began: datetime = field(default_factory=lambda: datetime.now(UTC))

    def note(self, folder: Path, ended: str, flown: int = 0, failed: int = 0) -> None:
        """Write this run's entry, or write it anew.

        Args:
            folder: of the study.
            ended: how, in words.
            flown: trials that were kept.
            failed: those of them that did not run to their end.

        Raises:
            RecordError: it cannot be written.
        """
        entry = {
            "command": [word for word in self.typed if not word.startswith("out=")],  # the folder may move
            "began": self.began.isoformat(),
            "ended": ended,
            "wall_s": (datetime.now(UTC) - self.began).total_seconds(),
            "flown": flown,
            "failed": failed,
            **self.how,
            "uavexp": uavexp.__version__,
            "commit": commit(),
            "python": platform.python_version(),
        }
        others = [run for run in read_runs(folder) if run.get("began") != entry["began"]]
        write_text(folder / RUN, canonical_json({"runs": [*others, entry]}) + "\n")


def commit() -> str | None:
    """Commit of the checkout, with `-dirty` behind it when files differ; None for an installed package."""
    root = checkout_root()
    if root is None or not (root / ".git").exists():
        return None
    asked = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        return subprocess.run(asked, capture_output=True, text=True, check=True, timeout=10.0).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return None
