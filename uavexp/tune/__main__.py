"""`python -m uavexp tune`: parameters chosen by flying, with a stated objective and budget."""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from uavexp.cli.arguments import run_or_explain, without_config_dir
from uavexp.cli.terminal import Terminal
from uavexp.config.composition import CELL_AXIS, CommandLine, Composer
from uavexp.config.experiment import Experiment
from uavexp.config.options import user_folder
from uavexp.config.overrides import parse_settings
from uavexp.errors import ConfigError
from uavexp.report.comparison import SCENE
from uavexp.store.folder import folder_of
from uavexp.tune.objective import objectives
from uavexp.tune.search import Task, search, summary, value_of
from uavexp.tune.space import Tuned, split, wholes_checked

USAGE = """usage: python -m uavexp tune KEY=LOW:HIGH[:log] [KEY=choice(a,b,c)] [KEY=VALUE ...]
       [objective=success,min_clearance_m,replans] [budget=30] [seed=100:110] [out=DIR] [--config-dir DIR]

Tries settings of the parameters given as a range or a choice, each flown in the same worlds: the present one,
six spread evenly, then what Optuna's tree-structured Parzen estimator proposes. Prints those that no other
beats in every objective.

  python -m uavexp tune strategy=tbr trigger.interval_s=0.5:5
  python -m uavexp tune strategy=mcr trigger.delta_map_m=0.05:1:log world=warehouse,rooms seed=100:120
  python -m uavexp tune experiments=mcr/table1 arm=TBR trigger.interval_s=0.5:5

objective  metrics whose means are made better, separated by commas
budget     settings tried
a,b        flown with every setting, as the scenes of an experiment are
seed       worlds flown with every setting; choose ones that no comparison uses
The same command again goes on where it was; a larger budget goes on behind a smaller one.
"""
_OBJECTIVE, _BUDGET, _SEEDS = "objective=success,min_clearance_m,replans", "budget=30", "seed=100:110"
_MOST = 10_000  # settings


def main(arguments: Sequence[str] | None = None) -> int:
    """Tune by a command line and return the exit code.

    0; 1 a trial did not run to its end, or the disk was full; 2 bad input; 130 interrupted.
    """
    return run_or_explain(arguments, USAGE, _tune)


def _tune(typed: Sequence[str]) -> int:
    words, own_folder = without_config_dir(typed, "tune")
    composer = Composer(user_folder=user_folder(own_folder) if own_folder is not None else None)
    task = task_of(words, composer, ("tune", *typed))
    folder = folder_of(task.base)
    candidates = search(task, composer, Terminal().say)

    from uavexp.report.make import make_report

    page = make_report(folder)[-1]
    sys.stdout.write("\n".join([*summary(task, candidates), f"report:  {page}", str(folder)]) + "\n")
    return int(not all(one.whole for one in candidates))


def task_of(words: Sequence[str], composer: Composer, typed: Sequence[str] = ()) -> Task:
    """What a command line asks to be tuned.

    Raises:
        ConfigError: what is wrong with it.
    """
    given = {word.partition("=")[0]: word for word in words}
    objective = given.get("objective", _OBJECTIVE).partition("=")[2]
    budget = given.get("budget", _BUDGET).partition("=")[2]
    if not re.fullmatch(r"[1-9]\d{0,4}", budget) or int(budget) > _MOST:
        raise ConfigError(f"budget={budget} must be a whole number from 1 to {_MOST}")
    tuned, others = split([word for word in words if word.partition("=")[0] not in ("objective", "budget")])
    if not tuned:
        raise ConfigError("nothing is tuned: give a parameter a range, e.g. trigger.interval_s=0.5:5")
    base = composer.command(parse_settings([*([] if "seed" in given else [_SEEDS]), *others]))
    tuned = wholes_checked(tuned, lambda key: value_of(base, key))
    metrics = objectives(objective)
    return Task(
        base=_as_study(base, tuned, [metric.column for metric in metrics]),
        tuned=tuple(tuned),
        metrics=metrics,
        budget=int(budget),
        typed=tuple(typed),
    )


def _as_study(command: CommandLine, tuned: Sequence[Tuned], metrics: Sequence[str]) -> CommandLine:
    """The command with its cells for scenes, and with a name, a folder and a report of its own."""
    kept = SCENE if command.experiment else CELL_AXIS
    for axis, entries in command.axes.items():
        if axis != kept and len(entries) > 1:
            raise ConfigError(f"one {axis} is tuned at a time; pick it: {axis}={entries[0]}")
    cells = [
        replace(cell, labels={SCENE: cell.labels[kept]} if kept in cell.labels else {})
        for cell in command.cells
    ]
    axes = {SCENE: command.axes[kept]} if kept in command.axes else {}
    keys = "-".join(item.key.rpartition(".")[2] for item in tuned)
    picked = [values[0] for axis, values in command.axes.items() if axis != kept]
    who = re.sub(r"[^\w]+", "_", "-".join(picked) if command.experiment else cells[0].strategy)
    experiment = Experiment(
        name=f"tune/{who}-{keys}",
        title=f"Tuning of {who}: {', '.join(item.key for item in tuned)}",
        report=_report(metrics),
        seed="",
        settings={"primary": ""},  # nothing is claimed of a tuning study
        fixed=(),
        axes={axis: dict.fromkeys(values, ()) for axis, values in axes.items()},
    )
    return replace(command, cells=tuple(cells), axes=axes, experiment=experiment)


def _report(metrics: Sequence[str]) -> dict[str, Any]:
    """A table of the settings tried, with who is on the front, and the trade-off."""
    shown = dict.fromkeys(["success", "collision_count", "min_clearance_m", "replans", *metrics])
    return {
        "tables": [{"by_arm": {"name": "candidates", "metrics": list(shown), "front": True}}],
        "figures": [{"trade_off": {"name": "tradeoff"}}],
    }


if __name__ == "__main__":
    sys.exit(main())
