"""ROS occupancy maps: a yaml file and the image that it names."""

from __future__ import annotations

import math
import reprlib
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
import yaml  # type: ignore[import-untyped]  # with omegaconf
from PIL import Image

from uavexp.arrays import Bool, Float, Int, UInt8
from uavexp.errors import WorldError
from uavexp.formats.base import FREE, SOLID, UNMEASURED, Cells, Content, Options
from uavexp.formats.guard import damaged

MOST_PIXELS = 100_000_000
MOST_YAML_BYTES = 1 << 20
IMAGES = ("PNG", "BMP", "PPM")  # what Nav2's map_saver writes; PPM is Pillow's name of pgm's family
SLAM_GREY = 205  # of 255: with it map_saver paints what it never measured

Levels = npt.NDArray[np.uint16]
Mode = Literal["trinary", "scale", "raw"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """What a map's yaml file says."""

    image: Path
    mode: Mode
    resolution_m: float
    origin_m: tuple[float, float]
    yaw_rad: float
    negate: bool
    occupied_thresh: float
    free_thresh: float


def read(path: Path, options: Options) -> Content:
    """Return the map's cells, one layer from floor to ceiling.

    The rules of Nav2's map_server. The image's first row is the map's far (high y) one. A pixel's
    occupancy is 1 - brightness, or brightness with `negate`; brightness is the mean of red, green and
    blue. trinary: solid from `occupied_thresh` on, free up to `free_thresh`, otherwise unmeasured.
    scale: the same, but between the thresholds occupancy is graded from 0 to 100 %. raw: the pixel's
    value (of 255) is the occupancy in %, beyond 100 unmeasured. A pixel that is not opaque is unmeasured
    (not in raw). Graded occupancy, of scale and raw, is solid from 65 % on, free up to 19.6 % and
    otherwise unmeasured: the thresholds with which ROS reads the trinary maps of map_saver. Missing
    thresholds are 0.65 and 0.25, map_saver's defaults.
    """
    described = describe(path)
    levels, top, opaque = _image(described.image)
    brightness = np.arange(top + 1) / top
    state_of = _state(described, brightness)
    state = state_of[levels]
    if described.mode != "raw":
        state[~opaque] = UNMEASURED
    return Content(
        kind="ROS map",
        cells=Cells(
            state=state[::-1].T[..., None],  # image rows run down, the map's y runs up
            origin=np.array([*described.origin_m, 0.0]),
            size=np.array([described.resolution_m, described.resolution_m, options.wall_height_m]),
            yaw_rad=described.yaw_rad,
            is_plan=True,
        ),
        warnings=_slam_grey(described, brightness, state_of, np.bincount(levels.ravel(), minlength=top + 1)),
    )


def files(path: Path) -> tuple[Path, ...]:
    """Return the map's image."""
    return (describe(path).image,)


def describe(path: Path) -> Description:
    """Return what the yaml file says; raise `WorldError` in one line where it lacks or mistypes a key."""
    entries = _entries(path)
    missing = [key for key in ("image", "resolution", "origin") if key not in entries]
    if missing:
        raise WorldError(f"world file {path} is no ROS map: {', '.join(missing)} missing")
    mode = entries.get("mode", "trinary")
    if mode not in get_args(Mode):
        raise WorldError(f"world file {path}: mode must be trinary, scale or raw, got {reprlib.repr(mode)}")
    resolution = _number(path, "resolution", entries["resolution"])
    if not resolution > 0.0:
        raise WorldError(f"world file {path}: resolution must be > 0 m, got {resolution:g}")
    origin = entries["origin"]
    if not isinstance(origin, list) or len(origin) != 3:
        raise WorldError(f"world file {path}: origin must be [x, y, yaw], got {reprlib.repr(origin)}")
    x, y, yaw = (_number(path, "origin", value) for value in origin)
    occupied = _number(path, "occupied_thresh", entries.get("occupied_thresh", "0.65"))
    free = _number(path, "free_thresh", entries.get("free_thresh", "0.25"))
    if not free < occupied:
        raise WorldError(f"world file {path}: free_thresh {free:g} must be < occupied_thresh {occupied:g}")
    if not isinstance(entries["image"], str) or not entries["image"]:
        raise WorldError(
            f"world file {path}: image must be a file's name, got {reprlib.repr(entries['image'])}"
        )
    return Description(
        image=path.parent / entries["image"],
        mode=mode,
        resolution_m=resolution,
        origin_m=(x, y),
        yaw_rad=yaw,
        negate=_truth(path, "negate", entries.get("negate", "0")),
        occupied_thresh=occupied,
        free_thresh=free,
    )


def _entries(path: Path) -> dict[str, Any]:
    """Words of the yaml file: every scalar as text, since PyYAML does not take `-1e-05` for a number."""
    if path.stat().st_size > MOST_YAML_BYTES:
        raise WorldError(f"world file {path} is no ROS map: it has more than {MOST_YAML_BYTES} bytes")
    try:
        entries = yaml.load(path.read_bytes(), Loader=yaml.BaseLoader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise WorldError(f"world file {path} is no yaml file") from error
    if not isinstance(entries, dict):
        raise WorldError(f"world file {path} is no ROS map: it holds no keys")
    return entries


def _number(path: Path, name: str, value: object) -> float:
    try:
        number = float(value) if isinstance(value, str) else math.nan
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise WorldError(f"world file {path}: {name} must be a number, got {reprlib.repr(value)}")
    return number


def _truth(path: Path, name: str, value: object) -> bool:
    words = {"true": True, "yes": True, "on": True, "false": False, "no": False, "off": False}
    if isinstance(value, str) and value.lower() in words:
        return words[value.lower()]
    return _number(path, name, value) != 0.0


def _image(path: Path) -> tuple[Levels, int, Bool]:
    """Level of each pixel (rows, columns), the level of white, and which pixels are opaque."""
    if not path.exists():
        raise WorldError(f"map image {path} does not exist")
    if not path.is_file():
        raise WorldError(f"map image {path} is no regular file")
    with damaged(path, "pgm, png or bmp"), warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # the check below is ours
        with Image.open(path, formats=IMAGES) as image:
            width, height = image.size
            if width * height > MOST_PIXELS:
                raise WorldError(
                    f"map image {path} has {width} x {height} pixels, at most {MOST_PIXELS:.0e} are allowed"
                )
            return _levels(image)


def _levels(image: Image.Image) -> tuple[Levels, int, Bool]:
    if image.mode.startswith("I"):  # 16 bits
        grey = np.asarray(image).astype(np.uint16)
        return grey, 65535, np.ones(grey.shape, dtype=np.bool_)
    if image.mode in ("1", "L"):
        grey = np.asarray(image.convert("L")).astype(np.uint16)
        return grey, 255, np.ones(grey.shape, dtype=np.bool_)
    channels = np.asarray(image.convert("RGBA"))
    return channels[..., :3].sum(axis=2, dtype=np.uint16), 3 * 255, channels[..., 3] == 255


def _state(described: Description, brightness: Float) -> UInt8:
    """State of pixels of each brightness, 0 to 1."""
    if described.mode == "raw":
        value = np.rint(255.0 * brightness)
        return _graded(np.where(value <= 100.0, value, np.nan))
    occupancy = brightness if described.negate else 1.0 - brightness
    low, high = described.free_thresh, described.occupied_thresh
    if described.mode == "scale":
        return _graded(np.rint(100.0 * np.clip((occupancy - low) / (high - low), 0.0, 1.0)))
    return _of(occupancy >= high, occupancy <= low)


def _graded(percent: Float) -> UInt8:
    return _of(percent >= 65.0, percent <= 19.6)


def _of(solid: Bool, free: Bool) -> UInt8:
    return np.where(solid, SOLID, np.where(free, FREE, UNMEASURED)).astype(np.uint8)


def _slam_grey(described: Description, brightness: Float, state: UInt8, pixels: Int) -> tuple[str, ...]:
    """A warning when the thresholds call the grey free that means unmeasured; `pixels` of each level."""
    grey = (np.rint(255.0 * brightness) == SLAM_GREY) & (state == FREE)
    share = pixels[grey].sum() / pixels.sum()
    if described.mode == "raw" or not share:
        return ()
    return (
        f"{100.0 * share:.3g} % of the map has the grey {SLAM_GREY}, with which map_saver paints what was "
        f"never measured, and counts as free by free_thresh={described.free_thresh:g}; "
        "free_thresh: 0.196 keeps it unmeasured",
    )
