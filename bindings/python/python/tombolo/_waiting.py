"""Waits that Ctrl-C ends."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Optional, TypeVar

Result = TypeVar("Result")


def moment_after(timeout: Optional[float]) -> float:
    """The moment so many seconds from now, on the clock `time.monotonic`; one that never comes for None."""
    return float("inf") if timeout is None else time.monotonic() + timeout


def in_thread(call: Callable[[], Result]) -> Result:
    """What a call of Rust's returns that may take long: on a thread of its own, so that this one can be interrupted.

    A call that is interrupted goes on by itself, and what it returns is dropped.
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

    threading.Thread(target=work, name="tombolo-call", daemon=True).start()
    while not done.wait(1.0):
        pass
    if errors:
        # An error in a list of its own traceback would keep alive what it has met.
        raise errors.pop()
    return results[0]
