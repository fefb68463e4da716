"""A report from a study folder: tables, figures, verdicts and a page; nothing is flown.

    tables/NAME.{csv,md,tex}  figures/NAME.{png,pdf}  claims.{csv,md}  report.html  .report (their names)

The same trials give the same bytes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any

from uavexp.errors import RecordError
from uavexp.report import style, table_formats
from uavexp.report.contents import Report
from uavexp.report.figures.base import Drawing
from uavexp.report.tables.base import Table
from uavexp.store.files import opened, own_folder
from uavexp.store.records import RECORD, write_atomically, write_text
from uavexp.store.study import Study, collect, read_study, trial_folders
from uavexp.store.table import REPLANS, TABLE

PAGE, CLAIMS = "report.html", "claims"
TABLES, FIGURES = "tables", "figures"
MANIFEST = ".report"  # names of the files that a report made
_OWN = re.compile(rf"{CLAIMS}\.(csv|md)|{TABLES}/\w+\.(csv|md|tex)|{FIGURES}/\w+\.(png|pdf)")
_MOST_NAMES = 1_000_000  # bytes of a manifest
DPI = 200
# no clock, no version of a library: the same figure, the same bytes
_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
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
        ConfigError: it names a table, figure, judge or metric that does not exist.
    """
    study = read_study(folder)
    _bring_up_to_date(study, say)
    if study.measurements.empty:
        raise RecordError(f"{folder} holds no trial yet")
    say(f"{len(study.measurements)} trials: tables")
    report = Report(study=study)
    files = [*_write_tables(report, folder), *_write_figures_and_page(report, say, warn or say)]
    _remove_stale(folder, files)
    return files


def _remove_stale(folder: Path, files: Iterable[Path]) -> None:
    """Remove what an earlier report of this folder made and this one did not; nothing else."""
    made = {file.relative_to(folder).as_posix() for file in files}
    manifest = folder / MANIFEST
    before: list[str] = []
    if manifest.exists():
        with opened(manifest, _MOST_NAMES) as file:
            before = file.read().decode(errors="replace").splitlines()
    for name in before:
        if name not in made and _OWN.fullmatch(name):
            (folder / name).unlink(missing_ok=True)
    write_text(manifest, "".join(f"{name}\n" for name in sorted(made)))


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


def _write_tables(report: Report, folder: Path) -> Iterator[Path]:
    own_folder(folder, TABLES)
    for table in report.tables:
        yield from _write_table(table, folder / TABLES / table.name)
    yield _write(folder / TABLES / f"{report.values.name}.csv", table_formats.to_csv(report.values))
    if report.judgements:
        yield _write(folder / f"{CLAIMS}.csv", table_formats.to_csv(report.claims))
        yield _write(folder / f"{CLAIMS}.md", table_formats.to_markdown(report.claims))


def _write_table(table: Table, stem: Path) -> Iterator[Path]:
    for suffix, text in (
        ("csv", table_formats.to_csv(table)),
        ("md", table_formats.to_markdown(table)),
        ("tex", table_formats.to_latex(table)),
    ):
        yield _write(stem.with_name(f"{stem.name}.{suffix}"), text)


def _write(path: Path, text: str) -> Path:
    write_text(path, text)
    return path


def _write_figures_and_page(report: Report, say: Say, warn: Say) -> Iterator[Path]:
    from uavexp.report.html import write_html

    folder = report.study.folder
    own_folder(folder, FIGURES)
    drawn: list[tuple[Drawing, Path]] = []
    left_out: list[str] = []
    for drawing in report.drawings(left_out.append, say):
        png, pdf = _write_figure(drawing, folder / FIGURES)
        drawn.append((drawing, png))
        yield from (png, pdf)
    kept = list(_kept(report, folder, [drawing.name for drawing, _ in drawn]))
    left_out = [line for line in left_out if line.split(" ")[0] not in {png.stem for png in kept}]
    say("page")
    for line in left_out:
        warn(line)
    write_html(report, drawn, folder / PAGE, left_out, kept)
    for png in kept:
        yield from filter(Path.is_file, (png, png.with_suffix(".pdf")))
    yield folder / PAGE


def _kept(report: Report, folder: Path, drawn: Sequence[str]) -> Iterator[Path]:
    """Figures that cannot be drawn any more, as the logs of their flights are gone, but lie there yet."""
    for part in report.declared.figures:
        png = folder / FIGURES / f"{part.name}.png"
        if part.name not in drawn and png.is_file():
            yield png


def _write_figure(drawing: Drawing, folder: Path) -> tuple[Path, Path]:
    def write(kind: str) -> Path:
        def save(file: IO[bytes]) -> None:
            drawing.figure.savefig(file, format=kind, dpi=DPI, metadata=_METADATA[kind])

        path = folder / f"{drawing.name}.{kind}"
        write_atomically(path, save)
        return path

    with style.house_style():
        return write("png"), write("pdf")
