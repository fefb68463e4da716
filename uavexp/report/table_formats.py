"""One table as csv, Markdown and LaTeX, made of the same cells."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence

from uavexp.report.tables.base import Table

_LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"$<$",
    ">": r"$>$",
    "|": r"\textbar{}",
    '"': r"\textquotedbl{}",
    "±": r"$\pm$",
    "≥": r"$\geq$",
    "≤": r"$\leq$",
    "≈": r"$\approx$",
    "−": r"$-$",
    "×": r"$\times$",
    "·": r"$\cdot$",
    "∫": r"$\int$",
    "‖": r"$\Vert$",
    "δ": r"$\delta$",
    "σ": r"$\sigma$",
    "µ": r"$\mu$",
    "²": r"$^2$",
    "³": r"$^3$",
    "⁵": r"$^5$",
    "°": r"$^\circ$",
    "§": r"\S{}",
    "–": "--",
    "√": r"$\surd$",
    "…": r"\ldots{}",
}
_NUMBERS = re.compile(r"[+-][\d\s.,;%±()\[\]−–-]*(e[+-]?\d+)?")  # -0.3 [-0.5, -0.1]
_WIDE = 90  # characters of the longest row above which the table is scaled to the text's width


def to_csv(table: Table) -> str:
    """Comma-separated values, the column names in the first line; title and notes are left out."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([_no_formula(cell) for cell in row] for row in _all_rows(table))
    return text.getvalue()


def _no_formula(cell: str) -> str:
    """The cell, quoted with an apostrophe where a spreadsheet would calculate it."""
    is_formula = cell.startswith(("=", "+", "-", "@", "\t", "\r")) and not _NUMBERS.fullmatch(cell)
    return f"'{cell}" if is_formula else cell


def to_markdown(table: Table) -> str:
    """Heading, table and notes; columns are padded so that the raw text reads well too."""
    rows = [[cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in _all_rows(table)]
    widths = [max(3, *(len(row[column]) for row in rows)) for column in range(len(table.columns))]
    lines = [_markdown_line(row, widths) for row in rows]
    lines.insert(1, _markdown_line(["-" * width for width in widths], widths))
    notes = [f"- {note}" for note in table.notes]
    return "\n".join([f"### {table.title}", "", *lines, "", *notes, *([""] if notes else [])])


def _all_rows(table: Table) -> list[Sequence[str]]:
    return [table.columns, *table.rows]


def _markdown_line(cells: Sequence[str], widths: Sequence[int]) -> str:
    return "| " + " | ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)) + " |"


def to_latex(table: Table) -> str:
    """A `table` environment for pdfLaTeX; needs the packages booktabs and graphicx."""
    rows = [_latex_line(row) for row in _all_rows(table)]
    tabular = [
        rf"\begin{{tabular}}{{{'l' * len(table.columns)}}}",
        r"\toprule",
        rows[0],
        r"\midrule",
        *rows[1:],
        r"\bottomrule",
        r"\end{tabular}",
    ]
    if max(sum(len(cell) for cell in row) for row in _all_rows(table)) > _WIDE:
        tabular = [r"\resizebox{\linewidth}{!}{%", *tabular, "}"]
    notes = [r"\par\smallskip\footnotesize", *(escape_latex(note) for note in table.notes)]
    lines = [
        "% needs \\usepackage{booktabs,graphicx} and T1 fonts: \\usepackage[T1]{fontenc}",
        r"\begin{table}",
        r"\centering",
        rf"\caption{{{escape_latex(table.title)}}}",
        rf"\label{{tab:{table.name}}}",
        *tabular,
        *(notes if table.notes else []),
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


def _latex_line(cells: Sequence[str]) -> str:
    text = " & ".join(escape_latex(cell) for cell in cells)
    # \\ of the line before would take a leading bracket for its argument
    return ("{}" if text.startswith(("[", "*")) else "") + text + r" \\"


def escape_latex(text: str) -> str:
    """Text that LaTeX sets as it stands; signs it has no letter for become mathematics."""
    return "".join(_LATEX.get(letter, letter) for letter in text.replace("\n", " "))
