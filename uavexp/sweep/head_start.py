"""The fork server started while the command is still composed: both import the same for seconds."""

from __future__ import annotations

from collections.abc import Sequence

from uavexp.config.options import RUNNER_GROUP
from uavexp.config.overrides import Setting
from uavexp.kernel_cache import has_kernels
from uavexp.sweep.fork_server import start_fork_server

PRELOAD = "uavexp.sweep.preload"


def give_head_start(settings: Sequence[Setting]) -> None:
    """Start the fork server if these settings will need it, and no kernels are compiled first."""
    if has_kernels() and _need_fork_server(settings):
        start_fork_server([PRELOAD])


def _need_fork_server(settings: Sequence[Setting]) -> bool:
    values = {setting.key: setting.values for setting in settings}
    if values.get(f"{RUNNER_GROUP}.dry_run", (False,)) != (False,):
        return False
    return "dask" not in (*values.get(RUNNER_GROUP, ()), *values.get(f"{RUNNER_GROUP}.backend", ()))
