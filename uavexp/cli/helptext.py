"""`--help`: what can be typed, read from the yaml files so that it cannot go stale."""

from __future__ import annotations

import ast
from pathlib import Path

from uavexp.config.experiment import list_experiments, title_of
from uavexp.config.options import PRESET_GROUP, Option, list_options, read_option, text_of
from uavexp.paths import PACKAGE, conf_folder

USAGE = """\
uavexp flies seeded trials of UAV navigation in unknown indoor spaces.

python -m uavexp [GROUP=OPTION ...] [GROUP.PARAMETER=VALUE ...] [seed=SEEDS] [out=DIR] [flags]

  python -m uavexp strategy=mcr seed=0              one trial: progress, summary, picture
  python -m uavexp strategy=mcr seed=0:20           twenty trials (the stop is excluded)
  python -m uavexp -m strategy=mcr,tbr,ssp seed=0:20                 a grid
  python -m uavexp -m strategy=mcr trigger.delta_map_m=0.05,0.10,0.15 seed=0:20
  python -m uavexp experiments=mcr/table1           every trial, table and figure of one paper table
  python -m uavexp experiments=mcr/table1 seed=0:2 arm=MCR,TBR      less of it
  python -m uavexp tune strategy=tbr trigger.interval_s=0.5:5       the best settings of a parameter
  python -m uavexp world=file world.path=office.ply your own building
  python -m uavexp --help world                     the parameters of one group

seeds     seed=3   seed=1,4,7   seed=0:20   'seed=range(0,20)'   seed=range (the paper's 20)
grids     a,b,c after any = flies every combination, with or without -m
lists     world.size_m=[20,12,3] without spaces; quote what your shell or Hydra's grammar would
          take apart: 'world.path="/data/hall (2).ply"'
output    trials.parquet, replans.parquet and one folder per trial with record.json, log.npz, wall.json;
          in out=DIR or a new folder under outputs/, which is printed last
pictures  of a single flight and of failed ones; python -m uavexp.report DIR --pictures draws the others
studies   an experiment has one folder, outputs/NAME: the same command again flies what is missing
          or failed; python -m uavexp.report DIR makes tables and figures again without flying
exit code 0 all flown, 1 some trial did not run to its end or the disk was full,
          2 bad input (one line says what), 130 interrupted

flags
  -h, --help [GROUP]   this text, or one group's parameters
  -m, --multirun       accepted for Hydra's sake; grids are expanded without it too
  --cfg job|hydra|all  print the composed configuration and fly nothing
  --debug              fly in this process: breakpoint() works, what a component raises is raised;
                       python -m pdb -m uavexp ... --debug stops where it raised
  --info               print versions and folders and fly nothing
  --version            print the version
  --config-dir DIR     your own options, DIR/<group>/<option>.yaml; their classes must be in a package
                       named in the environment variable UAVEXP_TRUST
  --config-name NAME   settings from DIR/NAME.yaml (Hydra's -cn); what is typed wins
  -sc install=bash     completion of the command uavexp (or zsh, fish): eval "$(uavexp -sc install=bash)"
"""


def help_text(user_folder: Path | None = None, group: str | None = None) -> str:
    """The whole help, or the parameters of one group."""
    options = list_options([conf_folder(), *([user_folder] if user_folder else [])])
    if group is not None:
        return _group_text(group, options[group])
    config = read_option(conf_folder() / "config.yaml")
    defaults = _defaults(conf_folder() / "config.yaml")
    lines = [USAGE, "groups and options (* is the default)"]
    for name, files in _ordered(options).items():
        words = [f"{'*' if defaults.get(name) == option else ''}{option}" for option in files]
        lines.append(f"  {name:<13} {'  '.join(words)}")
    lines += ["", "keys of no group", *_parameter_lines(config, "")]
    lines += ["", "experiments", *_experiment_lines(user_folder), ""]
    lines += [_group_text(name, files) for name, files in _ordered(options).items() if name != PRESET_GROUP]
    return "\n".join(lines).rstrip() + "\n"


def _experiment_lines(user_folder: Path | None) -> list[str]:
    files = list_experiments(user_folder)
    return [f"  {name:<26} {title_of(name, file)}" for name, file in files.items()]


def group_names(user_folder: Path | None = None) -> list[str]:
    """Groups that `--help` can tell about."""
    return list(list_options([conf_folder(), *([user_folder] if user_folder else [])]))


def _ordered(options: dict[str, dict[str, Path]]) -> dict[str, dict[str, Path]]:
    """The preset first, then in the order of config.yaml, then a user's own groups."""
    names = [PRESET_GROUP, *_defaults(conf_folder() / "config.yaml"), *options]
    return {name: options[name] for name in dict.fromkeys(names) if name in options}


def groups_of(user_folder: Path | None = None) -> list[str]:
    """Groups in the order in which help tells of them, the presets first."""
    return list(_ordered(list_options([conf_folder(), *([user_folder] if user_folder else [])])))


def described(group: str, files: dict[str, Path] | None = None) -> list[tuple[str, Option, str]]:
    """Name, parameters and description of each option of a group."""
    found = []
    for name, file in (list_options([conf_folder()])[group] if files is None else files).items():
        option = read_option(file)
        found.append((name, option, option.description or _docstring(group, name)))
    return found


def _group_text(group: str, files: dict[str, Path]) -> str:
    lines: list[str] = []
    for name, option, description in described(group, files):
        lines += [f"{group}={name}" + (f"    {description}" if description else "")]
        lines += [*_parameter_lines(option, f"{group}."), ""]
    return "\n".join(lines)


def _parameter_lines(option: Option, prefix: str) -> list[str]:
    return [
        f"  {prefix + parameter.name:<34} {parameter.default:<14} {parameter.comment}".rstrip()
        for parameter in option.parameters
    ]


def _defaults(file: Path) -> dict[str, str]:
    """Default option of each group, from the text of config.yaml."""
    found: dict[str, str] = {}
    for line in text_of(file).splitlines():
        words = line.split("#")[0].strip().removeprefix("- ").split(": ")
        if line.startswith("  - ") and len(words) == 2 and not words[0].startswith("override"):
            found[words[0]] = words[1].strip()
    return found


def _docstring(group: str, option: str) -> str:
    """First line of the docstring of the option's module, which is not imported."""
    file = PACKAGE.joinpath(*group.split("."), f"{option}.py")
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) if file.is_file() else None
    return text.splitlines()[0] if text else ""
