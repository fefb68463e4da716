"""Overrides in, checked cells out: the only module that composes with Hydra.

Hydra composes the chosen options once per combination of options; the values are applied
here, so that a grid over a parameter costs nothing and each mistake is told in the user's
own words. The resolved tree is plain data from here on and is checked (`trust`,
`uavexp.build.check_config`) before anything is built.
"""

from __future__ import annotations

import copy
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from uavexp.build import GROUPS, TOP_LEVEL, check_config
from uavexp.cli.experiment import Experiment, LabelledCell, expand, list_experiments, read_experiment
from uavexp.cli.interpolation import one_line, resolved
from uavexp.cli.options import EXPERIMENT_GROUP, PRESET_GROUP, RUNNER_GROUP, list_options, read_option
from uavexp.cli.overrides import Setting, expand_grid, expand_seeds, quoted, render
from uavexp.errors import ConfigError
from uavexp.parameters import nearest
from uavexp.paths import conf_folder
from uavexp.trust import check_trust

TRIGGER_GROUP = "trigger"  # what presets choose
DEFAULT_PRESET = "mcr"  # config.yaml's
CELL_AXIS = "cell"
_FEW_CELLS = 8  # up to so many are composed one by one: 0.15 s each
_OF_ONE_COMPOSITION = ("runtime", "overrides", "job")  # parts of `hydra` that only tell what was typed
CONFIG_NAME = "config"


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """One composed configuration; with a seed it is a trial."""

    strategy: str  # the preset's name, else the trigger's
    options: dict[str, str]  # group -> option
    config: dict[str, Any]  # plain, resolved, checked: groups and the keys of no group
    settings: tuple[Setting, ...]  # what was typed for it, or stands in the experiment's file
    labels: dict[str, str]  # axis -> its value for this cell


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """What one command line asks for."""

    cells: tuple[Cell, ...]
    seeds: tuple[int, ...]
    out: str | None
    axes: dict[str, tuple[str, ...]]  # values in order; the one axis `cell` without an experiment
    runner: dict[str, Any]  # how trials are run; no part of what is flown
    experiment: Experiment | None = None


