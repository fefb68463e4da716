"""The search: Optuna asks for a setting, it is flown in every scene and seed, its means are told.

Nothing is stored but the study folder itself. Optuna's sampler draws the same settings after the same
answers, so the same command again finds its flights there and goes on where it was, and a larger budget
goes on behind a smaller one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from scipy.stats import qmc

from uavexp.cli.terminal import Terminal
from uavexp.config.composition import Cell, CommandLine, Composer
from uavexp.errors import ConfigError
from uavexp.metrics.metric import Metric
from uavexp.store.table import Row
from uavexp.sweep.agenda import Agenda
from uavexp.sweep.run import execute
from uavexp.tune.objective import front, means, told
from uavexp.tune.space import Tuned, label_of, settings_of

CANDIDATE = "candidate"  # axis of the settings tried
_SPREAD = 6  # settings by a sequence of low discrepancy, before Optuna proposes any: few at random leave gaps
_SEED = 0  # of Optuna's sampler: another would be another search


@dataclass(frozen=True, kw_only=True)
class Task:
    """What is to be tuned, on what, and for what."""

    base: CommandLine  # what is flown but for the tuned parameters: a cell per scene
    tuned: tuple[Tuned, ...]
    metrics: tuple[Metric, ...]  # the objectives
    budget: int  # settings tried
    typed: tuple[str, ...]  # the command line


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A setting that was flown."""

    label: str
    means: tuple[float, ...] | None  # of the objectives; None: not one flight has them
    whole: bool  # whether every flight ran to its end


class _Listener(Terminal):
    """Says what a command says, and keeps the rows of its trials instead of showing them."""

    rows: Sequence[Row] = ()

    def flown(self, agenda: Agenda, rows: Sequence[Row]) -> None:
        """Keep all rows of the folder."""
        self.rows = rows


def search(task: Task, composer: Composer, say: Callable[[str], None]) -> list[Candidate]:
    """Try as many settings as the budget allows, and say what each came to.

    Args:
        task: what is tuned.
        composer: of the configurations flown.
        say: told of each setting.

    Returns:
        The settings, in the order tried.

    Raises:
        UavexpError: Optuna is missing, or a setting cannot be flown.
    """
    study, flown = _study(task), dict[str, Candidate]()
    cells: list[Cell] = []
    while len(study.get_trials(states=_ended())) < task.budget:
        trial = study.ask()
        values = {item.key: item.suggest(trial) for item in task.tuned}
        label = label_of(values)
        if label not in flown:
            new = list(_cells(task.base, composer, label, values))
            cells += new
            listener = _Listener()
            failed = execute(_command(task, cells, new), listener, composer.user_folder, task.typed)
            rows = [row for row in listener.rows if row[CANDIDATE] == label]
            flown[label] = Candidate(label=label, means=means(task.metrics, rows), whole=not failed)
        found = flown[label].means
        study.tell(trial, found, state=None if found else _ended()[1])
        what = told(task.metrics, found) if found else "no flight ran to its end"
        say(f"setting {trial.number + 1} of {task.budget}: {label}: {what}")
    return list(flown.values())


def _study(task: Task) -> Any:
    """Optuna's study: first the values that the command has without tuning, then some spread evenly."""
    try:
        import optuna
    except ImportError as error:
        raise ConfigError("tuning needs Optuna; type: pip install 'optuna>=4'") from error
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(
        directions=["maximize" if metric.better > 0 else "minimize" for metric in task.metrics],
        sampler=optuna.samplers.TPESampler(seed=_SEED, n_startup_trials=_SPREAD),
    )
    now = {item.key: value_of(task.base, item.key) for item in task.tuned}
    if all(item.holds(now[item.key]) for item in task.tuned):
        study.enqueue_trial({item.key: item.as_drawn(now[item.key]) for item in task.tuned})
    for shares in qmc.Halton(len(task.tuned), scramble=False).random(_SPREAD).tolist():
        study.enqueue_trial(
            {item.key: item.at(share) for item, share in zip(task.tuned, shares, strict=True)}
        )
    return study


def _ended() -> tuple[Any, Any]:
    from optuna.trial import TrialState

    return TrialState.COMPLETE, TrialState.FAIL


def value_of(command: CommandLine, key: str) -> Any:
    """What a command's first cell has for a key: a parameter's value or a group's option.

    Raises:
        ConfigError: there is no such parameter.
    """
    cell = command.cells[0]
    node: Any = cell.options.get(key, cell.config)
    for name in key.split(".") if key not in cell.options else ():
        if not isinstance(node, dict) or name not in node:
            return None  # composing it will tell what there is
        node = node[name]
    return node


def _cells(base: CommandLine, composer: Composer, label: str, values: dict[str, Any]) -> Iterator[Cell]:
    """A setting in every scene."""
    mine = {setting.key: setting for setting in settings_of(values)}
    for cell in base.cells:
        settings = {**{setting.key: setting for setting in cell.settings}, **mine}
        yield composer.cell(list(settings.values()), {**cell.labels, CANDIDATE: label})


def _command(task: Task, cells: Sequence[Cell], new: Sequence[Cell]) -> CommandLine:
    """The command that flies every setting tried so far, of which the newest is left to fly."""
    tried = tuple(dict.fromkeys(cell.labels[CANDIDATE] for cell in cells))
    return replace(task.base, cells=tuple(cells), axes={**task.base.axes, CANDIDATE: tried})


def summary(task: Task, candidates: Iterable[Candidate]) -> list[str]:
    """The front of the settings tried, in lines."""
    done = [(one.label, one.means) for one in candidates if one.means is not None]
    names = ", ".join(metric.column for metric in task.metrics)
    best = [done[index] for index in front(task.metrics, [found for _, found in done])]
    return [
        f"of {len(done)} settings these are beaten by none in {names}:",
        *(f"  {label}: {told(task.metrics, found)}" for label, found in best),
    ]
