"""Waits that Ctrl-C ends."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Generator
from typing import Any, Optional, TypeVar

from ._values import seconds

Result = TypeVar("Result")

#: What is waited for, how many seconds at most, and what is said of one that was in vain, such as "no status came".
Wanted = tuple[Callable[[], object], Optional[float], str]
#: A wait in parts, carried out by a thread (`Reader.carry_out`) or by a loop (`aio`): it yields what it wants, is given
#: that or why it does not come, and returns what comes of it.
Parts = Generator[Wanted, Any, Result]


def moment_after(timeout: Optional[float]) -> float:
    """The moment so many seconds from now, on the clock `time.monotonic`; one that never comes for None."""
    return time.monotonic() + seconds(timeout)


def in_thread(
    call: Callable[[], Result],
    progress: Optional[Callable[[float], object]] = None,
    cancel: Optional[Callable[[], object]] = None,
) -> Result:
    """What a call of Rust's returns that may take long: on a thread of its own, so that this one can be interrupted.

    Parameters
    ----------
    call : callable
        The call.
    progress : callable, optional
        Called at once and then about ten times a second, with the seconds so far. What it raises is an interruption.
    cancel : callable, optional
        Has a call that was interrupted given up, which is waited for. Left out, it goes on by itself, and what it
        returns is dropped.
    """
    done = threading.Event()
    results: list[Result] = []
    errors: list[BaseException] = []

    def work() -> None:
        try:
            results.append(call())
        except BaseException as error:
            errors.append(error)
        finally:
            done.set()

    begun = time.monotonic()
    threading.Thread(target=work, name="tombolo-call", daemon=True).start()
    try:
        while True:
            if progress is not None:
                progress(time.monotonic() - begun)
            if done.wait(1.0 if progress is None else 0.1):
                break
    except BaseException:
        if cancel is not None:
            cancel()
            done.wait()
        raise
    if errors:
        # An error in a list of its own traceback would keep alive what it has met.
        raise errors.pop()
    return results[0]
