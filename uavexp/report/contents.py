"""The report of a study: its tables, verdicts and figures, by what its experiment declares."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from uavexp.errors import ConfigError, RecordError, one_line
from uavexp.report import style
from uavexp.report.declared import Claim, Declared, declared, results_of
from uavexp.report.figures.base import Drawing
from uavexp.report.judges import RULE, Verdict, better
from uavexp.report.results import Results
from uavexp.report.tables import values
from uavexp.report.tables.base import Table
from uavexp.store.study import Study

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """A statement of a paper and what was found."""

    statement: str
    source: str
    verdict: Verdict
    evidence: str  # the numbers it rests on, or the reason why it cannot be tested


@dataclass(frozen=True, kw_only=True)
class Report:
    """Made when asked, nothing is written.

    Raises:
        ConfigError: the study declares something unknown.
    """

    study: Study

    @cached_property
    def declared(self) -> Declared:
        """What the study's experiment asks for."""
        return declared(self.study)

    @cached_property
    def results(self) -> Results:
        """What all of it is made from."""
        return results_of(self.study, self.declared)

    @cached_property
    def tables(self) -> tuple[Table, ...]:
        """In the order declared, those with something to show."""
        made = (part.of(self.results) for part in self.declared.tables)
        return tuple(table for table in made if table is not None)

    @cached_property
    def values(self) -> Table:
        """Every mean of the tables, one number to a cell, for machines."""
        metrics = tuple(dict.fromkeys(metric for table in self.tables for metric in table.means))
        return values.table(self.results, name="values", metrics=metrics)

    @cached_property
    def judgements(self) -> tuple[Judgement, ...]:
        """Verdicts on the claims, in the order declared."""
        judged = (_judge(self.results, claim) for claim in self.declared.claims)
        return tuple(judgement for judgement in judged if judgement is not None)

    @property
    def claims(self) -> Table:
        """The verdicts as a table, the rule they follow below it."""
        return Table(
            name="claims",
            title="Claims of the paper and what was found here",
            columns=("claim", "source", "verdict", "evidence"),
            rows=tuple(
                (one.statement, one.source, str(one.verdict), one.evidence) for one in self.judgements
            ),
            notes=(RULE,) if any(claim.judge is better for claim in self.declared.claims) else (),
        )

    def drawings(self, left_out: Say = lambda line: None, say: Say = lambda line: None) -> Iterator[Drawing]:
        """Draw the figures, one after the other.

        Args:
            left_out: told which figure is left out and why: its flights or their world are not in
                the folder, or damaged.
            say: told which figure is being drawn.
        """
        for part in self.declared.figures:
            say(f"figure {part.name}")
            try:
                with style.house_style():  # not around `yield`: it would hold for whoever draws in between
                    drawing = part.of(self.results)
            except RecordError as error:
                left_out(missing(part.name, error, self.study))
                continue
            if drawing is not None:
                yield drawing


def missing(name: str, error: RecordError, study: Study) -> str:
    """The sentence that says why something is not shown, with no path outside the study."""
    return f"{name} is left out: {one_line(error).replace(f'{study.folder}/', '')}"


def _judge(results: Results, claim: Claim) -> Judgement | None:
    """The verdict on a claim; where its arms were not flown not testable, or of many the one left out."""
    part = results.only(claim.among) if claim.among else results
    there = set(claim.arms) <= set(part.arms) and all(part.panel.has(metric) for metric in claim.metrics)
    if not there and claim.is_one_of_many:
        return None
    try:
        verdict, evidence = (
            claim.judge(part, **claim.options) if there else (Verdict.NOT_TESTABLE, _lacking(part, claim))
        )
        statement = claim.says.format(**_words(results, claim))
    except (ValueError, KeyError, IndexError) as error:  # a number of arms, or a word, that it does not have
        raise ConfigError(f"claims: {claim.says!r} cannot be judged: {one_line(error)}") from error
    return Judgement(statement=statement, source=claim.source, verdict=verdict, evidence=evidence)


def _lacking(results: Results, claim: Claim) -> str:
    """What the trials do not have of a claim."""
    arms = [arm for arm in claim.arms if arm not in results.arms]
    if arms:
        return f"no trials of {' and '.join(arms)}; the study has {'; '.join(results.arms)}"
    return f"no {' or '.join(m.column for m in claim.metrics if not results.panel.has(m))} in the trials"


def _words(results: Results, claim: Claim) -> dict[str, Any]:
    """What a statement may name: its arms, the label of its metric, the number that the paper prints."""
    arms = {"first": claim.arms[0], "second": claim.arms[-1]} if claim.arms else {}
    if not claim.metrics:
        return arms
    metric = claim.metrics[0]
    printed = results.printed.get((metric.column, arms.get("first", "")))
    return {**arms, "label": metric.label, "printed": printed.mean if printed else math.nan}
