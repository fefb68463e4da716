"""One trial flown: cell and seed in, world, log and metrics out. Nothing here writes a file."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uavexp.config.build import build
from uavexp.config.composition import Cell, Composer
from uavexp.config.overrides import flatten, parse_settings, render
from uavexp.errors import ConfigError
from uavexp.log import TrialLog
from uavexp.types import World
from uavexp.world.base import WorldGenerator

if TYPE_CHECKING:
    from uavexp.trial import Progress

Keep = Callable[[WorldGenerator], WorldGenerator]


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One flown trial: one cell, one seed."""

    cell: Cell
    seed: int
    world: World
    log: TrialLog
    metrics: dict[str, Any]

    @property
    def config(self) -> dict[str, Any]:
        """The resolved configuration, plain data."""
        return self.cell.config

    @property
    def command(self) -> str:
        """The command line that repeats this trial."""
        return repeat_command(self.cell, self.seed)


def fly(*overrides: str, **values: Any) -> Trial:
    """Fly one trial and return it; nothing is written to disk.

    Args:
        overrides: as on the command line, e.g. `"trigger.delta_map_m=0.1"`.
        values: the same as keywords, e.g. `strategy="mcr", seed=0`; keys with a dot go
            through `**{"world.size_m": [12, 8, 3]}`.

    Returns:
        The trial: configuration, world, log and metrics.

    Raises:
        ConfigError: a wrong key or value, or more than one cell or seed.
        WorldError: the world cannot be made or read.
    """
    settings = [
        *parse_settings(overrides),
        *(setting for key, value in values.items() for setting in flatten(key, value)),
    ]
    command = Composer().command(settings)
    if len(command.cells) != 1 or len(command.seeds) != 1:
        raise ConfigError(
            f"uavexp.fly flies one trial, not {len(command.cells)} cells and {len(command.seeds)} seeds; "
            "grids are flown from the command line"
        )
    if command.out is not None:
        raise ConfigError("uavexp.fly writes nothing: out has no place here")
    return fly_cell(command.cells[0], command.seeds[0])


def fly_cell(cell: Cell, seed: int, progress: Progress | None = None, keep: Keep | None = None) -> Trial:
    """Build fresh components and fly one trial.

    Args:
        cell: what to fly.
        seed: of the trial.
        progress: called about once a simulated second.
        keep: takes the world's generator and returns one that may know its world already.

    Raises:
        UavexpError: something the user can mend (the world cannot be made, no such device).
    """
    from uavexp.config.own_metrics import own_metrics
    from uavexp.metrics.evaluate import evaluate
    from uavexp.trial import fly_trial

    parts = build(cell.config)
    parts = replace(parts, world=keep(parts.world)) if keep else parts
    world, log = fly_trial(parts, seed, progress)
    metrics = evaluate(log, world, own_metrics(cell.metrics))
    return Trial(cell=cell, seed=seed, world=world, log=log, metrics=metrics)


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
    """The command line that repeats one trial, quoted for a shell."""
    typed = [f"{'+' * setting.add}{setting.key}={render(setting.values[0])}" for setting in cell.settings]
    folder = ["--config-dir", str(user_folder)] if user_folder else []
    return shlex.join(["python", "-m", "uavexp", *folder, *typed, f"seed={seed}"])
