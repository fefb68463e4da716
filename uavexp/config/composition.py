"""Overrides in, checked cells out.

Hydra composes the chosen options (`trees`); the values are applied here, so that a grid over
a parameter costs nothing and each mistake is told in the user's own words. The resolved tree
is plain data from here on and is checked (`trust`, `uavexp.config.build.check_config`) before
anything is built.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uavexp.config.build import GROUPS, check_config, top_level
from uavexp.config.experiment import Experiment, LabelledCell, expand, list_experiments, read_experiment
from uavexp.config.interpolation import resolved
from uavexp.config.options import (
    EXPERIMENT_GROUP,
    PRESET_GROUP,
    RUNNER_GROUP,
    list_options,
    place_in,
    read_option,
)
from uavexp.config.overrides import Setting, expand_grid, expand_seeds, render
from uavexp.config.own_metrics import modules_of
from uavexp.config.trees import CONFIG_NAME, TRIGGER_GROUP, Trees
from uavexp.config.trust import check_places, check_trust
from uavexp.errors import ConfigError
from uavexp.parameters import nearest
from uavexp.paths import conf_folder

DEFAULT_PRESET = "mcr"  # config.yaml's
CELL_AXIS = "cell"
_FEW_CELLS = 8  # up to so many are composed one by one: 0.15 s each


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One composed configuration; with a seed it is a trial."""

    strategy: str  # the preset's name, else the trigger's
    options: dict[str, str]  # group -> option
    config: dict[str, Any]  # plain, resolved, checked: groups and the keys of no group
    settings: tuple[Setting, ...]  # what was typed for it, or stands in the experiment's file
    labels: dict[str, str]  # axis -> its value for this cell
    metrics: tuple[str, ...] = ()  # modules of one's own metrics: no part of what is flown


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandLine:
    """What one command line asks for."""

    cells: tuple[Cell, ...]
    seeds: tuple[int, ...]
    out: str | None
    axes: dict[str, tuple[str, ...]]  # values in order; the one axis `cell` without an experiment
    runner: dict[str, Any]  # how trials are run; no part of what is flown
    settings: tuple[Setting, ...]  # all that was typed
    experiment: Experiment | None = None


