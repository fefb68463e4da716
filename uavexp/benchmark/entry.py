"""The command that flies an entry: the suite's scenes and seeds with what was typed in place of its arms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from uavexp.config.composition import CommandLine, Composer
from uavexp.config.experiment import Experiment, expand
from uavexp.config.overrides import Setting, expand_seeds
from uavexp.errors import ConfigError
from uavexp.report.comparison import SCENE

SUITE = "benchmark/v1"
ARM = "arm"
_FOLDER, _PATH = "world.folder", "world.path"


def entry_of(
    composer: Composer, suite: Experiment, name: str, typed: Sequence[Setting], *, fast: bool, out: str
) -> tuple[CommandLine, list[str]]:
    """What an entry flies.

    Args:
        composer: of its configurations.
        suite: the experiment.
        name: of the entry: its arm.
        typed: settings of the entry, which replace those of a scene, and the runner's.
        fast: whether one seed in ten is flown.
        out: folder.

    Returns:
        The command, and the scenes left out, as their buildings are not on this machine.

    Raises:
        ConfigError: a setting that cannot be.
    """
    if name in suite.axes[ARM]:
        raise ConfigError(f"name={name}: a built-in policy is called so; give another name=")
    runner = [setting for setting in typed if setting.key.split(".")[0] == "runner"]
    own = [setting for setting in typed if setting not in runner]
    for setting in own:
        if len(setting.values) > 1:
            raise ConfigError(f"{setting.key}: an entry is one policy; give it one value")
    scenes = {scene: settings for scene, settings in suite.axes[SCENE].items() if _is_here(settings)}
    mine = replace(suite, axes={SCENE: scenes, ARM: {name: tuple(own)}})
    labelled, axes = expand(mine, [])
    seeds = expand_seeds([suite.seed])
    cells = tuple(composer.cell(cell.settings, cell.labels) for cell in labelled)
    command = CommandLine(
        cells=cells,
        seeds=seeds[: max(1, len(seeds) // 10)] if fast else seeds,
        out=out,
        axes={axis: tuple(values) for axis, values in axes.items()},
        runner=composer.compose([*runner, *cells[0].settings])["runner"],
        settings=tuple(typed),
        experiment=replace(mine, settings={"primary": name}),
    )
    return command, [scene for scene in suite.axes[SCENE] if scene not in scenes]


def _is_here(settings: Sequence[Setting]) -> bool:
    """Whether the building of a scene, if it has one, is on this machine."""
    value: Mapping[str, object] = {setting.key: setting.values[0] for setting in settings}
    if _FOLDER not in value:
        return True
    return (Path(str(value[_FOLDER])) / str(value[_PATH])).is_file()


def part_of(scene: str) -> str:
    """Part of the suite that a scene belongs to: the word before its colon."""
    return scene.partition(":")[0]
