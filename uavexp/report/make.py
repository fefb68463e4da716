"""A report from a study folder: tables, figures, verdicts and a page; nothing is flown.

    tables/NAME.{csv,md,tex}  figures/NAME.{png,pdf}  claims.{csv,md}  report.html  .report (their names)

The same trials give the same bytes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import IO, Any

from uavexp.errors import RecordError
from uavexp.report import arms, policies, robustness, style, summary, table1, tables, tradeoff
from uavexp.report.findings import Findings
from uavexp.report.parts import Drawing, Table
from uavexp.store.records import RECORD, write_atomically, write_text
from uavexp.store.study import Study, collect, read_study, trial_folders
from uavexp.store.table import REPLANS, TABLE

PAGE, CLAIMS = "report.html", "claims"
TABLES, FIGURES = "tables", "figures"
MANIFEST = ".report"  # names of the files that a report made
_OWN = re.compile(rf"{CLAIMS}\.(csv|md)|{TABLES}/\w+\.(csv|md|tex)|{FIGURES}/\w+\.(png|pdf)")
DPI = 200
# no clock, no version of a library: the same figure, the same bytes
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}

_KINDS: dict[str, Callable[[Study], Findings]] = {
    "table1": table1.findings,
    "tradeoff": tradeoff.findings,
    "policies": policies.findings,
    "robustness": robustness.findings,
    "arms": arms.findings,
    "": summary.findings,
}

Say = Callable[[str], None]


def make_report(folder: Path, say: Say = lambda line: None, warn: Say | None = None) -> list[Path]:
    """Write tables, figures, verdicts and the page of a study; files of its report before this go.

    Args:
        folder: of the study.
        say: told what is being done.
        warn: told what is left out, and why; by default `say` is.

    Returns:
        The files written, the page last.

    Raises:
        RecordError: no study, a damaged one, or one without a trial.
    """
    study = read_study(folder)
    _bring_up_to_date(study, say)
    if study.trials.empty:
        raise RecordError(f"{folder} holds no trial yet")
    say(f"{len(study.trials)} trials: tables")
    found = findings(study)
    files = [
        *_write_tables(found, folder),
        *_write_claims(found, folder),
        *_write_figures_and_page(study, found, say, warn or say),
    ]
    _remove_stale(folder, files)
    return files


def _remove_stale(folder: Path, files: Iterable[Path]) -> None:
    """Remove what an earlier report of this folder made and this one did not; nothing else."""
    made = {file.relative_to(folder).as_posix() for file in files}
    manifest = folder / MANIFEST
    before = manifest.read_text(encoding="utf-8").splitlines() if manifest.is_file() else []
    for name in before:
        if name not in made and _OWN.fullmatch(name):
            (folder / name).unlink(missing_ok=True)
    write_text(manifest, "".join(f"{name}\n" for name in sorted(made)))


def findings(study: Study) -> Findings:
    """Tables and verdicts of a study by its kind of report, nothing written.

    Raises:
        RecordError: the kind is unknown.
    """
    if study.report not in _KINDS:
        known = " | ".join(sorted(kind for kind in _KINDS if kind))
        raise RecordError(f"report must be {known} or empty, got {study.report!r} in {study.folder}")
    return _KINDS[study.report](study)


def _bring_up_to_date(study: Study, say: Say) -> None:
    """Make the tables of trials anew when they are missing or older than a record."""
    tables_made = [study.folder / TABLE, study.folder / REPLANS]
    records = [item / RECORD for item in trial_folders(study.folder)]
    if not records:
        return
    if all(file.is_file() for file in tables_made):
        made_ns = min(file.stat().st_mtime_ns for file in tables_made)
        if all(record.stat().st_mtime_ns <= made_ns for record in records if record.is_file()):
            return
    say(f"collecting {len(records)} records")
    collect(study.folder)


def _write_tables(found: Findings, folder: Path) -> Iterator[Path]:
    _make_folder(folder / TABLES)
    for table in found.tables:
        yield from _write_table(table, folder / TABLES / table.name)
    for table in found.values:
        yield _write(folder / TABLES / f"{table.name}.csv", tables.to_csv(table))


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise RecordError(f"{folder}: cannot be made ({error.strerror})") from error


def _write_table(table: Table, stem: Path) -> Iterator[Path]:
    for suffix, text in (
        ("csv", tables.to_csv(table)),
        ("md", tables.to_markdown(table)),
        ("tex", tables.to_latex(table)),
    ):
        yield _write(stem.with_name(f"{stem.name}.{suffix}"), text)


def _write_claims(found: Findings, folder: Path) -> Iterator[Path]:
    if found.claims:
        table = tables.claims_table(found.claims, found.rule)
        yield _write(folder / f"{CLAIMS}.csv", tables.to_csv(table))
        yield _write(folder / f"{CLAIMS}.md", tables.to_markdown(table))


def _write(path: Path, text: str) -> Path:
    write_text(path, text)
    return path


def _write_figures_and_page(study: Study, found: Findings, say: Say, warn: Say) -> Iterator[Path]:
    from uavexp.report.figures import drawings_of
    from uavexp.report.html import write_html

    _make_folder(study.folder / FIGURES)
    drawn: list[tuple[Drawing, Path]] = []
    left_out: list[str] = []
    for drawing in _told(drawings_of(study, left_out.append), say):
        png, pdf = _write_figure(drawing, study.folder / FIGURES)
        drawn.append((drawing, png))
        yield from (png, pdf)
    say("page")
    for line in left_out:
        warn(line)
    write_html(study, found.tables, found.claims, drawn, study.folder / PAGE, left_out)
    yield study.folder / PAGE


def _told(drawings: Iterable[Drawing], say: Say) -> Iterator[Drawing]:
    for drawing in drawings:
        say(f"figure {drawing.name}")
        yield drawing


def _write_figure(drawing: Drawing, folder: Path) -> tuple[Path, Path]:
    def write(kind: str) -> Path:
        def save(file: IO[bytes]) -> None:
            drawing.figure.savefig(file, format=kind, dpi=DPI, metadata=_METADATA[kind])

        path = folder / f"{drawing.name}.{kind}"
        write_atomically(path, save)
        return path

    with style.house_style():
        return write("png"), write("pdf")
