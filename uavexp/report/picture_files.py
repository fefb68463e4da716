"""Pictures of stored trials: of those that have none yet, on demand."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from uavexp.log import TrialLog
from uavexp.report.picture import draw
from uavexp.store.records import LOG, PICTURE, Status, read_record, write_bytes
from uavexp.store.study import read_study, read_wall, trial_folders
from uavexp.types import World


def picture_png(world: World, log: TrialLog, record: Mapping[str, Any], command: str) -> bytes:
    """The picture of a trial, the same from its flight and from its files.

    Args:
        world: the truth.
        log: the flight.
        record: `metrics`, `seed` and `strategy`.
        command: that repeats it.
    """
    shown = {**record["metrics"], "seed": record["seed"], "strategy": record["strategy"]}
    picture = io.BytesIO()
    draw(world, log, shown, command, picture)
    return picture.getvalue()


def draw_missing(folder: Path) -> Iterator[Path]:
    """Draw every flown trial of a study folder that has no picture; yields each file when it is there.

    Raises:
        RecordError: no study, a trial or its world is damaged, or the folder cannot be written.
    """
    study = read_study(folder)
    for trial in trial_folders(folder):
        if (trial / PICTURE).exists() or not (trial / LOG).exists():
            continue
        record = read_record(trial)
        if record["status"] == Status.OK:
            world, log = study.world(record["world"]["digest"]), study.log(trial.name)
            command = str(read_wall(trial).get("command", ""))
            write_bytes(trial / PICTURE, picture_png(world, log, record, command))
            yield trial / PICTURE
