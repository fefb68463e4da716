"""Errors a user can mend: one line each, never a traceback."""

import errno

_DISK_FULL = (errno.ENOSPC, errno.EDQUOT)


class UavexpError(Exception):
    """Base of every error that the user can mend; printed as one line (`one_line`)."""

    @property
    def exit_code(self) -> int:
        """2, bad input; 1 when the disk was full, which is no fault of what was typed."""
        cause = self.__cause__
        return 1 if isinstance(cause, OSError) and cause.errno in _DISK_FULL else 2


class ConfigError(UavexpError, ValueError):
    """A configuration value is missing, unknown, of the wrong type or out of range."""


class WorldError(UavexpError):
    """A world cannot be made or read: bad file, start in an obstacle, target unreachable."""


class RecordError(UavexpError):
    """A stored record is damaged, of another version, or cannot be written."""


def one_line(error: BaseException) -> str:
    """The message of an error without line breaks."""
    return " ".join(str(error).split())


def require(condition: bool, message: str) -> None:
    """Raise `ConfigError(message)` unless `condition` holds (asserts vanish under -O)."""
    if not condition:
        raise ConfigError(message)


def require_positive(**values: float) -> None:
    """Raise `ConfigError` unless every value is finite and > 0; names carry the unit suffix."""
    for name, value in values.items():
        require(0.0 < value < float("inf"), f"{name} must be > 0 and finite, got {value}")


def require_non_negative(**values: float) -> None:
    """Raise `ConfigError` unless every value is finite and >= 0."""
    for name, value in values.items():
        require(0.0 <= value < float("inf"), f"{name} must be >= 0 and finite, got {value}")
