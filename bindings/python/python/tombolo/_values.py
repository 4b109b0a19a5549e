"""Numbers that were given, or an error that says what was expected."""

from __future__ import annotations

import math
import operator

from .errors import ConfigurationError

#: The greatest whole number that the library takes.
_MOST = (1 << 32) - 1


def whole(value: object, name: str, least: int) -> int:
    """A whole number that is not less than another."""
    try:
        given = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        given = -1
    if not least <= given <= _MOST:
        raise ConfigurationError(f"{name}: found {value!r}, expected a whole number from {least} on")
    return given


def number(value: object, name: str) -> float:
    """A number; a text is none."""
    try:
        if isinstance(value, (str, bytes)):
            raise TypeError
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        raise ConfigurationError(f"{name}: found {value!r}, expected a number") from None


def seconds(timeout: object) -> float:
    """How long a wait may take; infinitely long for None."""
    given = math.inf if timeout is None else number(timeout, "timeout")
    if math.isnan(given) or given < 0:
        raise ConfigurationError(f"timeout: found {timeout!r}, expected seconds from 0 on, or None")
    return given
