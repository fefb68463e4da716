"""`python -m uavexp.cloud FILE`: one line of JSON with the counts of the cloud pipeline.

With `--out VOXELS.npz` its obstacles become a building that `world=file world.path=VOXELS.npz` flies in.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from uavexp import formats
from uavexp.cloud.cloud_file import CloudError, read_cloud
from uavexp.cloud.pipeline import CloudModel, CloudPipeline
from uavexp.errors import UavexpError


def main(arguments: Sequence[str]) -> int:
    """Print the counts and return the exit code: 0, or 2 for bad input."""
    parser = argparse.ArgumentParser(prog="python -m uavexp.cloud", description=__doc__)
    parser.add_argument("file", type=Path, help=f"one of {' '.join(formats.READERS)}")
    parser.add_argument("--voxel", type=float, default=0.03, metavar="M", help="edge of a voxel, m")
    parser.add_argument("--truth", type=float, nargs=3, metavar=("X", "Y", "Z"), help="true dimensions, m")
    parser.add_argument("--seed", type=int, default=0, help="of the plane search")
    parser.add_argument("--out", type=Path, metavar="VOXELS.npz", help="obstacles, to fly among")
    options = parser.parse_args(arguments)
    if options.out is not None and options.out.suffix != ".npz":
        sys.stderr.write(f"error: --out {options.out}: name a file that ends with .npz\n")
        return 2
    try:
        pipeline = CloudPipeline(voxel_size_m=options.voxel, seed=options.seed)
        truth = tuple(options.truth) if options.truth else None
        model = pipeline.run(read_cloud(options.file), truth)
        if options.out is not None:
            _write(options.out, model)
    except (UavexpError, MemoryError) as error:
        sys.stderr.write(f"error: {' '.join(str(error).split()) or 'out of memory'}\n")
        return 2
    sys.stdout.write(json.dumps(dataclasses.asdict(model.counts)) + "\n")
    return 0


def _write(file: Path, model: CloudModel) -> None:
    """The obstacles as `uavexp.formats.npz` reads voxels.

    Raises:
        CloudError: the file cannot be written.
    """
    voxels = model.voxels
    try:
        np.savez_compressed(
            file,
            occupied_index=voxels.index[model.obstacle],
            origin=np.zeros(3),
            resolution=voxels.voxel_size_m,
        )
    except OSError as error:
        raise CloudError(f"{file} cannot be written ({error.strerror}); name another --out") from error


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