@dataclass(slots=True, kw_only=True)
class Composer:
    """Composes cells from the shipped configuration and, optionally, a user's folder."""

    user_folder: Path | None = None
    options: dict[str, dict[str, Path]] = field(init=False)
    experiments: dict[str, Path] = field(init=False)
    _cache: dict[tuple[tuple[str, str], ...], dict[str, Any]] = field(init=False, repr=False)
    _many: bool = field(init=False, repr=False, default=False)

    def __post_init__(self) -> None:
        folders = [conf_folder(), *([self.user_folder] if self.user_folder else [])]
        self.options = list_options(folders)
        self.experiments = list_experiments(self.user_folder)
        self._cache = {}

    def command(self, settings: Sequence[Setting]) -> Command:
        """Expand, compose and check everything a command line asks for.

        Raises:
            ConfigError: the first thing that is wrong.
        """
        typed = {setting.key: setting for setting in settings}
        ours = {key: typed.pop(key) for key in ("seed", "out", EXPERIMENT_GROUP) if key in typed}
        runner = {key: typed.pop(key) for key in list(typed) if key.split(".")[0] == RUNNER_GROUP}
        experiment = self._experiment(ours.get(EXPERIMENT_GROUP))
        labelled, axes = self._grid(experiment, list(typed.values()))
        self._many = len(labelled) > _FEW_CELLS
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
        return Command(
            cells=cells,
            seeds=seeds,
            out=out[0],
            axes=axes,
            runner=defaults[RUNNER_GROUP],
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
            if axis in (*GROUPS, *TOP_LEVEL, PRESET_GROUP, RUNNER_GROUP, "seed", "out"):
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
        tree = self.compose(settings)
        options = {group: tree["hydra"]["runtime"]["choices"][group] for group in GROUPS}
        config = check_config({key: tree[key] for key in (*GROUPS, *TOP_LEVEL)}, options)
        strategy = tree["hydra"]["runtime"]["choices"].get(PRESET_GROUP)
        return Cell(
            strategy=strategy or options[TRIGGER_GROUP],
            options=options,
            config=config,
            settings=tuple(settings),
            labels=dict(labels or {}),
        )

    def compose(self, settings: Sequence[Setting]) -> dict[str, Any]:
        """Compose one cell into a plain, resolved, trusted tree, `hydra` included."""
        chosen, values = self._split(settings)
        tree = copy.deepcopy(self._compose_options(tuple(sorted(chosen.items()))))
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
        return chosen, values

    def _option(self, group: str, name: Any) -> str:
        known = self.options.get(group, {})
        if isinstance(name, str) and name in known:
            return name
        raise ConfigError(
            f"{group}={name}: no such option{nearest(str(name), known)}; {group} may be {', '.join(known)}"
        )

    def _compose_options(self, chosen: tuple[tuple[str, str], ...]) -> dict[str, Any]:
        """Hydra's tree of these options, unresolved; once for each combination."""
        if chosen not in self._cache:
            joined = self._join(dict(chosen)) if self._many and len(chosen) > 1 else None
            self._cache[chosen] = joined or self._hydra_compose(dict(chosen))
        return self._cache[chosen]

    def _join(self, chosen: Mapping[str, str]) -> dict[str, Any] | None:
        """The tree of several options from trees of one each: a grid needs their sum, not their product.

        None where an option touches more than its own group, or the preset touches that group.
        """
        preset = {group: option for group, option in chosen.items() if group in (PRESET_GROUP, TRIGGER_GROUP)}
        if preset == chosen:
            return None
        plain = self._compose_options(())
        tree = copy.deepcopy(self._compose_options(tuple(sorted(preset.items()))))
        for group, option in chosen.items():
            if group in preset:
                continue
            alone = self._compose_options(((group, option),))
            if _without(alone, group) != _without(plain, group) or tree[group] != plain[group]:
                return None
            tree[group] = copy.deepcopy(alone[group])
            tree["hydra"]["runtime"]["choices"][group] = option
        return tree

    def _hydra_compose(self, chosen: Mapping[str, str]) -> dict[str, Any]:
        arguments = [f"{group}={name}" for group, name in chosen.items()]
        if TRIGGER_GROUP in chosen and PRESET_GROUP not in chosen:
            arguments.append(f"~{PRESET_GROUP}")  # the default preset's name would be wrong
        tree = self._hydra_tree(arguments)
        if TRIGGER_GROUP in chosen and PRESET_GROUP in chosen:
            preset = self._hydra_tree([f"{PRESET_GROUP}={chosen[PRESET_GROUP]}"])
            wanted = preset["hydra"]["runtime"]["choices"][TRIGGER_GROUP]
            if wanted != chosen[TRIGGER_GROUP]:
                raise ConfigError(
                    f"{PRESET_GROUP}={chosen[PRESET_GROUP]} means {TRIGGER_GROUP}={wanted}, "
                    f"{TRIGGER_GROUP}={chosen[TRIGGER_GROUP]} contradicts it: give one of the two"
                )
        return tree

    def _hydra_tree(self, arguments: list[str]) -> dict[str, Any]:
        import yaml  # type: ignore[import-untyped]
        from hydra import compose, initialize_config_dir
        from hydra.core.global_hydra import GlobalHydra
        from hydra.errors import HydraException
        from omegaconf import OmegaConf
        from omegaconf.errors import OmegaConfBaseException

        bad_input = (HydraException, OmegaConfBaseException, yaml.YAMLError, OSError, ValueError, KeyError)

        if self.user_folder is not None:
            arguments = [*arguments, f"hydra.searchpath=[{_file_url(self.user_folder)}]"]
        GlobalHydra.instance().clear()
        try:
            with (
                warnings.catch_warnings(),
                initialize_config_dir(config_dir=str(conf_folder()), version_base="1.3", job_name="uavexp"),
            ):
                warnings.simplefilter("ignore")
                composed = compose(CONFIG_NAME, overrides=arguments, return_hydra_config=True)
            tree: Any = OmegaConf.to_container(composed, resolve=False)
        except bad_input as error:
            raise ConfigError(f"the configuration does not compose: {one_line(error)}") from error
        return dict(tree)

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


def _without(tree: Mapping[str, Any], group: str) -> dict[str, Any]:
    """A composed tree without one group, and without what `hydra` tells of the composition itself."""
    hydra = {key: value for key, value in tree["hydra"].items() if key not in _OF_ONE_COMPOSITION}
    return {**{key: value for key, value in tree.items() if key != group}, "hydra": hydra}


def _refuse_equal_cells(cells: Sequence[Cell]) -> None:
    for index, cell in enumerate(cells):
        for other in cells[:index]:
            if cell.strategy == other.strategy and cell.config == other.config:
                typed = " ".join(f"{setting.key}={setting.values[0]}" for setting in cell.settings)
                raise ConfigError(f"the same configuration twice in one command: {typed}")


def _file_url(folder: Path) -> str:
    return quoted(f"file://{folder}")
