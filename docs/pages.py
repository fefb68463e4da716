"""`make pages`: tables and numbers of README and site, put in from the committed results.

    <!-- table: mcr/table1/table1 -->  ...  <!-- end -->             a table as its report made it
    <!-- number: mcr/table1 replans MCR -->7.4<!-- end -->            one mean, in a sentence
    <!-- paired: mcr/table1 replans MCR - TBR -->+1.8 [0.9, 2.8], p = 0.01<!-- end -->    a paired difference

    <!-- table: mcr/table1                                            a table of one's own choice
    metrics: {success: success %, replans: replans}                   column of `values.csv`: how it is called
    arms: {MCR: on map change}                                        all, by their names, where left out
    rows: arms                                                        or metrics
    means: [replans]                                                  shown without interval
    paper: true                                                       with what the paper prints
    -->  ...  <!-- end -->

What stands between such a mark and `<!-- end -->` is written anew; `--check` only says what is stale.
"""

from __future__ import annotations

import csv
import math
import re
import sys
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from uavexp.errors import ConfigError, one_line
from uavexp.interrupts import exit_code_of
from uavexp.parameters import nearest
from uavexp.report.comparison import ArmEstimate
from uavexp.report.labels import RATE, metrics_of
from uavexp.report.number_format import NONE, mean_with_interval, number
from uavexp.report.printed import read_reference
from uavexp.report.statistics import Interval
from uavexp.report.tables.paired_tests import BOTH_SUCCEEDED

ROOT = Path(__file__).parents[1]
_END = "<!-- end -->"
_BEGIN = re.compile(r"<!-- (?:table|number|paired): ")
_MARK = re.compile(rf"(<!-- (table|number|paired): (.*?)\s*-->)(.*?)({_END})", re.S)
_KEYS = ("metrics", "arms", "rows", "means", "paper")
Values = Mapping[tuple[str, str], ArmEstimate]  # metric column, arm -> what was found


def main(arguments: list[str]) -> int:
    """Write every page anew, or with `--check` say which are stale; 1 when some are."""
    stale = {page: text for page in pages() if (text := _with_results(page)) != _read(page)}
    for page, text in stale.items():
        name = page.relative_to(ROOT)
        if "--check" in arguments:
            sys.stdout.write(f"{name} is not what the results say; type: make pages\n")
        else:
            page.write_text(text, encoding="utf-8")
            sys.stdout.write(f"{name}\n")
    return int("--check" in arguments and bool(stale))


