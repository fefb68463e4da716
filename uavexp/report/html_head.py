"""The head of `report.html`: what was asked, found and flown, where and by which command."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from shlex import quote
from typing import Any

from uavexp.report import number_format
from uavexp.report.abbreviations import spelled_out
from uavexp.report.comparison import estimate
from uavexp.report.contents import Report
from uavexp.report.html_parts import code, counted, paragraph
from uavexp.report.labels import RATE
from uavexp.report.printed import citation
from uavexp.report.results import Results
from uavexp.store.study import Study, read_runs

_NOT_REPEATED = ("out=", "runner.")  # parts of a command that are no part of what was flown
_COMMIT_DIGITS = 12


def head(report: Report, shown: str) -> str:
    """The verdict in one line, then the facts of the study.

    Args:
        report: of the study.
        shown: the page's sections, whose abbreviations are spelled out.
    """
    runs = read_runs(report.study.folder)
    facts = [
        ("Paper", _linked(citation(report.study.name))),
        ("Flown", escape(" ".join(report.results.notes))),
        *(
            (axis.capitalize(), escape(", ".join(filter(None, values))))
            for axis, values in report.study.axes.items()
        ),
        ("Date", escape(_dates(runs))),
        ("Version", escape(_versions(report.results, runs))),
        ("Machine", escape("; ".join(dict.fromkeys(map(_machine, runs))))),
        ("Command", "".join(code(command) for command in _commands(report.study, runs))),
        ("Abbreviations", _abbreviations(f"{report.study.title} {report.study.axes} {shown}")),
    ]
    listed = "\n".join(f"<dt>{escape(name)}</dt><dd>{text}</dd>" for name, text in facts if text)
    return (
        f'<div class="verdict-first">{"".join(map(paragraph, _found(report)))}</div>\n<dl>\n{listed}\n</dl>'
    )


def _found(report: Report) -> Iterator[str]:
    """The verdict: on the paper's claims, and how many flights of each arm succeeded."""
    if report.judgements:
        yield f"Claims{' of the paper' * bool(citation(report.study.name))}: {counted(report.judgements)}."
    panel = report.results.panel
    rates = {arm: estimate(panel, RATE, arm) for arm in panel.arms}
    named = list(rates)
    if len(rates) > _MOST_ARMS:
        named = [end(named, key=lambda arm: rates[arm].mean) for end in (min, max)]
        yield f"{len(rates)} configurations; the one that succeeded least and the one that did most:"
    told = [f"{arm} {number_format.mean_with_interval(rates[arm], RATE, panel.n(arm))}" for arm in named]
    yield f"Success in %, with its 95 % interval: {'; '.join(told)}."


_MOST_ARMS = 6  # named in the head


def _linked(text: str) -> str:
    """Plain text whose addresses are links."""
    return re.sub(r"https://[^\s<]+", lambda found: f'<a href="{found[0]}">{found[0]}</a>', escape(text))


def _dates(runs: Sequence[Mapping[str, Any]]) -> str:
    days = sorted({str(run["began"])[:10] for run in runs if run.get("began")})
    return " to ".join(dict.fromkeys((days[0], days[-1]))) if days else ""


def _versions(results: Results, runs: Sequence[Mapping[str, Any]]) -> str:
    """Commits of the checkout that flew, and the digest of its code, which stands in every row."""
    commits = dict.fromkeys(_short(str(run["commit"])) for run in runs if run.get("commit"))
    trials = results.study.measurements
    codes = sorted(trials["code"].dropna().astype(str).unique()) if "code" in trials else []
    told = [f"commit {', '.join(commits)}"] if commits else []
    return "; ".join([*told, *([f"code {', '.join(codes)}"] if codes else [])])


def _short(commit: str) -> str:
    digits, dirty, _ = commit.partition("-")
    return digits[:_COMMIT_DIGITS] + (" with changes" if dirty else "")


def _machine(run: Mapping[str, Any]) -> str:
    workers = f"{run['n_jobs']} at once" if run.get("n_jobs") else ""
    python = f"Python {run['python']}" if run.get("python") else ""
    return ", ".join(filter(None, (str(run.get("machine", "")), python, workers)))


def _commands(study: Study, runs: Sequence[Mapping[str, Any]]) -> list[str]:
    """What was typed to fly the study, but for where it went and on how many cores."""
    typed = [
        " ".join(quote(word) for word in run.get("command", ()) if not word.startswith(_NOT_REPEATED))
        for run in runs
    ]
    if not any(typed) and study.name:
        typed = [f"experiments={study.name}"]
    return [f"python -m uavexp {words}" for words in dict.fromkeys(typed) if words]


def _abbreviations(text: str) -> str:
    """The abbreviations of the page, spelled out, folded away."""
    used = spelled_out(text)
    names = ", ".join(map(escape, used))
    lines = "".join(f"<li><b>{escape(short)}</b> {escape(long)}</li>" for short, long in used.items())
    return f"<details><summary>{names}</summary><ul>{lines}</ul></details>" if used else ""
