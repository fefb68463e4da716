"""The one place that imports Open3D: with its missing libusb, without its slow plots.

Open3D needs `libusb-1.0.so.0`, which bare machines lack, and spends 1.7 of its 2.4 s of
import on dash and plotly, which nothing here uses. Its threads are TBB's; they are set
to one so that block and vertex order, and so every record, do not depend on the machine.
"""

from __future__ import annotations

import ctypes
import sys
import types as _types

from uavexp.errors import UavexpError


def _stub(name: str) -> _types.ModuleType:
    """Return a module in which every name exists and is None."""
    module = _types.ModuleType(name)
    module.__getattr__ = lambda _: None  # type: ignore[method-assign]
    return module


def _load() -> _types.ModuleType:
    try:
        import libusb_package

        ctypes.CDLL(libusb_package.get_library_path(), mode=ctypes.RTLD_GLOBAL)
    except (ImportError, OSError):
        pass  # the system's own libusb may do
    stubbed = "dash" not in sys.modules
    if stubbed:
        sys.modules["dash"] = _stub("dash")
    try:
        import open3d
    except ImportError as error:
        message = (
            f"Open3D cannot be loaded ({error}); on Debian or Ubuntu: apt-get install "
            "libgl1 libegl1 libx11-6 libudev1 libidn2-0 libusb-1.0-0"
        )
        raise UavexpError(message) from error
    finally:
        if stubbed:
            del sys.modules["dash"]
    open3d.utility.set_max_threads(1)
    open3d.utility.set_verbosity_level(open3d.utility.VerbosityLevel.Error)
    return open3d


open3d = _load()
