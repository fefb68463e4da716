"""Parts of `report.html`: tables, verdicts, figures, commands."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path

from uavexp.report.contents import Judgement
from uavexp.report.figures.base import Drawing
from uavexp.report.judges import Verdict
from uavexp.report.tables.base import Table

_MARKS = {
    Verdict.REPRODUCED: "✓",
    Verdict.CONTRADICTED: "✗",
    Verdict.NOT_SHOWN: "?",
    Verdict.NOT_TESTABLE: "–",
}


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{escape(text)}</p>"


def code(command: str) -> str:
    """A command with a button that copies it."""
    return f'<p class="command"><code>{escape(command)}</code><button class="copy">copy</button></p>'


def counted(claims: Sequence[Judgement]) -> str:
    """How many claims have which verdict."""
    return ", ".join(f"{sum(one.verdict is verdict for one in claims)} {verdict}" for verdict in Verdict)


def verdicts(claims: Sequence[Judgement]) -> str:
    """Every claim with its verdict and what that rests on."""
    rows = (
        f'<tr class="{one.verdict.replace(" ", "-")}"><td>{escape(one.statement)}</td>'
        f'<td class="verdict">{_MARKS[one.verdict]} {escape(one.verdict)}</td>'
        f"<td>{escape(one.evidence)}</td><td>{escape(one.source)}</td></tr>"
        for one in claims
    )
    head = ("claim", "verdict", "evidence", "source")
    return f"<p>{counted(claims)}.</p>\n" + grid(head, rows, table_class="claims")


def table(made: Table) -> str:
    """A table of the report with its notes."""
    notes = "".join(f"<li>{escape(note)}</li>" for note in made.notes)
    return (
        f'<h3 id="table-{escape(made.name)}">{escape(made.title)}</h3>\n'
        + grid(made.columns, (row(map(escape, cells)) for cells in made.rows))
        + (f'\n<ul class="notes">{notes}</ul>' if notes else "\n")
    )


def grid(head: Iterable[str], rows: Iterable[str], *, table_class: str = "") -> str:
    """A table that scrolls in itself below its own head, and sorts by a click on a column's name."""
    columns, body = "".join(f'<th tabindex="0">{escape(column)}</th>' for column in head), "\n".join(rows)
    kind = f"sortable {table_class}".strip()
    return (
        f'<div class="wide"><table class="{kind}"><thead><tr>{columns}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody></table></div>"
    )


def row(cells: Iterable[str]) -> str:
    """A row of cells that are HTML already."""
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"


def figure(drawing: Drawing, png: Path) -> str:
    """A figure in the page, a link to its pdf below it."""
    return _figure(png, drawing.name, drawing.figure.get_figwidth(), drawing.caption)


def kept_figure(png: Path) -> str:
    """A figure of an earlier report in the page, and the sentence that says so."""
    from PIL import Image

    with Image.open(png) as image:
        width_in = image.width / float(image.info.get("dpi", (_DPI, _DPI))[0])
    return _figure(png, png.stem, width_in, _KEPT)


_KEPT = "Drawn by an earlier report: the flights it shows are not whole in this folder any more."
_DPI = 200.0  # of figures, where a file does not tell
_ZOOM = 1.25  # of a printed page's inches on a screen


def _figure(png: Path, stem: str, width_in: float, caption: str) -> str:
    name = stem.replace("_", " ").capitalize()
    data = base64.b64encode(png.read_bytes()).decode("ascii")
    pdf = png.with_suffix(".pdf")
    link = f' <a href="{escape(f"{pdf.parent.name}/{pdf.name}")}">pdf</a>' if pdf.is_file() else ""
    return (
        f'<figure id="{escape(stem)}">\n'
        f'<div class="pan"><img alt="{escape(name)}" style="--width:{_ZOOM * width_in:.2f}in" '
        f'src="data:image/png;base64,{data}"></div>\n'
        f"<figcaption><b>{escape(name)}.</b> {escape(caption)}{link}</figcaption>\n</figure>"
    )
