"""One trial flown: cell and seed in, world, log and metrics out. Nothing here writes a file."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uavexp.config.build import GROUPS, TARGET, build, tree_of, with_own
from uavexp.config.composition import Cell, Composer
from uavexp.config.options import user_folder
from uavexp.config.overrides import flatten, parse_settings, render
from uavexp.config.trust import VARIABLE, called_names, trusted_packages
from uavexp.errors import ConfigError
from uavexp.log import TrialLog
from uavexp.types import World
from uavexp.world.base import WorldGenerator

if TYPE_CHECKING:
    from uavexp.trial import Progress

Keep = Callable[[WorldGenerator], WorldGenerator]


_TYPED = (str, int, float, list, tuple, Mapping, type(None))  # what can be typed; the rest is a component


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One flown trial.

    Attributes:
        cell: what was flown: `cell.options` by group, `cell.config` resolved.
        seed: of the trial.
        world: the true geometry in m, with start, target and shortest path.
        log: the flight in SI units: `log.steps` a row per simulation step, `log.ticks` a row per map
            update, `log.replans` every planning request (the first plan is number 0), `log.contacts`.
        metrics: every column of a table of trials by name; units stand in the names. NaN: there is none.
        folder: of the user's own options, as given to `fly`.
        own: groups whose component was given as an object.
    """

    cell: Cell
    seed: int
    world: World
    log: TrialLog
    metrics: dict[str, Any]
    folder: Path | None = None
    own: tuple[str, ...] = ()

    def __repr__(self) -> str:
        own = "".join(f", {group} {self.cell.options[group]}" for group in self.own if group != "trigger")
        where = f"{self.cell.strategy}{own} in {self.cell.options['world']}, seed {self.seed}"
        return f"Trial({where}: {self.log.summary})"

    @property
    def config(self) -> dict[str, Any]:
        """The resolved configuration, plain data."""
        return self.cell.config

    @property
    def command(self) -> str:
        """The command line that repeats this trial; objects given for groups stand behind, as a comment."""
        own = "".join(f"  # {group}={self.config[group][TARGET]}" for group in self.own)
        return repeat_command(self.cell, self.seed, self.folder) + own


def fly(*overrides: str, config_dir: str | Path | None = None, **values: Any) -> Trial:
    """Fly one trial and return it; nothing is written to disk.

    Args:
        overrides: as on the command line, e.g. `"trigger.delta_map_m=0.1"`.
        config_dir: folder of options of one's own, as `--config-dir`; their classes count as trusted
            where the variable `UAVEXP_TRUST` names their package.
        values: the same as keywords, e.g. `strategy="mcr", seed=0`; keys with a dot go
            through `**{"world.size_m": [12, 8, 3]}`. For a group an object may stand,
            e.g. `trigger=Odometer(after_m=2.0)`, that has the methods of `uavexp/<group>/base.py`.

    Returns:
        The trial: configuration, world, log and metrics, in SI units.

    Raises:
        ConfigError: a wrong key or value, or more than one cell or seed.
        WorldError: the world cannot be made or read.
    """
    cell, seed, own = one_trial(overrides, config_dir, values)
    folder = None if config_dir is None else user_folder(str(config_dir))
    return replace(fly_cell(cell, seed, own=own), folder=folder)


def one_trial(
    overrides: Sequence[str], config_dir: str | Path | None, values: Mapping[str, Any]
) -> tuple[Cell, int, dict[str, object]]:
    """What `fly` is asked for: a cell, a seed, and components by group that were given as objects.

    Raises:
        ConfigError: as `fly`.
    """
    own = {key: value for key, value in values.items() if key in GROUPS and not isinstance(value, _TYPED)}
    typed = [
        *parse_settings(overrides),
        *(setting for key, value in values.items() if key not in own for setting in flatten(key, value)),
    ]
    folder = None if config_dir is None else user_folder(str(config_dir))
    command = Composer(user_folder=folder).command(typed)
    if len(command.cells) != 1 or len(command.seeds) != 1:
        raise ConfigError(
            f"uavexp.fly flies one trial, not {len(command.cells)} cells and {len(command.seeds)} seeds; "
            "grids are flown from the command line"
        )
    if command.out is not None:
        raise ConfigError("uavexp.fly writes nothing: out has no place here")
    return command.cells[0], command.seeds[0], own


def fly_cell(
    cell: Cell,
    seed: int,
    progress: Progress | None = None,
    keep: Keep | None = None,
    own: Mapping[str, object] | None = None,
) -> Trial:
    """Build fresh components and fly one trial.

    Args:
        cell: what to fly.
        seed: of the trial.
        progress: called about once a simulated second.
        keep: takes the world's generator and returns one that may know its world already.
        own: components by group that take the place of the cell's.

    Raises:
        UavexpError: something the user can mend (the world cannot be made, no such device).
    """
    from uavexp.config.own_metrics import own_metrics
    from uavexp.metrics.evaluate import evaluate
    from uavexp.trial import fly_trial

    parts = build(cell.config)
    parts = with_own(replace(parts, world=keep(parts.world)) if keep else parts, own or {})
    world, log = fly_trial(parts, seed, progress)
    metrics = evaluate(log, world, own_metrics(cell.metrics))
    return Trial(
        cell=_flown(cell, own or {}), seed=seed, world=world, log=log, metrics=metrics, own=tuple(own or ())
    )


def _flown(cell: Cell, own: Mapping[str, object]) -> Cell:
    """The cell with what was flown in place of what was configured."""
    trees = {group: tree_of(component) for group, component in own.items()}
    names = {group: tree[TARGET].rpartition(".")[2] for group, tree in trees.items()}
    return replace(
        cell,
        strategy=names.get("trigger", cell.strategy),
        options={**cell.options, **names},
        config={**cell.config, **trees},
    )


def check_world(cell: Cell, seed: int, keep: Keep) -> None:
    """Make a cell's world once, so that a bad one is told before anything has flown.

    Args:
        cell: whose world.
        seed: of the trial.
        keep: as for `fly_cell`.

    Raises:
        WorldError: the world cannot be made or read, its map is too large, or what flies does not fit.
    """
    from uavexp.scene import Scene
    from uavexp.trial import make_world

    parts = build(cell.config)
    world = make_world(replace(parts, world=keep(parts.world)), seed)
    parts.mapping.reset(world.bounds_m, Scene(world))


def repeat_command(cell: Cell, seed: int, user_folder: Path | None = None) -> str:
    """The command line that repeats one trial, quoted for a shell, with the packages that it trusts."""
    typed = [f"{'+' * setting.add}{setting.key}={render(setting.values[0])}" for setting in cell.settings]
    folder = ["--config-dir", str(user_folder)] if user_folder else []
    called = [*called_names(cell.config), *(f"{module}.METRICS" for module in cell.metrics)]
    trusted = [name for name in trusted_packages()[1:] if any(item.startswith(f"{name}.") for item in called)]
    trust = [f"{VARIABLE}={shlex.quote(','.join(trusted))}"] if trusted else []
    return " ".join([*trust, shlex.join(["python", "-m", "uavexp", *folder, *typed, f"seed={seed}"])])
