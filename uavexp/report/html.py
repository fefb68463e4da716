"""`report.html`: one file that holds tables, verdicts, figures and a flight, and needs no network."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import pandas as pd

from uavexp.errors import RecordError
from uavexp.report import flight3d
from uavexp.report.comparison import SCENE
from uavexp.report.contents import Judgement, Report, missing
from uavexp.report.figures.base import Drawing
from uavexp.report.judges import Verdict
from uavexp.report.results import ARM, OK, Results
from uavexp.report.tables.base import Table
from uavexp.store.records import PICTURE, write_text
from uavexp.store.study import TRIALS, Study, read_runs, read_wall
from uavexp.store.table import TABLE

MOST_FAILED = 300  # rows of the table of failed trials
_MARKS = {Verdict.REPRODUCED: "✓", Verdict.NOT_REPRODUCED: "✗", Verdict.NOT_TESTABLE: "–"}
_NOT_REPEATED = ("out=", "runner.")  # parts of a command that are no part of what was flown


def write_html(
    report: Report, drawings: Sequence[tuple[Drawing, Path]], path: Path, left_out: Sequence[str] = ()
) -> None:
    """Write the page of a report; the same study gives the same bytes.

    Args:
        report: of a study.
        drawings: finished figures with their PNG files.
        path: of the page. Pictures of trials and pdf figures are linked relative to the study.
        left_out: sentences: which figure is left out, and why.

    Raises:
        RecordError: it cannot be written.
    """
    try:
        flight = flight3d.section(report.results)
    except RecordError as error:
        flight, left_out = "", [*left_out, missing("a flight in 3D", error, report.study)]
    sections = {
        "Result": "\n".join(map(_table, report.tables[:1])),
        "Verdicts": _claims(report.judgements) if report.judgements else "",
        "Figures": "\n".join(
            [*(_figure(drawing, png) for drawing, png in drawings), *(_paragraph(line) for line in left_out)]
        ),
        "A flight in 3D": flight,
        "Further tables": "\n".join(map(_table, report.tables[1:])),
        "Failed trials": _failed(report.results),
    }
    shown = {title: text for title, text in sections.items() if text}
    write_text(path, _page(report.results, shown))


def _page(results: Results, sections: Mapping[str, str]) -> str:
    study = results.study
    title = escape(study.title or study.name or "Flown trials")
    links = " ".join(f'<a href="#{_anchor(name)}">{escape(name)}</a>' for name in sections)
    body = "\n".join(
        f'<section id="{_anchor(name)}">\n<h2>{escape(name)}</h2>\n{text}\n</section>'
        for name, text in sections.items()
    )
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
{asset("page.css")}</style>
</head>
<body>
<header>
<h1>{title}</h1>
{_what_was_flown(results)}
<nav>{links}</nav>
</header>
<main>
{body}
</main>
<script>
{asset("page.js")}</script>
</body>
</html>
"""


def asset(name: str) -> str:
    """A file of the page that stands beside this module."""
    return (Path(__file__).with_name("assets") / name).read_text(encoding="utf-8")


def _paragraph(text: str) -> str:
    return f"<p>{escape(text)}</p>"


def _anchor(name: str) -> str:
    return name.lower().replace(" ", "-")


def _what_was_flown(results: Results) -> str:
    study, notes = results.study, results.notes
    axes = "; ".join(f"{axis}: {', '.join(values)}" for axis, values in study.axes.items())
    commands = "\n".join(_code(command) for command in _commands(study))
    return f"<p>{escape(' '.join(notes))}</p>\n<p>{escape(axes)}.</p>\n{commands}"


def _commands(study: Study) -> list[str]:
    """What was typed to fly the study, but for where it went and on how many cores."""
    typed = [
        " ".join(_quoted(word) for word in run.get("command", ()) if not word.startswith(_NOT_REPEATED))
        for run in read_runs(study.folder)
    ]
    if not any(typed) and study.name:
        typed = [f"experiments={study.name}"]
    return [f"python -m uavexp {words}" for words in dict.fromkeys(typed) if words]


def _quoted(word: str) -> str:
    from shlex import quote

    return quote(word)


def _code(command: str) -> str:
    return f'<p class="command"><code>{escape(command)}</code><button class="copy">copy</button></p>'


