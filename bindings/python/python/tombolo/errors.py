"""What can go wrong, a class for each kind.

What is wrong with a mesh, an order or a run is a `TomboloError`; a name that is not there is a `KeyError`, and an
argument of another type a `TypeError`, as everywhere in Python. Texts are those of the library: they say what was
found, where, what was expected, and the nearest name that is known.
"""

from __future__ import annotations

from typing import Optional

__all__ = [
    "CallError",
    "ConfigurationError",
    "EndedError",
    "FailedError",
    "LinkError",
    "MeshError",
    "NotDriverError",
    "RejectedError",
    "StepError",
    "TomboloError",
    "WaitError",
]


class TomboloError(Exception):
    """Any error of this package."""


class ConfigurationError(TomboloError, ValueError):
    """A configuration, an order or a parameter that makes no sense, with line, column and path."""


class MeshError(TomboloError, ValueError):
    """Arrays that make no mesh or no field of it, with the name of the channel and of the array."""


class StepError(TomboloError, ValueError):
    """A step that cannot be: a negative cycle, a time that is not finite, no channel, a run that others have ended."""


class CallError(TomboloError, RuntimeError):
    """A call at the wrong time: of an adaptor that was closed, is in another call, or is another process's."""


class FailedError(TomboloError, RuntimeError):
    """Something was not done: an address in use, a file that cannot be written, a solver that failed elsewhere."""


class LinkError(TomboloError, ConnectionError):
    """A run that is not reached, or whose connection was lost for good."""


class EndedError(TomboloError):
    """The run has ended."""


class NotDriverError(TomboloError, PermissionError):
    """Another client steers, or this one may only watch."""


class RejectedError(TomboloError):
    """The run refuses what it was asked, and says why; nothing has changed.

    Parameters
    ----------
    message
        The reason.
    report
        What the run tells of the order, where it is one.

    Attributes
    ----------
    report : dict or None
        What the run tells of the order, where it is one: `fraction` is the part of its amounts that would pass,
        where that is known, and `min_scaled_jacobian` the quality that it would have come to.
    """

    def __init__(self, message: str, report: Optional[dict[str, object]] = None) -> None:
        super().__init__(message)
        self.report = report


class WaitError(TomboloError, TimeoutError):
    """What was waited for did not come in time; it may still come."""
