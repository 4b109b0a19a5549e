"""What a run tells, for those who iterate over it, and for functions that are called with it."""

from __future__ import annotations

import contextlib
import threading
import time as clock
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple, Optional

from ._names import unknown
from ._waiting import moment_after
from .errors import CallError, ConfigurationError, WaitError

if TYPE_CHECKING:
    from ._reader import Reader
    from ._watched import Watched

__all__ = ["Event"]

_KINDS = (
    *("hello", "status", "order", "parameters", "stack", "monitor", "forecast", "pipelines", "done", "people"),
    *("camera", "wheel", "kept", "followed", "note", "note_removed", "link", "play", "precision", "error", "end"),
    *("frame", "lost", "ended"),
)


class Event(NamedTuple):
    """Something that a run told.

    Attributes
    ----------
    kind : str
        `hello`, `status`, `order`, `parameters`, `stack`, `monitor`, `forecast`, `pipelines`, `done`, `people`,
        `camera`, `wheel` (somebody asks for it), `kept` (the driver keeps it), `followed`, `note`, `note_removed`,
        `link`, `play`, `precision`, `error`, `end`, `frame`, `lost` (the connection was lost, and is made again),
        `ended` (nothing comes after it), or the name of a message that this version does not know, which comes where
        all kinds are asked for.
    data : dict, View or str
        The message as a dict, as docs/protocol.md says it; of a `frame` the `View`, of `lost` and `ended` the reason.
    """

    kind: str
    data: Any


def check_kinds(kinds: Iterable[object]) -> None:
    """An error where there are no events of a kind, for which nobody should wait."""
    for kind in kinds:
        if kind not in _KINDS:
            raise ConfigurationError(unknown("event", kind, _KINDS))


def iterate(
    reader: Reader, waiting: deque[Event], kinds: tuple[str, ...], timeout: Optional[float] = None
) -> Iterator[Event]:
    """The events of some kinds, or all without any, that come into a queue of `Reader.listen`; to the last."""
    until = moment_after(timeout)
    while True:
        try:
            event = reader.next(waiting, None if timeout is None else max(until - clock.monotonic(), 0.0))
        except CallError:
            return
        except WaitError:
            what = " or ".join(f"'{kind}'" for kind in kinds)
            raise WaitError(f"no event {what + ' ' if kinds else ''}came within {timeout} seconds") from None
        ended = event.kind == "ended"
        if not kinds or event.kind in kinds:
            yield event
            # Others in between do not make the wait longer.
            until = moment_after(timeout)
        if ended:
            return


class Callbacks:
    """Functions that are called with events, on a thread of their own: there is one from the first function on."""

    def __init__(self, reader: Reader) -> None:
        self._reader = reader
        self._lock = threading.Lock()
        # While there are functions: what they are called with comes no more once the run is let go of.
        self._run: Optional[Watched] = None
        self._functions: list[tuple[Optional[str], Callable[[Event], object]]] = []
        self._thread: Optional[threading.Thread] = None

    def add(self, run: Watched, kind: Optional[str], function: Callable[[Event], object]) -> Callable[[], None]:
        """Have a function called with events of a run of a kind, or with all; returns what ends that."""
        entry = (kind, function)
        self._reader.check()
        with self._lock:
            self._functions.append(entry)
            self._run = run
            if self._thread is None:
                waiting = self._reader.listen()
                self._thread = threading.Thread(target=self._call, args=(waiting,), name="tombolo-calls", daemon=True)
                self._thread.start()

        def remove() -> None:
            with self._lock:
                if entry in self._functions:
                    self._functions.remove(entry)
                if not self._functions:
                    self._run = None

        return remove

    def _call(self, waiting: deque[Event]) -> None:
        for event in iterate(self._reader, waiting, ()):
            self._call_each(event)

    def _call_each(self, event: Event) -> None:
        # No loop of the thread's own: a function that was removed may be the last that refers to its run.
        import traceback

        with self._lock:
            chosen = [function for kind, function in self._functions if kind in (None, event.kind)]
            if event.kind == "ended":
                # Nothing comes after it: a function that is added from now on is told by a thread of its own.
                self._functions, self._run, self._thread = [], None, None
        for function in chosen:
            try:
                function(event)
            except BaseException:
                # An exit would end this thread alone, and be told nowhere.
                # Where nobody reads the errors of this program any more, callbacks go on.
                with contextlib.suppress(OSError, ValueError):
                    traceback.print_exc()
