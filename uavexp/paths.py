"""Where the shipped files are: in a source checkout, or inside an installed wheel."""

from __future__ import annotations

import os
from pathlib import Path

from uavexp.errors import ConfigError

_LONGEST = 255  # bytes of a name, on any common file system
PACKAGE = Path(__file__).resolve().parent


def conf_folder() -> Path:
    """Folder of the shipped configuration: `uavexp/conf` in a wheel, `conf/` in a checkout."""
    for folder in (PACKAGE / "conf", PACKAGE.parent / "conf"):
        if (folder / "config.yaml").is_file():
            return folder
    raise ConfigError(f"no configuration found: neither {PACKAGE / 'conf'} nor {PACKAGE.parent / 'conf'}")


def experiments_folder() -> Path:
    """Folder of the shipped experiments, beside `conf` in a checkout and in a wheel."""
    return conf_folder().parent / "experiments"


def checkout_root() -> Path | None:
    """Root of the source checkout, or None when the package is installed."""
    return PACKAGE.parent if conf_folder() == PACKAGE.parent / "conf" else None


def expanded(text: str) -> Path:
    """A path as typed, `~` and `~name` in place of homes.

    Raises:
        ConfigError: nobody has that name, or no path can be so.
    """
    if not text.isprintable() or any(len(os.fsencode(part)) > _LONGEST for part in Path(text).parts):
        raise ConfigError(f"no file can be called {text[:60]!r}, of {len(text)} characters")
    try:
        return Path(text).expanduser()
    except RuntimeError as error:
        raise ConfigError(f"{text}: there is no such user; write ./{text}") from error


def outputs_root() -> Path:
    """Where new output folders go: `outputs/` of the checkout, else of the working directory."""
    return (checkout_root() or Path.cwd()) / "outputs"
