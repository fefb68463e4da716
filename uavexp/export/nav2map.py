"""The map at flight height as ROS reads it: a yaml file and the grey picture that it names (Nav2)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from uavexp.arrays import UInt8
from uavexp.export.map_voxels import MapVoxels, map_voxels
from uavexp.store.stored_trial import StoredTrial

OCCUPIED, UNKNOWN, FREE = 0, 205, 254  # grey, as map_saver paints them
BAND_M = 0.2  # what is this near to the flight height counts
_YAML = """image: {image}
mode: trinary
resolution: {size_m:.6g}
origin: [{x:.6g}, {y:.6g}, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""


def write(trial: StoredTrial, file: Path) -> Sequence[Path]:
    """Write `file` (yaml) and the picture beside it, of the median flight height."""
    voxels, image = map_voxels(trial.log), file.with_suffix(".pgm")
    height_m = float(np.median(trial.log.steps.position_m[:, 2]))
    grey = slice_grey(voxels, height_m)
    Image.fromarray(np.ascontiguousarray(grey.T[::-1])).save(image, format="PPM")  # first row: the far one
    x, y = voxels.origin_m[:2]
    file.write_text(_YAML.format(image=image.name, size_m=voxels.voxel_size_m, x=x, y=y), encoding="utf-8")
    return [file, image]


def slice_grey(voxels: MapVoxels, height_m: float) -> UInt8:
    """Grey (X, Y): occupied within `BAND_M` of a height; else free at the height itself; else unknown."""
    layers_m = voxels.origin_m[2] + (np.arange(voxels.free.shape[2]) + 0.5) * voxels.voxel_size_m
    grey = np.full(voxels.free.shape[:2], UNKNOWN, dtype=np.uint8)
    grey[voxels.free[:, :, np.abs(layers_m - height_m).argmin()]] = FREE
    near = np.abs(layers_m - height_m) <= BAND_M
    grey[voxels.occupied[:, :, near].any(axis=2)] = OCCUPIED
    return grey
