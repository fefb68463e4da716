"""Whether the kernels of the modules that are imported are compiled.

This reads numba's private index of compiled signatures. Should a later numba keep it
elsewhere, none is found, and every command flies once to compile: slower, equally right.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import Any


def is_compiled() -> bool:
    """Whether any kernel is there in its present version (else a minute of compiling lies ahead)."""
    return any(_signatures(kernel) for kernel in _kernels())


def _kernels() -> Iterator[Any]:
    from numba.core.dispatcher import Dispatcher

    modules = [module for name, module in sorted(sys.modules.items()) if name.startswith("uavexp.")]
    values = (value for module in modules for value in vars(module).values())
    yield from {id(value): value for value in values if isinstance(value, Dispatcher)}.values()


def _signatures(kernel: Any) -> list[Any]:
    """Signatures in a kernel's cache that are those of its present source and this processor."""
    try:
        own = kernel._cache._index_key((), kernel.targetctx.codegen())[1:]
        return [key[0] for key in kernel._cache._cache_file._load_index() if key[1:] == own]
    except (AttributeError, TypeError):
        return []
