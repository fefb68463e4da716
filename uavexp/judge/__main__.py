"""`python -m uavexp.judge FILE [--world WORLD]`: the metrics and the picture of somebody else's flight."""

from __future__ import annotations

import json
import math
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from uavexp.errors import ConfigError
from uavexp.interrupts import Parser, exit_code_of
from uavexp.judge.facts import as_json, lines_of, values_of
from uavexp.judge.flight import Judged, Pose, judged
from uavexp.judge.readers import READERS, read
from uavexp.store.records import write_bytes


def main(arguments: Sequence[str]) -> int:
    """Judge one flight and return the exit code: 0; 1 the disk was full; 2 bad input; 130 interrupted."""
    os.environ["MPLBACKEND"] = "Agg"
    return exit_code_of(lambda: _judge(arguments))


def _judge(arguments: Sequence[str]) -> int:
    options = _parser().parse_intermixed_args(arguments)
    if options.file is None:
        raise ConfigError("a file is needed; see --help")
    if options.settings and options.world is None:
        raise ConfigError(f"{options.settings[0]} says how a building is read: name it with --world")
    for setting in options.settings:
        if not setting.startswith("world."):
            raise ConfigError(f"{setting} is no world.KEY=VALUE; see --help")
    *place, yaw_deg = options.at
    recording = read(options.file, options.topic)
    pose = Pose(position_m=(place[0], place[1], place[2]), yaw_rad=math.radians(yaw_deg))
    found = judged(recording, options.world, options.settings, pose)
    values = values_of(found, has_building=options.world is not None, has_plans=recording.plans is not None)
    picture = options.out or Path(f"{options.file.stem}.judge.png")
    if picture.resolve() == options.file.resolve():
        raise ConfigError(f"--out {picture} is the file itself")
    write_bytes(picture, _picture(found, values, options.file.name, arguments))
    if options.json:
        sys.stdout.write(json.dumps(as_json(values, found.notes, recording.source), allow_nan=False) + "\n")
        return 0
    lines = [f"{options.file.name}: {recording.source}, {len(recording.position_m.time_s)} positions"]
    lines += [*lines_of(found, values), *(f"note: {note}" for note in found.notes), f"picture: {picture}"]
    sys.stdout.write("\n".join(lines) + "\n")
    return 0


def _picture(found: Judged, values: dict[str, float], name: str, typed: Sequence[str]) -> bytes:
    import io

    from uavexp.report.picture import draw  # matplotlib, a second

    picture = io.BytesIO()
    command = shlex.join(["python", "-m", "uavexp.judge", *typed])
    draw(found.world, found.log, {**values, "outcome": "recorded", "strategy": name}, command, picture)
    return picture.getvalue()


def _parser() -> Parser:
    parser = Parser(
        prog="python -m uavexp.judge",
        description="Judges a recorded flight by the metrics of every flight; nothing is flown.",
        epilog="files: " + ", ".join(READERS) + ", or the folder of a ROS 2 bag",
    )
    parser.add_argument("file", type=Path, nargs="?", metavar="FILE")
    parser.add_argument(
        "settings",
        nargs="*",
        metavar="world.KEY=VALUE",
        help="how the building is read, e.g. world.unit_m=0.001",
    )
    parser.add_argument("--world", metavar="WORLD", help="file of the building it was flown in")
    parser.add_argument(
        "--at", type=float, nargs=4, default=(0.0, 0.0, 0.0, 0.0), metavar=("X", "Y", "Z", "YAW_DEG"),
        help="where the recording's origin stands in the building, m and degrees",
    )  # fmt: skip
    parser.add_argument(
        "--topic", help="that tells positions, where a bag has several; /tf:FRAME of transforms"
    )
    parser.add_argument("--json", action="store_true", help="one line of JSON in place of text")
    parser.add_argument(
        "--out", type=Path, metavar="PICTURE.png", help="default: FILE's name with .judge.png, here"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
