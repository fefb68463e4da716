"""`python -m uavexp.cloud FILE`: one line of JSON with the counts of the cloud pipeline."""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from uavexp import formats
from uavexp.cloud.cloud_file import read_cloud
from uavexp.cloud.pipeline import CloudPipeline
from uavexp.errors import UavexpError


def main(arguments: Sequence[str]) -> int:
    """Print the counts and return the exit code: 0, or 2 for bad input."""
    parser = argparse.ArgumentParser(prog="python -m uavexp.cloud", description=__doc__)
    parser.add_argument("file", type=Path, help=f"one of {' '.join(formats.READERS)}")
    parser.add_argument("--voxel", type=float, default=0.03, metavar="M", help="edge of a voxel, m")
    parser.add_argument("--truth", type=float, nargs=3, metavar=("X", "Y", "Z"), help="true dimensions, m")
    parser.add_argument("--seed", type=int, default=0, help="of the plane search")
    options = parser.parse_args(arguments)
    try:
        pipeline = CloudPipeline(voxel_size_m=options.voxel, seed=options.seed)
        truth = tuple(options.truth) if options.truth else None
        counts = pipeline.run(read_cloud(options.file), truth).counts
    except (UavexpError, MemoryError) as error:
        sys.stderr.write(f"error: {' '.join(str(error).split()) or 'out of memory'}\n")
        return 2
    sys.stdout.write(json.dumps(dataclasses.asdict(counts)) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