def pages() -> list[Path]:
    """README and the written pages of the site."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def _read(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def _with_results(page: Path) -> str:
    try:
        return with_results(_read(page))
    except ConfigError as error:
        raise ConfigError(f"{page.relative_to(ROOT)}: {error}") from error


def with_results(text: str) -> str:
    """A page whose marked tables and numbers are as the committed results have them.

    Raises:
        ConfigError: a mark asks for what no committed study holds, or has no end.
    """

    def filled(mark: re.Match[str]) -> str:
        head, kind, asked, _, end = mark.groups()
        try:
            found = _FOUND[kind](asked)
        except (ConfigError, ValueError, OSError, TypeError, yaml.YAMLError) as error:
            raise ConfigError(f"{kind}: {asked.splitlines()[0]}: {one_line(error)}") from error
        return f"{head}{found}{end}"

    if len(_MARK.findall(text)) != len(_BEGIN.findall(text)):
        raise ConfigError(f"a mark has no {_END}")
    return _MARK.sub(filled, text)


def number_of(asked: str) -> str:
    """A mean: of `STUDY METRIC ARM`."""
    study, column, arm = asked.split(maxsplit=2)
    return number(_found(values_of(study), column, arm).mean, metrics_of([column])[0].digits)


def paired_of(asked: str) -> str:
    """A paired difference, its interval and corrected p: of `STUDY METRIC FIRST - SECOND`.

    Of what needs arrival it is that of the worlds in which both succeeded, as in verdicts.
    """
    study, column, arms = asked.split(maxsplit=2)
    first, _, second = arms.partition(" - ")
    metric = metrics_of([column])[0]
    label = f"{metric.label}{BOTH_SUCCEEDED}" if metric.needs_arrival else metric.label
    with (results_of(study) / "tables" / "paired_tests.csv").open(encoding="utf-8", newline="") as text:
        rows = [row for row in csv.DictReader(text) if row["metric"] == label]
    for row in rows:
        if (row["first"], row["second"]) == (first, second):
            p = row["p, Holm"].replace("<", "< ")
            difference = row["first \N{MINUS SIGN} second [95 %]"].replace("-", "\N{MINUS SIGN}")
            return f"{difference}, p {p if '<' in p else f'= {p}'}"
    pairs = ", ".join(f"{row['first']} - {row['second']}" for row in rows)
    raise ConfigError(f"no {column} of {arms}; there are {pairs or 'none'}")


def table_of(asked: str) -> str:
    """A table of a study: `STUDY/TABLE`, or STUDY and in the lines below it what is shown."""
    name, _, choice = asked.partition("\n")
    if not choice:
        study, _, table = name.rpartition("/")
        text = (results_of(study) / "tables" / f"{table}.md").read_text(encoding="utf-8")
        return "\n".join(
            re.sub(r" +|(?<=---)-+", lambda run: run[0][:1].strip("-"), line)
            for line in text.splitlines()
            if line.startswith("|")
        )
    chosen: dict[str, Any] = yaml.safe_load(choice)
    for key in chosen:
        if key not in _KEYS:
            raise ConfigError(f"no such key: {key}{nearest(key, _KEYS)}; there are {', '.join(_KEYS)}")
    return _chosen_table(name.strip(), **chosen)


def _chosen_table(
    study: str,
    metrics: Mapping[str, str],
    arms: Mapping[str, str] | None = None,
    rows: str = "metrics",
    means: tuple[str, ...] = (),
    paper: bool = False,
) -> str:
    values = values_of(study)
    shown = arms or {arm: arm for arm in dict.fromkeys(arm for _, arm in values)}
    printed = read_reference(study) if paper else {}

    def cell(column: str, arm: str) -> str:
        found, metric = _found(values, column, arm), metrics_of([column])[0]
        n = values[RATE.column, arm].n
        text = number(found.mean, metric.digits) if column in means else mean_with_interval(found, metric, n)
        there = printed.get((column, arm))
        return text + (f" (paper: {there.mean:g})" if there and text != NONE else "")

    body = [[label, *(cell(column, arm) for arm in shown)] for column, label in metrics.items()]
    table = [["", *shown.values()], ["n", *(str(values[RATE.column, arm].n) for arm in shown)], *body]
    table = table if rows == "metrics" else [list(row) for row in zip(*table, strict=True)]
    table.insert(1, ["---"] * len(table[0]))
    return "\n".join(f"| {' | '.join(text.replace('*', chr(92) + '*') for text in row)} |" for row in table)


def _found(values: Values, column: str, arm: str) -> ArmEstimate:
    if (column, arm) not in values:
        known = sorted({name for name, _ in values}), list(dict.fromkeys(name for _, name in values))
        raise ConfigError(f"no {column} of {arm}; there are {', '.join(known[0])} of {', '.join(known[1])}")
    return values[column, arm]


@cache
def values_of(study: str) -> Values:
    """Every mean of a committed study."""
    with (results_of(study) / "tables" / "values.csv").open(encoding="utf-8", newline="") as text:
        return {
            (row["metric"], row["arm"]): ArmEstimate(
                n=int(row["n"]),
                mean=_number(row["mean"]),
                sd=_number(row["sd"]),
                interval=Interval(_number(row["low"]), _number(row["high"])),
            )
            for row in csv.DictReader(text)
        }


def _number(text: str) -> float:
    return float(text) if text not in ("", NONE) else math.nan


def results_of(study: str) -> Path:
    """The committed folder of a study: `mcr/table1` is in `experiments/mcr/results/table1`."""
    paper, _, name = study.partition("/")
    return ROOT / "experiments" / paper / "results" / name


_FOUND: Mapping[str, Callable[[str], str]] = {
    "table": lambda asked: f"\n\n{table_of(asked)}\n\n",
    "number": number_of,
    "paired": paired_of,
}


if __name__ == "__main__":
    sys.exit(exit_code_of(lambda: main(sys.argv[1:])))
