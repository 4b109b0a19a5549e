"""Values of Python as texts of the JSON language."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Union

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
        raise ConfigurationError(f"{name}: {error}; expected what JSON can hold") from None


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
