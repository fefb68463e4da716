"""`report.html`: one file that holds verdicts, tables, figures and a flight, and needs no network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

from uavexp.errors import RecordError
from uavexp.report import flight3d
from uavexp.report.contents import Report, missing
from uavexp.report.figures.base import Drawing
from uavexp.report.html_failed import failed_trials
from uavexp.report.html_head import head
from uavexp.report.html_parts import figure, kept_figure, paragraph, table, verdicts
from uavexp.store.records import write_text


def write_html(
    report: Report,
    drawings: Sequence[tuple[Drawing, Path]],
    path: Path,
    left_out: Sequence[str] = (),
    kept: Sequence[Path] = (),
) -> None:
    """Write the page of a report; the same study gives the same bytes.

    Args:
        report: of a study.
        drawings: finished figures with their PNG files.
        path: of the page. Pictures of trials and pdf figures are linked relative to the study.
        left_out: sentences: which figure is left out, and why.
        kept: PNG files of figures that an earlier report drew and this one cannot.

    Raises:
        RecordError: it cannot be written.
    """
    try:
        flight = flight3d.section(report.results)
    except RecordError as error:
        flight, left_out = "", [*left_out, missing("a flight in 3D", error, report.study)]
    tables = [table(made) for made in report.tables]
    shown_figures = [figure(drawing, png) for drawing, png in drawings]
    figures = [*shown_figures, *map(kept_figure, kept), *map(paragraph, left_out)]
    sections = {
        "Verdicts": verdicts(report.judgements) if report.judgements else "",
        "Result": "\n".join(tables[:1]),
        "Figures": "\n".join(figures),
        "A flight in 3D": flight,
        "Further tables": "\n".join(tables[1:]),
        "Failed trials": failed_trials(report.results),
    }
    used = " ".join((*tables, sections["Verdicts"], *(drawing.caption for drawing, _ in drawings)))
    shown = {title: text for title, text in sections.items() if text}
    title = report.study.title or report.study.name or "Flown trials"
    write_text(path, page(title, head(report, used), shown))


def page(title: str, beginning: str, sections: Mapping[str, str]) -> str:
    """A whole page: its title, what stands first, and its sections (HTML) by their names."""
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
<link rel="icon" href="data:,">
<title>{escape(title)}</title>
<style>
{asset("page.css")}</style>
</head>
<body>
<header>
<h1>{escape(title)}</h1>
{beginning}
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


def _anchor(name: str) -> str:
    return name.lower().replace(" ", "-")
