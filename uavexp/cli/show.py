"""`--cfg` and `--info`: what would be flown, and with what; nothing flies."""

from __future__ import annotations

import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

from uavexp.config.composition import CommandLine, Composer
from uavexp.config.trust import trusted_packages
from uavexp.paths import PACKAGE, conf_folder, outputs_root
from uavexp.store.records import code_digest, lock_digest


def config_text(composer: Composer, command: CommandLine, part: str) -> str:
    """The composed configuration of every cell as yaml documents.

    Args:
        composer: that composed the command.
        command: what was typed.
        part: `job` (ours), `hydra`, or `all`.
    """
    from omegaconf import OmegaConf

    documents = []
    for cell in command.cells:
        tree: dict[str, Any] = {}
        if part in ("job", "all"):
            seeds = ",".join(map(str, command.seeds))
            tree = {"strategy": cell.strategy, "seed": seeds, "out": command.out, **cell.config}
        if part in ("hydra", "all"):
            tree["hydra"] = composer.compose(cell.settings)["hydra"]
        documents.append(OmegaConf.to_yaml(OmegaConf.create(tree)))
    return "---\n".join(documents)


def info_text(user_folder: Path | None) -> str:
    """Versions, folders and digests, for a bug report."""
    packages = ("uavexp", "hydra-core", "omegaconf", "numpy", "scipy", "numba", "casadi", "pyarrow")
    facts = {
        "python": f"{platform.python_version()} on {platform.system()} {platform.machine()}",
        **{name: _version(name) for name in packages},
        "package": PACKAGE,
        "configuration": conf_folder(),
        "user options": user_folder or "none",
        "new outputs": outputs_root(),
        "trusted packages": ", ".join(trusted_packages()),
        "code digest": code_digest(),
        "lock digest": lock_digest() or "none",
    }
    return "".join(f"{name:<18} {value}\n" for name, value in facts.items())


def _version(package: str) -> str:
    try:
        return version(package)
    except ImportError:
        return "not installed"