def _claims(claims: Sequence[Judgement]) -> str:
    counts = ", ".join(
        f"{sum(claim.verdict is verdict for claim in claims)} {verdict}" for verdict in Verdict
    )
    rows = (
        f'<tr class="{claim.verdict.replace(" ", "-")}"><td>{escape(claim.statement)}</td>'
        f"<td>{escape(claim.source)}</td>"
        f'<td class="verdict">{_MARKS[claim.verdict]} {escape(claim.verdict)}</td>'
        f"<td>{escape(claim.evidence)}</td></tr>"
        for claim in claims
    )
    head = ("claim", "source", "verdict", "evidence")
    return f"<p>{counts}.</p>\n" + _grid(head, rows, table_class=' class="claims"')


def _table(table: Table) -> str:
    notes = "".join(f"<li>{escape(note)}</li>" for note in table.notes)
    return (
        f'<h3 id="table-{escape(table.name)}">{escape(table.title)}</h3>\n'
        + _grid(table.columns, (_row(map(escape, row)) for row in table.rows))
        + (f'\n<ul class="notes">{notes}</ul>' if notes else "\n")
    )


def _grid(head: Iterable[str], rows: Iterable[str], *, size: str = "wide", table_class: str = "") -> str:
    columns, body = "".join(f"<th>{escape(column)}</th>" for column in head), "\n".join(rows)
    return (
        f'<div class="{size}"><table{table_class}><thead><tr>{columns}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody></table></div>"
    )


def _row(cells: Iterable[str]) -> str:
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def _figure(drawing: Drawing, png: Path) -> str:
    name = drawing.name.replace("_", " ").capitalize()
    data = base64.b64encode(png.read_bytes()).decode("ascii")
    width_in = drawing.figure.get_figwidth()
    pdf = png.with_suffix(".pdf")
    link = f' <a href="{escape(_relative(pdf))}">pdf</a>' if pdf.is_file() else ""
    return (
        f'<figure id="{escape(drawing.name)}">\n'
        f'<img alt="{escape(name)}" style="width:{1.25 * width_in:.2f}in" '
        f'src="data:image/png;base64,{data}">\n'
        f"<figcaption><b>{escape(name)}.</b> {escape(drawing.caption)}{link}</figcaption>\n</figure>"
    )


def _relative(file: Path) -> str:
    return f"{file.parent.name}/{file.name}"


def _failed(results: Results) -> str:
    """Every trial without success: what became of it, its picture, and the command that repeats it."""
    study, flights = results.study, results.trials
    failed = flights[~flights["success"].astype(bool)]
    if failed.empty:
        return "<p>Every trial succeeded.</p>"
    rest = len(failed) - MOST_FAILED
    more = f" The first {MOST_FAILED} are shown, {rest} more are in {TABLE}." if rest > 0 else ""
    head = ("arm", "scene", "seed", "outcome", "contacts", "picture", "command that repeats it")
    rows = (_failed_row(study, row) for row in failed.head(MOST_FAILED).to_dict("records"))
    return (
        f"<p>{len(failed)} of {len(flights)} trials did not reach their target without contact.{more} "
        "Where no picture is kept, the command makes it.</p>\n" + _grid(head, rows, size="wide tall")
    )


def _failed_row(study: Study, row: Mapping[Any, Any]) -> str:
    folder = study.folder / TRIALS / str(row["trial"])
    command = row.get("wall_command") or read_wall(folder).get("command", "")
    there = (folder / PICTURE).is_file()
    link = f'<a href="{TRIALS}/{escape(str(row["trial"]))}/{PICTURE}">picture</a>' if there else "not kept"
    cells = (
        escape(str(row[ARM])),
        escape(str(row[SCENE])),
        str(row["seed"]),
        escape(" ".join(_ending(row))),
        _whole(row.get("collision_count")),
        link,
        _code(command) if command else "–",
    )
    return _row(cells)


def _ending(row: Mapping[Any, Any]) -> Iterator[str]:
    """Outcome, or for a trial that did not run to its end its status, and the reason."""
    yield str(row["outcome"] if row.get("status", OK) == OK else row["status"])
    if isinstance(row.get("reason"), str) and row["reason"]:
        yield f"({row['reason']})"


def _whole(number: Any) -> str:
    return "–" if number is None or pd.isna(number) else f"{number:.0f}"
