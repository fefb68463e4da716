"""`python -m uavexp benchmark`: an entry flies the fixed suite and is put beside the built-in policies."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from html import escape
from pathlib import Path

from uavexp.benchmark.entry import SUITE, entry_of
from uavexp.benchmark.standings import in_common, numbers, rows_of, standings
from uavexp.cli.arguments import run_or_explain, without_config_dir
from uavexp.cli.terminal import Terminal
from uavexp.config.composition import Composer
from uavexp.config.experiment import read_experiment
from uavexp.config.options import user_folder
from uavexp.config.overrides import parse_settings
from uavexp.errors import ConfigError
from uavexp.paths import experiments_folder, outputs_root
from uavexp.report.html import page
from uavexp.report.html_parts import code, paragraph, table
from uavexp.report.results import ARM
from uavexp.report.table_formats import to_markdown
from uavexp.report.tables.base import Table
from uavexp.store.folder import folder_of
from uavexp.store.records import canonical_json, code_digest, write_text
from uavexp.store.study import STUDY
from uavexp.sweep.run import execute

USAGE = """usage: python -m uavexp benchmark trigger=mine [KEY=VALUE ...] [name=mine] [fast=1] [out=DIR]
       [--config-dir DIR]

Flies suite v1 (experiments/benchmark/v1.yaml) with the policy typed, and prints success, contacts, SPL, time,
replans and compute beside the built-in policies. Writes benchmark.html, and benchmark.json, the entry's row.

name    of the entry; by default its trigger
fast=1  a tenth of it
KEY     any parameter or option: a planner, an explorer, a safety of one's own; it holds in every scene.
        Worlds, seeds, movers, mission, vehicle, sensor and its errors are the suite's.
The same command again goes on where it was.
"""
PAGE, ROW = "benchmark.html", "benchmark.json"
_OURS = ("name", "fast", "out")
_FIXED = ("seed", "experiments", "world", "world_seed", "movers", "mission", "vehicle", "sensor", "estimator")


def main(arguments: Sequence[str] | None = None) -> int:
    """Fly an entry and return the exit code.

    0; 1 a trial did not run to its end; 2 bad input; 130 interrupted.
    """
    return run_or_explain(arguments, USAGE, _run)


def _run(typed: Sequence[str]) -> int:
    words, own_folder = without_config_dir(typed, "benchmark")
    given = dict(word.partition("=")[::2] for word in words if word.partition("=")[0] in _OURS)
    own = [word for word in words if word.partition("=")[0] not in _OURS]
    for word in own:
        if word.partition("=")[0].partition(".")[0] in _FIXED:
            raise ConfigError(f"{word}: the suite's own, the same for every entry; fly it without benchmark")
    settings = parse_settings(own)
    trigger = next((str(item.values[0]) for item in settings if item.key in ("trigger", "strategy")), "mine")
    name = given.get("name", trigger) or trigger
    fast = given.get("fast", "0") not in ("", "0", "false")
    composer = Composer(user_folder=user_folder(own_folder) if own_folder is not None else None)
    suite = read_experiment(SUITE, composer.experiments[SUITE])
    out = given.get("out") or str(outputs_root() / "benchmark" / f"{name.replace(' ', '_')}{'-fast' * fast}")
    command, left_out = entry_of(composer, suite, name, settings, fast=fast, out=out)
    terminal = Terminal()
    if left_out:
        terminal.say(f"left out, their buildings are not here: {', '.join(left_out)}")
    code_of_flights = execute(command, terminal, composer.user_folder, ("benchmark", *typed))
    if not command.runner["dry_run"]:
        _put_beside(folder_of(command), name, typed, left_out, terminal)
    return code_of_flights


def _put_beside(
    folder: Path, name: str, typed: Sequence[str], left_out: Sequence[str], terminal: Terminal
) -> None:
    """Print the standings and write the page and the row."""
    mine = rows_of(folder)
    built_in = experiments_folder() / "benchmark" / "results" / SUITE.partition("/")[2]
    rows = mine
    if (built_in / STUDY).is_file():
        others = rows_of(built_in)
        rows = in_common(mine, others)
        n = len(rows[rows[ARM] == name])
        terminal.say(f"beside the built-in policies in the {n} of {len(mine)} worlds that all have flown")
        if not set(others["code"]) <= set(mine["code"]):
            terminal.say("the built-in policies were flown with other code: make results ONLY=benchmark")
    else:
        terminal.say("the built-in policies are not flown in this checkout: make results ONLY=benchmark")
    tables = standings(rows)
    terminal.say("\n" + to_markdown(tables[0]))
    row = {
        "suite": SUITE,
        "name": name,
        "typed": [word for word in typed if not word.startswith("out=")],
        "seeds": sorted(int(seed) for seed in mine["seed"].unique()),
        "left_out": list(left_out),
        "code": code_digest()[:12],
        "parts": numbers(mine, name),
    }
    write_text(folder / ROW, canonical_json(row) + "\n")
    write_text(folder / PAGE, _page(name, typed, left_out, tables))
    terminal.say(f"page: {folder / PAGE}")
    terminal.say(f"row:  {folder / ROW}")


def _page(name: str, typed: Sequence[str], left_out: Sequence[str], tables: Sequence[Table]) -> str:
    beginning = code(f"python -m uavexp benchmark {' '.join(typed)}")
    if left_out:
        beginning += paragraph(f"Left out, their buildings were not there: {', '.join(left_out)}.")
    return page(f"{escape(name)} in suite {SUITE}", beginning, {made.title: table(made) for made in tables})


if __name__ == "__main__":
    sys.exit(main())
