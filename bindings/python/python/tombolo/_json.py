"""Values of Python as texts of the JSON language."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Optional, Union

import numpy as np

from .errors import ConfigurationError

# A text with the name that errors call it by, or a file.
Source = Union[tuple[str, str], Path]


def _plain(value: object) -> object:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise TypeError(f"a {type(value).__name__} is no JSON")


def text(value: object, name: str) -> str:
    """A value as JSON; NumPy's arrays and numbers are lists and numbers."""
    try:
        return json.dumps(value, default=_plain, allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        place = _not_finite(value)
        wrong = f"{error}; expected what JSON can hold" if place is None else f"{place}, expected a finite number"
        raise ConfigurationError(f"{name}: {wrong}") from None


def _not_finite(value: object) -> Optional[str]:
    """Where a value has a number that JSON cannot hold."""

    def places(value: object, path: str) -> Iterator[str]:
        if isinstance(value, (np.ndarray, np.generic)):
            value = value.tolist()
        if isinstance(value, Mapping):
            for key, one in value.items():
                yield from places(one, f"{path}.{key}" if path else str(key))
        elif isinstance(value, (list, tuple)):
            for index, one in enumerate(value):
                yield from places(one, f"{path}[{index}]")
        elif isinstance(value, float) and not math.isfinite(value):
            yield f"{path}: found {value}"

    try:
        return next(places(value, ""), None)
    except RecursionError:
        return None


def file(value: object, name: str) -> str:
    """The name of a file or a directory as a text."""
    if not isinstance(value, (str, os.PathLike)):
        raise ConfigurationError(f"{name}: found {value!r}, expected the name of a file")
    return str(os.fspath(value))


def source(value: object, name: str) -> Source:
    """A dict or list as a text, and a name of a file as that."""
    if value == "":
        raise ConfigurationError(f"{name}: found an empty text, expected the name of a file, a dict or a list")
    if isinstance(value, (str, os.PathLike)):
        return Path(os.fspath(value))
    return text(value, name), name


def read(value: object, name: str) -> tuple[str, str]:
    """A dict or list as a text, and what is in a file, each with its name in errors."""
    given = source(value, name)
    if isinstance(given, tuple):
        return given
    try:
        return given.read_text(encoding="utf-8"), str(given)
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(f"{given}: {error}") from None


def loads(given: str) -> Any:
    """What a text of the library says."""
    return json.loads(given)


def order(edits: object, settings: Mapping[str, Any]) -> tuple[str, str]:
    """Edits, an order, or a file of either as a text with its name; `settings` take the place of its own."""
    given = {key: value for key, value in settings.items() if value is not None}
    content, name = read(edits, "order")
    if not given:
        return content, name
    try:
        parts = json.loads(content)
    except ValueError as error:
        raise ConfigurationError(f"{name}: {error}") from None
    own = parts if isinstance(parts, dict) else {"edits": parts}
    return text({**own, **given}, name), name
