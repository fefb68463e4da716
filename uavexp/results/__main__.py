"""`python -m uavexp.results`: every study flown anew, and compared with what was committed before."""

from __future__ import annotations

import contextlib
import math
import os
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from pyarrow import parquet as pq

from uavexp.errors import ConfigError
from uavexp.interrupts import exit_code_of, raise_from_now_on
from uavexp.paths import checkout_root, outputs_root
from uavexp.report.significance import ALPHA
from uavexp.results.changes import Change, changes, is_the_same, verdict_changes
from uavexp.results.listed import TENTH, TUNE, Listed, committed, listed
from uavexp.results.publish import publish
from uavexp.store.records import code_digest, write_text
from uavexp.store.study import STUDY
from uavexp.store.table import TABLE

USAGE = """usage: python -m uavexp.results [FAST=1] [DRY=1] [ONLY=WORD]     (make results FAST=1)

Flies every command of experiments/results.yaml into outputs/results, puts tables, figures and rows in place
of the committed ones, and the numbers into README and site, and says what is otherwise than it was.

FAST=1     a tenth of each; nothing committed is touched
DRY=1      what would be flown, and how long it takes
ONLY=WORD  the studies whose name holds the word
The same command again goes on where it was; other code begins anew, in a folder of its own.
"""
_CHANGES = "changes.md"
_NOTES = "changes"  # folder of its parts, one for each study
_GRACE_S = 2.0
_SHOWN = 12  # changes of a study at the terminal; the file has all


def main(arguments: Sequence[str] | None = None) -> int:
    """Fly what is asked and return the exit code: 0; 1 a command did not run to its end; 2 bad input."""
    os.environ["MPLBACKEND"] = "Agg"
    return exit_code_of(lambda: _run(sys.argv[1:] if arguments is None else arguments))


def _run(typed: Sequence[str]) -> int:
    if {"-h", "--help"} & set(typed):
        sys.stdout.write(USAGE)
        return 0
    asked = dict(word.partition("=")[::2] for word in typed)
    for key in asked:
        if key not in ("FAST", "DRY", "ONLY"):
            raise ConfigError(f"{key}: no such word; see python -m uavexp.results --help")
    root = checkout_root()
    if root is None:
        raise ConfigError("the committed results are in the checkout; run this there")
    is_fast = asked.get("FAST", "") not in ("", "0")
    plan = [one for one in listed(TENTH if is_fast else 1.0) if asked.get("ONLY", "") in one.study]
    _say("\n".join(_told(plan)))
    if asked.get("DRY", "") not in ("", "0"):
        return 0
    folder = outputs_root() / "results" / f"{code_digest()[:8]}{'-fast' if is_fast else ''}"
    unfinished = [one.study for one in plan if not _fly(one, folder / one.study)]
    _note_changes(plan, folder, unfinished)
    if not is_fast:
        for one in plan:
            if one.study not in unfinished:
                publish(folder / one.study, committed(one.study))
        subprocess.run([sys.executable, str(root / "docs" / "pages.py")], cwd=root, check=True)
    _say(f"what changed: {folder / _CHANGES}")
    if unfinished:
        _say(f"not flown to their end: {', '.join(unfinished)}")
    return 1 if unfinished else 0


def _told(plan: Sequence[Listed]) -> Iterator[str]:
    """What is to be flown, in lines."""
    for one in plan:
        yield f"{_clock(one.estimate_s):>9}  {one.trials:5d} trials  python -m uavexp {shlex.join(one.words)}"
    total_s, trials = sum(one.estimate_s for one in plan), sum(one.trials for one in plan)
    yield f"{_clock(total_s):>9}  {trials:5d} trials on {os.cpu_count()} cores in all"


def _clock(seconds: float) -> str:
    if math.isnan(seconds):
        return "?"
    minutes = math.ceil(seconds / 60.0)
    return f"{minutes // 60} h {minutes % 60:02d}" if minutes >= 60 else f"{minutes} min"


def _fly(one: Listed, folder: Path) -> bool:
    """Fly a command in a process of its own; whether every trial ran to its end."""
    _say(f"\n{one.study}")
    began_s = time.monotonic()
    raise_from_now_on()
    ended = _ended([sys.executable, "-m", "uavexp", *one.words, f"out={folder}"])
    if ended < 0 or ended == 130:
        raise KeyboardInterrupt
    _say(f"{one.study}: {_clock(time.monotonic() - began_s)}, said to take {_clock(one.estimate_s)}")
    return ended == 0 and _is_whole(one, folder)


def _is_whole(one: Listed, folder: Path) -> bool:
    """Whether a folder holds the trials of its line, and none of what the line was before."""
    there = pq.read_metadata(folder / TABLE).num_rows
    fewer = one.words[0] == TUNE and there < one.trials  # a setting that was tried twice is flown once
    if there != one.trials and not fewer:
        _say(f"{folder} holds {there} trials, the line flies {one.trials}; remove the folder and fly it anew")
    return there == one.trials or fewer


def _ended(command: Sequence[str]) -> int:
    """Exit code of a command, which does not outlive this one."""
    with subprocess.Popen(command, cwd=checkout_root()) as process:
        try:
            return process.wait()
        except KeyboardInterrupt:
            with contextlib.suppress(subprocess.TimeoutExpired):  # it may have heard the terminal itself
                process.wait(_GRACE_S)
            process.terminate()
            process.wait()
            raise


def _note_changes(plan: Sequence[Listed], folder: Path, unfinished: Sequence[str]) -> None:
    """Write what changed; of a study that is in place already it stays as it was told."""
    notes = folder / _NOTES
    notes.mkdir(parents=True, exist_ok=True)
    for one in plan:
        if not is_the_same(committed(one.study), folder / one.study):
            told = "\n".join(_changed(one, folder, whole=one.study not in unfinished))
            write_text(notes / f"{one.study.replace('/', '_')}.md", told)
    parts = [file.read_text(encoding="utf-8") for file in sorted(notes.iterdir())]
    write_text(folder / _CHANGES, "\n".join(parts))


def _changed(one: Listed, folder: Path, *, whole: bool) -> Iterator[str]:
    """What is otherwise than what is committed of a study."""
    yield f"## {one.study}{'' if whole else ', not flown to its end'}\n"
    if not ((folder / one.study / STUDY).is_file() and (committed(one.study) / STUDY).is_file()):
        yield "Nothing to compare.\n"
        return
    found = changes(committed(one.study), folder / one.study)
    beyond = sorted((change for change in found if change.p < ALPHA), key=lambda change: change.p)
    verdicts = verdict_changes(committed(one.study), folder / one.study)
    _say(_summary(one.study, found, beyond, verdicts))
    yield from (f"- verdict: {line}" for line in verdicts)
    yield from (f"- {change}" for change in beyond)
    yield f"\n{len(beyond)} of {len(found)} means beyond chance (Holm over the study, p < {ALPHA:g}).\n"


def _summary(study: str, found: Sequence[Change], beyond: Sequence[Change], verdicts: Sequence[str]) -> str:
    lines = [f"{study}: {len(beyond)} of {len(found)} means and {len(verdicts)} verdicts changed"]
    lines += [f"  {line}" for line in [*verdicts, *map(str, beyond)][:_SHOWN]]
    return "\n".join(lines)


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
