"""Imported once by the fork server: all that a flight imports.

A child loads the kernels that its flights call, about fifty of three hundred, and flies many.
"""

from __future__ import annotations

import gc
import importlib
import pkgutil

from uavexp.config.build import GROUPS

_ALSO = ("uavexp.trial", "uavexp.metrics", "uavexp.sweep.trial_job")


def _import_everything() -> None:
    """Import every option of every role, and what surrounds them."""
    for group in GROUPS:
        package = importlib.import_module(f"uavexp.{group}")
        for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    for name in _ALSO:
        importlib.import_module(name)


_import_everything()
gc.freeze()  # or the first collection in a child copies every page it was given
