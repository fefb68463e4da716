"""`python -m uavexp.replay FOLDER strategy=mcr,tbr`: when each policy would have replanned on a recording."""

from __future__ import annotations

import csv
import io
import math
import os
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from uavexp.config.composition import CELL_AXIS, Composer
from uavexp.config.options import user_folder
from uavexp.config.overrides import parse_settings
from uavexp.errors import ConfigError, RecordError
from uavexp.interrupts import Parser, exit_code_of
from uavexp.judge.readers import told
from uavexp.replay.asked import Asked, asked
from uavexp.replay.recorded import Reading, Recorded
from uavexp.store.records import write_bytes

_NO_PART = ("seed", "out", "experiments", "experiment", "world", "mission", "movers")


def main(arguments: Sequence[str]) -> int:
    """Ask the policies and return the exit code: 0; 1 the disk was full; 2 bad input; 130 interrupted."""
    os.environ["MPLBACKEND"] = "Agg"
    return exit_code_of(lambda: _replay(arguments))


def _replay(arguments: Sequence[str]) -> int:
    options = _parser().parse_intermixed_args(arguments)
    if options.folder is None:
        raise ConfigError("a folder of depth images or a bag is needed; see --help")
    for text in options.overrides:
        if (key := text.partition("=")[0].split(".")[0]) in _NO_PART:
            raise ConfigError(
                f"{text}: a recording has no {key}; strategy, trigger, mapping and explorer apply"
            )
    if options.rate <= 0.0 or options.stride < 1 or not (options.unit is None or options.unit > 0.0):
        raise ConfigError("--rate and --unit must be > 0, --stride at least 1")
    folder = None if options.config_dir is None else user_folder(options.config_dir)
    command = Composer(user_folder=folder).command(parse_settings(options.overrides))
    *mount_m, pitch_deg = options.mount
    reading = Reading(
        rate_hz=options.rate,
        unit_m=options.unit,
        stride=options.stride,
        up=tuple(options.up),
        images=options.images,
        poses=options.poses,
        mount_m=(mount_m[0], mount_m[1], mount_m[2]),
        mount_pitch_rad=math.radians(pitch_deg),
    )
    recorded = _read(options.folder, reading)
    found = [asked(recorded, cell, cell.labels[CELL_AXIS]) for cell in command.cells]
    place = options.folder.resolve()
    stem = place.name if place.is_dir() else place.stem
    table, picture = (Path(options.out or ".") / f"{stem}.replay.{kind}" for kind in ("csv", "png"))
    table.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(table, _table(found).encode())
    write_bytes(picture, _picture(found, f"{stem}: {_told(recorded)}"))
    lines = [f"{stem}: {_told(recorded)}", *_lines(found), *(f"note: {note}" for note in recorded.notes)]
    sys.stdout.write("\n".join([*lines, f"table:   {table}", f"picture: {picture}"]) + "\n")
    return 0


def _read(path: Path, reading: Reading) -> Recorded:
    """Of a folder of images, or of a bag, which may be a folder, too."""
    if not path.exists():
        raise RecordError(f"{path}: there is no such folder of depth images, nor a bag")
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        from uavexp.replay import folder

        return folder.read(path, reading)
    try:
        from uavexp.replay import bag
    except ImportError as error:
        raise ConfigError(f"{path} needs rosbags ({error}): pip install rosbags") from error
    with told(path, "a ROS bag"):
        return bag.read(path, reading)


def _told(recorded: Recorded) -> str:
    return f"{len(recorded.frames)} depth images in {recorded.frames[-1].time_s:.1f} s"


def _lines(found: Sequence[Asked]) -> list[str]:
    """A line per policy: how many replans, and why."""
    width = max(len("policy"), *(len(policy.name) for policy in found))
    lines = [f"  {'policy':<{width}}  replans  causes"]
    for policy in found:
        causes = ", ".join(f"{count} {cause}" for cause, count in _causes(policy).items())
        never = (
            "" if policy.requests else "no plan was ever asked for: the recording is over before it settles"
        )
        lines.append(f"  {policy.name:<{width}}  {len(policy.replans):7d}  {causes or never}".rstrip())
    return lines


def _causes(policy: Asked) -> Counter[str]:
    return Counter(request.cause for request in policy.replans)


def _table(found: Sequence[Asked]) -> str:
    """A row per request, the first plans included."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["policy", "number", "time_s", "cause", "score", "x_m", "y_m", "z_m"])
    for policy in found:
        for number, request in enumerate(policy.requests):
            place = (round(value, 4) for value in request.position_m.tolist())
            writer.writerow(
                [
                    policy.name,
                    number,
                    round(request.time_s, 4),
                    request.cause,
                    round(request.score, 4),
                    *place,
                ]
            )
    return text.getvalue()


def _picture(found: Sequence[Asked], title: str) -> bytes:
    from uavexp.replay.picture import png_of  # matplotlib, a second

    return png_of(found, title)


def _parser() -> Parser:
    parser = Parser(
        prog="python -m uavexp.replay",
        description="When each policy would have replanned along a recorded path; nothing is flown.",
    )
    parser.add_argument(
        "folder",
        type=Path,
        nargs="?",
        metavar="FOLDER",
        help="depth images with poses.txt, TUM's form, or a ROS bag",
    )
    parser.add_argument(
        "overrides", nargs="*", metavar="KEY=VALUE", help="strategy=mcr,tbr mapping.voxel_size_m=0.05"
    )
    parser.add_argument("--rate", type=float, default=30.0, metavar="HZ", help="of numbered frames; 30")
    parser.add_argument(
        "--unit", type=float, metavar="M", help="of a depth value; 0.001, of TUM's form 0.0002"
    )
    parser.add_argument(
        "--stride", type=int, default=4, metavar="N", help="every Nth pixel along both axes; 4"
    )
    parser.add_argument(
        "--up", type=float, nargs=3, default=(0.0, 0.0, 1.0), metavar=("X", "Y", "Z"),
        help="the recording's axis that points up; 0 0 1",
    )  # fmt: skip
    parser.add_argument("--images", metavar="TOPIC", help="a bag's depth images")
    parser.add_argument(
        "--poses", metavar="TOPIC", help="a bag's poses of the vehicle; /tf:FRAME of transforms"
    )
    parser.add_argument(
        "--mount", type=float, nargs=4, default=(0.0, 0.0, 0.0, 0.0),
        metavar=("FORWARD", "LEFT", "UP", "PITCH_DEG"),
        help="of a bag's camera on its vehicle, m and degrees above its forward axis",
    )  # fmt: skip
    parser.add_argument("--config-dir", metavar="DIR", help="folder of options of your own")
    parser.add_argument("--out", metavar="DIR", help="where table and picture go; here")
    return parser


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
