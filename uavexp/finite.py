"""Numbers that a flight cannot hold are told as what they come from: a parameter far from any vehicle's."""

from __future__ import annotations

import contextlib
import traceback
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from uavexp.errors import ConfigError, require
from uavexp.motion.base import Motion
from uavexp.paths import PACKAGE


@contextlib.contextmanager
def finite(motion: Motion, time_s: float) -> Iterator[None]:
    """Fly on within what numbers can hold.

    Raises:
        ConfigError: they cannot, in a shipped component: a parameter is out of all proportion.
    """
    words = f"at {time_s:g} s numbers overflow ({{}}): a parameter of vehicle or controller is extreme"
    try:
        yield
    except (ArithmeticError, ValueError) as error:
        shipped = Path(traceback.extract_tb(error.__traceback__)[-1].filename).is_relative_to(PACKAGE)
        if not shipped or not (isinstance(error, ArithmeticError) or "NaN" in str(error)):
            raise
        raise ConfigError(words.format(error)) from error
    require(bool(np.isfinite(motion.state.position_m).all()), words.format("NaN"))
