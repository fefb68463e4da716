"""Where the shipped files are: in a source checkout, or inside an installed wheel."""

from __future__ import annotations

from pathlib import Path

from uavexp.errors import ConfigError

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


def outputs_root() -> Path:
    """Where new output folders go: `outputs/` of the checkout, else of the working directory."""
    return (checkout_root() or Path.cwd()) / "outputs"