@dataclass(slots=True, kw_only=True)
class Composer:
    """Composes cells from the shipped configuration and, optionally, a user's folder."""

    user_folder: Path | None = None
    many: bool = False  # commands are to come: trees of single options are kept and joined
    options: dict[str, dict[str, Path]] = field(init=False)
    experiments: dict[str, Path] = field(init=False)
    _keys: tuple[str, ...] = field(init=False, repr=False)  # of a composed tree
    _groups: tuple[str, ...] = field(init=False, repr=False)  # that there are; a user's file may be elsewhere
    _trees: Trees = field(init=False, repr=False)

    def __post_init__(self) -> None:
        folders = [conf_folder(), *([self.user_folder] if self.user_folder else [])]
        self.options = list_options(folders)
        self._groups = tuple(list_options(folders[:1]))
        self.experiments = list_experiments(self.user_folder)
        shared = read_option(conf_folder() / f"{CONFIG_NAME}.yaml").parameters
        self._keys = (*GROUPS, *(item.name for item in shared), RUNNER_GROUP, "hydra")
        self._trees = Trees(user_folder=self.user_folder)

    def command(self, settings: Sequence[Setting]) -> CommandLine:
        """Expand, compose and check everything a command line asks for.

        Raises:
            ConfigError: the first thing that is wrong.
        """
        typed = {setting.key: setting for setting in settings}
        ours = {key: typed.pop(key) for key in ("seed", "out", EXPERIMENT_GROUP) if key in typed}
        runner = {key: typed.pop(key) for key in list(typed) if key.split(".")[0] == RUNNER_GROUP}
        experiment = self._experiment(ours.get(EXPERIMENT_GROUP))
        labelled, axes = self._grid(experiment, list(typed.values()))
        self._trees.many = self.many or len(labelled) > _FEW_CELLS
        defaults = self.compose([*_single(runner.values()), *labelled[0].settings])
        seed = (
            ours["seed"].values if "seed" in ours else (experiment.seed if experiment else defaults["seed"],)
        )
        seeds = expand_seeds(seed)
        cells = tuple(self.cell(item.settings, item.labels) for item in labelled)
        _refuse_equal_cells(cells)
        out = ours["out"].values if "out" in ours else (defaults["out"],)
        if len(out) != 1 or not isinstance(out[0], str | None) or out[0] == "":
            raise ConfigError(f"out must be one folder, got {', '.join(map(repr, out))}")
        return CommandLine(
            cells=cells,
            seeds=seeds,
            out=out[0],
            axes=axes,
            runner=defaults[RUNNER_GROUP],
            settings=tuple(settings),
            experiment=experiment,
        )

    def _experiment(self, setting: Setting | None) -> Experiment | None:
        if setting is None or setting.values == (None,):
            return None
        name = setting.values[0]
        if len(setting.values) > 1 or not isinstance(name, str):
            raise ConfigError(
                f"{EXPERIMENT_GROUP} must be one name, got {', '.join(map(str, setting.values))}"
            )
        if name not in self.experiments:
            raise ConfigError(
                f"no such experiment: {name}{nearest(name, self.experiments)}, "
                f"available: {', '.join(self.experiments) or 'none'}"
            )
        experiment = read_experiment(name, self.experiments[name])
        for axis in experiment.axes:
            if axis in (*GROUPS, *top_level(), PRESET_GROUP, RUNNER_GROUP, "metrics", "seed", "out"):
                raise ConfigError(f"experiments={name}: an axis may not be called like the key {axis}")
        return experiment

    def _grid(
        self, experiment: Experiment | None, typed: Sequence[Setting]
    ) -> tuple[list[LabelledCell], dict[str, tuple[str, ...]]]:
        """Cells with their labels, and the axes."""
        if experiment is not None:
            cells, axes = expand(experiment, typed)
        else:
            swept = [setting.key for setting in typed if len(setting.values) > 1]
            cells = [
                LabelledCell(labels={CELL_AXIS: self._cell_name(settings, swept)}, settings=settings)
                for settings in expand_grid(typed)
            ]
            axes = {CELL_AXIS: [cell.labels[CELL_AXIS] for cell in cells]}
        return cells, {axis: tuple(values) for axis, values in axes.items()}

    def _cell_name(self, settings: Sequence[Setting], swept: Sequence[str]) -> str:
        """What tells a cell of an ordinary command from the others: preset or trigger, then what varies."""
        value = {setting.key: setting.values[0] for setting in settings}
        chosen = value.get(PRESET_GROUP, value.get(TRIGGER_GROUP, DEFAULT_PRESET))
        varied = [f"{key}={render(value[key])}" for key in swept if key not in (PRESET_GROUP, TRIGGER_GROUP)]
        return " ".join([str(chosen), *varied])

    def cell(self, settings: Sequence[Setting], labels: Mapping[str, str] | None = None) -> Cell:
        """Compose and check one cell; each setting has one value."""
        try:
            return self._cell(settings, labels)
        except ConfigError as error:
            files = (self.options.get(item.key, {}).get(str(item.values[0])) for item in settings)
            own = [file for file in files if file and self.user_folder in file.parents]
            place = place_in(own, str(error), [item.key for item in settings])
            raise ConfigError(f"{error}{place}") from error

    def _cell(self, settings: Sequence[Setting], labels: Mapping[str, str] | None) -> Cell:
        tree = self.compose(settings)
        choices = tree["hydra"]["runtime"]["choices"]
        self._refuse_stray_keys(tree, choices)
        options = {group: choices[group] for group in GROUPS}
        config = check_config({key: tree[key] for key in (*GROUPS, *top_level())}, options)
        return Cell(
            strategy=choices.get(PRESET_GROUP) or options[TRIGGER_GROUP],
            options=options,
            config=config,
            settings=tuple(settings),
            labels=dict(labels or {}),
            metrics=modules_of(tree["metrics"]),
        )

    def _refuse_stray_keys(self, tree: Mapping[str, Any], choices: Mapping[str, str]) -> None:
        """Refuse what an option or a preset sets where no flight reads it."""
        for key in tree:
            if key in choices and key not in self._keys:
                raise ConfigError(
                    f"{key}={choices[key]} sets nothing: its file must begin with # @package _global_"
                )
            if key not in self._keys:
                known = (PRESET_GROUP, *self._keys)
                raise ConfigError(f"unknown key '{key}' in an option{nearest(key, known)}")

    def compose(self, settings: Sequence[Setting]) -> dict[str, Any]:
        """Compose one cell into a plain, resolved, trusted tree, `hydra` included."""
        chosen, values = self._split(settings)
        tree = copy.deepcopy(self._trees.of(chosen))
        check_places(tree)
        for setting in values:
            self._apply(tree, setting)
        tree = resolved(tree)
        check_trust(tree)
        return tree

    def _split(self, settings: Sequence[Setting]) -> tuple[dict[str, str], list[Setting]]:
        """Options chosen by group, and the settings that change values."""
        chosen: dict[str, str] = {}
        values: list[Setting] = []
        for setting in settings:
            if setting.key in self.options:
                chosen[setting.key] = self._option(setting.key, setting.values[0])
            else:
                values.append(setting)
        self._check_held(chosen)
        return chosen, values

    def _check_held(self, chosen: Mapping[str, str]) -> None:
        """Refuse an option for what the chosen one does not hold (planner.find)."""
        whole = {group: option for group, option in chosen.items() if "." not in group}
        for group in chosen.keys() - whole.keys():
            holder, _, held = group.rpartition(".")
            tree = self._trees.of(whole)
            if held not in tree[holder]:
                option = tree["hydra"]["runtime"]["choices"][holder]
                raise ConfigError(f"{group}={chosen[group]}: {holder}={option} holds no {held}")

    def _option(self, group: str, name: Any) -> str:
        known = self.options.get(group, {})
        if group not in self._groups:
            told = f"{self.user_folder}/{group.replace('.', '/')} is the folder of no group"
            raise ConfigError(f"{group}={name}: {told}{nearest(group, self._groups)}")
        if isinstance(name, str) and name in known:
            return name
        name = name if isinstance(name, str) else render(name)
        elsewhere = [other for other, options in self.options.items() if name in options]
        hint = f" ({name} is in {elsewhere[0]})" if elsewhere else nearest(name, known)
        raise ConfigError(f"{group}={name}: no such option{hint}; {group} may be {', '.join(known)}")

    def _apply(self, tree: dict[str, Any], setting: Setting) -> None:
        """Set one value in place; the key must exist unless it is added."""
        *parents, last = setting.key.split(".")
        node: Any = tree
        path: list[str] = []
        for name in parents:
            self._require_key(tree, node, path, name, setting)
            node = node.setdefault(name, {}) if isinstance(node, dict) else None
            path.append(name)
        self._require_key(tree, node, path, last, setting)
        node[last] = setting.values[0]

    def _require_key(
        self, tree: dict[str, Any], node: Any, path: list[str], name: str, setting: Setting
    ) -> None:
        if not isinstance(node, dict):
            raise ConfigError(f"{setting.key}: {'.'.join(path)} has no parts")
        if name in node or (setting.add and path):
            return
        known = [key for key in node if key not in ("_target_", "hydra")]
        if not path:
            known = [PRESET_GROUP, *known]
            raise ConfigError(f"unknown key '{name}'{nearest(name, known)}; known: {', '.join(known)}")
        owner = ".".join(path)
        hint = nearest(name, known)
        if len(path) == 1 and owner in GROUPS:
            elsewhere = self._options_with(owner, name)
            hint = f" (only {', '.join(elsewhere)} has)" if elsewhere else hint
            owner = f"option {tree['hydra']['runtime']['choices'][owner]} of {owner}"
        raise ConfigError(
            f"{setting.key}: {owner} has no parameter '{name}'{hint}; it has {', '.join(known) or 'none'}"
        )

    def _options_with(self, group: str, parameter: str) -> list[str]:
        """Options of a group that have a parameter of this name."""
        return [
            option
            for option, file in self.options[group].items()
            if parameter in (item.name for item in read_option(file).parameters)
        ]


def _single(settings: Iterable[Setting]) -> list[Setting]:
    """The settings, each with one value."""
    found = list(settings)
    for setting in found:
        if len(setting.values) != 1:
            raise ConfigError(f"{setting.key} must have one value, it is no part of a grid")
    return found


def _refuse_equal_cells(cells: Sequence[Cell]) -> None:
    for index, cell in enumerate(cells):
        for other in cells[:index]:
            if cell.strategy == other.strategy and cell.config == other.config:
                typed = " ".join(f"{setting.key}={setting.values[0]}" for setting in cell.settings)
                raise ConfigError(f"the same configuration twice in one command: {typed}")
