"""What an experiment's file declares of its report: `tables:`, `figures:` and `claims:`.

    tables:
      - by_metric: {name: table1, metrics: [success, replans]}     `name`: of the files written
      - paired_tests
    figures: [success, mypackage.my_figure]
    claims:
      - {says: "{first} is shorter than {second}", source: "Table 1", judge: better, metric: path_length_m,
         arms: [mine, theirs]}

A table `by_metric` is made by the function `table` of `uavexp/report/tables/by_metric.py`, a figure
`success` by `figure` of `uavexp/report/figures/success.py`; a dotted name is a module of a trusted
package (`UAVEXP_TRUST`) with such a function. A claim names one of the `judges`; claims that bear a
`sentence` together have their p values corrected over all of them. Every other key is an
argument of that function; `metrics` stand in `settings.metrics` where they are not given.
"""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from string import Formatter
from typing import Any

from uavexp.config.trust import is_trusted, trusted_packages
from uavexp.errors import ConfigError
from uavexp.metrics.metric import Metric
from uavexp.parameters import check_value, nearest, parameter_types
from uavexp.report import judges
from uavexp.report.labels import TABLE_1, metrics_of
from uavexp.report.results import Results
from uavexp.store.study import Study

TABLES, FIGURES, CLAIMS = "tables", "figures", "claims"
_TABLE_1 = [metric.column for metric in TABLE_1]
_SUMMARY = {"name": "summary", "metrics": [*_TABLE_1, "detour", "time_below_safety_s"]}
_DEFAULTS: dict[str, list[Any]] = {TABLES: [{"by_arm": _SUMMARY}], FIGURES: ["success"], CLAIMS: []}
_FILE_NAME = re.compile(r"\w{1,100}")
_WORDS = ("first", "second", "label", "printed")  # that a statement may name
_SPEC = re.compile(r"(\.\d)?[fg%]?")
_CLAIM_KEYS = ("says", "source", "judge", "among", "each", "sentence")


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A table or a figure, and what makes it."""

    name: str  # of its files
    make: Callable[..., Any]
    options: Mapping[str, Any]
    metrics: tuple[Metric, ...]  # that it reads

    def of(self, results: Results) -> Any:
        """The table or figure; None where there is nothing to show."""
        return self.make(results, name=self.name, **self.options)


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """A statement of a paper: who judges it, of which arms."""

    says: str  # with {first} and {second} for the arms, {label} of the metric and the {printed} number
    source: str  # where it stands, e.g. "Table 1", "§4.5"
    judge: Callable[..., judges.Ruling]
    options: Mapping[str, Any]
    arms: tuple[str, ...]
    among: Mapping[str, str]  # axis -> the one value looked at
    is_one_of_many: bool  # not told where its arms were not flown
    metrics: tuple[Metric, ...]
    sentence: str = ""  # of those it bears with other claims: p values are corrected over all of them


@dataclass(frozen=True, slots=True, kw_only=True)
class Declared:
    """The report that a study asks for."""

    tables: tuple[Part, ...]
    figures: tuple[Part, ...]
    claims: tuple[Claim, ...]


def declared(study: Study) -> Declared:
    """Read what a study's report is made of.

    Raises:
        ConfigError: something in it is unknown.
    """
    lists = {kind: study.report.get(kind, default) for kind, default in _DEFAULTS.items()}
    default = _metrics("settings", study.settings.get("metrics", _TABLE_1))
    return Declared(
        tables=tuple(_part(TABLES, item, default) for item in lists[TABLES]),
        figures=tuple(_part(FIGURES, item, default) for item in lists[FIGURES]),
        claims=tuple(claim for item in lists[CLAIMS] for claim in _claims(item)),
    )


def results_of(study: Study, asked: Declared) -> Results:
    """The results of a study with every metric that its report reads resampled together."""
    compared = [part for part in asked.tables if part.make.__module__.endswith(".paired_tests")]
    directions = [claim for claim in asked.claims if claim.judge is judges.better and not claim.among]
    return Results(
        study=study,
        shown=_all_metrics([*asked.tables, *asked.figures, *asked.claims]),
        compared=_all_metrics([*compared, *directions]),
        asked=tuple(dict.fromkeys((claim.arms[0], claim.arms[1]) for claim in directions)),
        sentences=tuple(
            tuple(
                (claim.metrics[0], claim.arms[0], claim.arms[1])
                for claim in directions
                if claim.sentence == sentence
            )
            for sentence in dict.fromkeys(filter(None, (claim.sentence for claim in directions)))
        ),
    )


def _all_metrics(parts: Sequence[Part | Claim]) -> tuple[Metric, ...]:
    return tuple(dict.fromkeys(metric for part in parts for metric in part.metrics))


def _part(kind: str, item: Any, default: tuple[Metric, ...]) -> Part:
    found, options = next(iter(item.items())) if isinstance(item, Mapping) and len(item) == 1 else (item, {})
    if not isinstance(found, str) or not isinstance(options, Mapping):
        raise ConfigError(f"{kind}: each is NAME or NAME: {{OPTION: VALUE}}, got {item}")
    module = _module(kind, found)
    make = getattr(module, kind[:-1], None)
    if make is None:
        raise ConfigError(f"{kind}: {found} has no function {kind[:-1]}")
    name = str(options.get("name", found.rpartition(".")[2]))
    if not _FILE_NAME.fullmatch(name):
        raise ConfigError(f"{kind}: {found}: a name may hold letters, digits and _, got {name[:60]!r}")
    given = {key: value for key, value in options.items() if key != "name"}
    if "metrics" in _parameters(make):
        given.setdefault("metrics", [metric.column for metric in default])
    given, metrics = _checked(f"{kind}: {found}", make, given, passed=("name",))
    return Part(name=name, make=make, options=given, metrics=(*metrics, *getattr(module, "METRICS", ())))


def _module(kind: str, name: str) -> Any:
    if "." in name:
        if not is_trusted(name):
            raise ConfigError(
                f"{kind}: {name} is refused: it may be a module of {', '.join(trusted_packages())}; "
                "add packages to the variable UAVEXP_TRUST"
            )
        try:
            return importlib.import_module(name)
        except ImportError as error:
            raise ConfigError(f"{kind}: {name} cannot be imported ({error})") from error
    known = available(kind)
    if name not in known:
        raise ConfigError(f"{kind}: no such one: {name}{nearest(name, known)}; there are {', '.join(known)}")
    return importlib.import_module(f"uavexp.report.{kind}.{name}")


def available(kind: str) -> tuple[str, ...]:
    """Names of the tables or figures that come with the package."""
    files = sorted((Path(__file__).parent / kind).glob("*.py"))
    return tuple(file.stem for file in files if file.stem not in ("__init__", "base"))


def _claims(item: Any) -> Iterator[Claim]:
    """The claims of one entry: one, or one for each of its lists of arms."""
    if not isinstance(item, Mapping) or not {"says", "source"} <= item.keys():
        raise ConfigError(f"claims: each needs says, source, and judge or why, got {item}")
    where = f"claims: {item['says']!r}"
    name = item.get("judge", "not_testable" if "why" in item else "better")
    if name not in judges.JUDGES:
        known = ", ".join(judges.JUDGES)
        raise ConfigError(
            f"{where}: no such judge: {name}{nearest(str(name), judges.JUDGES)}; there are {known}"
        )
    judge = judges.JUDGES[name]
    given = {key: value for key, value in item.items() if key not in _CLAIM_KEYS}
    groups = check_value(f"{where}: each", item.get("each", [given.get("arms", [])]), list[list[str]])
    check_value(f"{where}: among", item.get("among", {}), dict[str, str])
    if not groups or any(len(arms) < 2 for arms in groups if judge is judges.better):
        raise ConfigError(f"{where}: needs arms: [FIRST, SECOND]")
    options, metrics = _checked(where, judge, {**given, "arms": groups[0]} if "each" in item else given)
    _check_words(where, str(item["says"]), [*groups[0], *metrics])
    for arms in groups:
        yield Claim(
            says=str(item["says"]),
            source=str(item["source"]),
            judge=judge,
            options={**options, "arms": tuple(arms)} if arms else options,
            arms=tuple(arms),
            among=item.get("among", {}),
            is_one_of_many="each" in item,
            metrics=metrics,
            sentence=str(item.get("sentence", "")),
        )


def _check_words(where: str, says: str, about: Sequence[Any]) -> None:
    """Refuse a statement that names more than its arms, the label of its metric and the printed number."""
    try:
        fields = [(name, spec) for _, name, spec, _ in Formatter().parse(says) if name is not None]
    except ValueError as error:
        raise ConfigError(f"{where}: {error}") from error
    for name, spec in fields:
        if name not in _WORDS or not about or not _SPEC.fullmatch(spec or "") or (spec and name != "printed"):
            raise ConfigError(f"{where}: {{{name}}} is none of {', '.join(_WORDS)} (with a claim about arms)")


def _metrics(where: str, names: Any) -> tuple[Metric, ...]:
    return metrics_of(check_value(f"{where}: metrics", names, list[str]))


def _checked(
    where: str, function: Callable[..., Any], options: Mapping[str, Any], passed: tuple[str, ...] = ()
) -> tuple[dict[str, Any], tuple[Metric, ...]]:
    """Options with metrics in place of their names, and these metrics; all of them must be arguments."""
    known = {key: one for key, one in _parameters(function).items() if key not in passed}
    for key in options:
        if key not in known:
            raise ConfigError(
                f"{where}: no option {key}{nearest(str(key), known)}; it has {', '.join(known)}"
            )
    missing = [key for key, one in known.items() if one.default is one.empty and key not in options]
    if missing:
        raise ConfigError(f"{where}: needs {', '.join(missing)}")
    types = parameter_types(function)
    found: dict[str, Any] = {
        key: value if key in ("metric", "metrics") else check_value(f"{where}: {key}", value, types[key])
        for key, value in options.items()
    }
    if "metrics" in found:
        found["metrics"] = _metrics(where, found["metrics"])
    if "metric" in found:
        (found["metric"],) = _metrics(where, [found["metric"]])
    return found, (*found.get("metrics", ()), *([found["metric"]] if "metric" in found else ()))


def _parameters(function: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    """The arguments of a maker or a judge but the results."""
    return dict(list(inspect.signature(function).parameters.items())[1:])
