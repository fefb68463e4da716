"""A small network of one hidden layer in numpy, kept as a file of plain numbers."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np

from uavexp.arrays import Float, Float32, check_shape
from uavexp.errors import ConfigError


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """tanh units over normalised numbers, and one number out of them."""

    mean: Float  # (F,) of the numbers ...
    scale: Float  # (F,) ... and what they are divided by
    hidden: Float  # (H, F)
    hidden_bias: Float  # (H,)
    out: Float  # (H,)
    out_bias: Float  # (1,)

    def __post_init__(self) -> None:
        units, inputs = self.hidden.shape
        shapes = {"mean": (inputs,), "scale": (inputs,), "hidden_bias": (units,), "out": (units,)}
        for name, shape in {**shapes, "out_bias": (1,)}.items():
            check_shape(name, getattr(self, name), shape)

    def value(self, numbers: Float | Float32) -> Float:
        """What it makes of numbers (..., F), as (...)."""
        normal = (np.asarray(numbers, dtype=np.float64) - self.mean) / self.scale
        hidden = np.tanh(normal @ self.hidden.T + self.hidden_bias)
        return np.asarray(hidden @ self.out + self.out_bias[0])

    def save(self, file: Path) -> None:
        """Write an npz file."""
        np.savez_compressed(file, **{item.name: getattr(self, item.name) for item in fields(self)})


def load_network(file: Path, inputs: int) -> Network:
    """Read a network of so many inputs from an npz file; nothing in it is run.

    Raises:
        ConfigError: there is none.
    """
    names = [item.name for item in fields(Network)]
    try:
        with np.load(file, allow_pickle=False) as arrays:
            parts = {name: arrays[name].astype(np.float64) for name in names}
        network = Network(**parts)
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        message = f"{file}: no network: an npz file has {', '.join(names)} of numbers ({error})"
        raise ConfigError(message) from error
    finite = all(np.isfinite(part).all() for part in parts.values()) and (network.scale > 0.0).all()
    if network.hidden.shape[1] != inputs or not finite:
        raise ConfigError(
            f"{file}: a network of {network.hidden.shape[1]} inputs, where {inputs} finite ones are needed"
        )
    return network
