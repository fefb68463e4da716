"""Code of one's own that a configuration names: imported, its mistakes told, found in a traceback."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from types import ModuleType

from uavexp.config.trust import trusted_packages
from uavexp.errors import ConfigError, one_line
from uavexp.frames import portable_file, portable_trace


def imported(module: str, asked: str) -> ModuleType:
    """Import a module that somebody asked for.

    Args:
        module: its dotted name.
        asked: what named it, for messages (`trigger._target_=mine.odometer.Odometer`).

    Raises:
        ConfigError: it cannot be imported; says what to do.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise ConfigError(f"{asked}: {_missing(module, str(error.name))}") from error
    except SyntaxError as error:
        place = f"{portable_file(str(error.filename))}:{error.lineno}"
        raise ConfigError(f"{asked}: mend {place}: {error.msg}: {(error.text or '').strip()}") from error
    except Exception as error:
        raise ConfigError(f"{asked}: importing {module} raises {raised(error)}") from error


def raised(error: BaseException) -> str:
    """An error's type and message, and where in one's own code."""
    return f"{type(error).__name__}: {one_line(error)}; mend {own_frame(portable_trace(error))}"


def own_frame(frames: Sequence[str]) -> str:
    """The last of some frames that lies in a user's package, else the last one."""
    own = [f"{package.replace('.', '/')}{end}" for package in trusted_packages()[1:] for end in ("/", ".py:")]
    return next((frame for frame in reversed(frames) if frame.startswith(tuple(own))), frames[-1])


def _missing(module: str, lacks: str) -> str:
    """What to do about a module that is not there: the one asked for, or one that it imports."""
    if module != lacks and not module.startswith(f"{lacks}."):
        return f"{module} imports {lacks}, which is not installed; install it or mend the import"
    folder, _, name = lacks.rpartition(".")
    if folder:
        return f"there is no module {lacks}; is there {folder.replace('.', '/')}/{name}.py?"
    return f"there is no package {lacks}; start in the folder that holds {lacks}/, or put that on PYTHONPATH"
