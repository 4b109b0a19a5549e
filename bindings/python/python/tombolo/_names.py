"""Names that are not there, and the nearest of those that are."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def meant(name: object, known: Iterable[str]) -> str:
    """What is said behind a name that is not there: the nearest that is, or nothing."""
    near = difflib.get_close_matches(name, list(known), 1) if isinstance(name, str) else []
    return f" (did you mean '{near[0]}'?)" if near else ""


def unknown(what: str, name: object, known: Iterable[str], those: str = "there are") -> str:
    """Say that there is no such name, which is the nearest, and which there are."""
    names = list(known)
    return f"no {what} '{name}'{meant(name, names)}; {those}: {', '.join(names) or 'none yet'}"
