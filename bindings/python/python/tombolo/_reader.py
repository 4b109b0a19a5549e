"""A client of a run, with the thread that reads what the run tells, and the waits for it."""

from __future__ import annotations

import atexit
import contextlib
import os
import threading
import time as clock
import weakref
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Optional, TypeVar

from . import _json, _native
from ._waiting import Parts, Result, moment_after
from .errors import CallError, EndedError, FailedError, TomboloError, WaitError
from .events import Event
from .state import State

Found = TypeVar("Found")

#: How long the thread waits for an event at once, in seconds: so long it takes to close.
_SLICE = 0.2
#: Events that wait for one who iterates over them; beyond it the oldest make way.
_EVENTS = 4096

_READERS: weakref.WeakSet[Reader] = weakref.WeakSet()


#: What is said of a wait in vain for what a caller's own function looks for.
NOT_FOUND = "what was looked for did not come"


def late(in_vain: str, timeout: Optional[float]) -> WaitError:
    """Say what did not come in time."""
    return WaitError(f"{in_vain} within {timeout} seconds")


class Reader:
    """Reads what a run tells into a state, and into the queues of those who listen.

    Parameters
    ----------
    client : _native.Client
        The client.
    state : State
        What is known of the run.

    Attributes
    ----------
    changed : threading.Condition
        It is held while the state changes, and told of it.
    failure : TomboloError or None
        Why nothing comes any more.
    closed : bool
        Whether it was closed.
    """

    def __init__(self, client: _native.Client, state: State) -> None:
        self.changed = threading.Condition()
        self.failure: Optional[TomboloError] = None
        self.closed = False
        self._state = state
        self._client: Optional[_native.Client] = client
        self._missed = 0
        self._process = os.getpid()
        self._listeners: list[weakref.ref[deque[Event]]] = []
        self._tells: list[Callable[[], None]] = []
        # The thread that looks whether what it waits for is there, and holds `changed` meanwhile.
        self._looks: Optional[int] = None
        self._thread = threading.Thread(target=self._read, args=(client,), name="tombolo-run", daemon=True)
        _READERS.add(self)
        self._thread.start()

    def _read(self, client: _native.Client) -> None:
        try:
            while not self.closed:
                told = client.next(_SLICE)
                if told is not None:
                    self._take(*told)
        except Exception as error:
            # Whatever it is, nothing comes any more, and nobody may wait for it.
            failure = error if isinstance(error, TomboloError) else FailedError(f"what the run told: {error!r}")
            with self.changed:
                self.failure = failure
                self._tell(Event("ended", str(failure)))
                self._wake()
        if self.closed:
            self._let_go()

    def _take(self, kind: str, payload: Any) -> None:
        data = _json.loads(payload) if isinstance(payload, str) and kind != "lost" else payload
        with self.changed:
            self._tell(self._state.take(kind, data))
            self._wake()

    def _tell(self, event: Event) -> None:
        self._listeners = [listener for listener in self._listeners if listener() is not None]
        for listener in self._listeners:
            waiting = listener()
            if waiting is not None:
                waiting.append(event)

    def _wake(self) -> None:
        """Have whoever waits look again. `changed` is held."""
        self.changed.notify_all()
        for tell in tuple(self._tells):
            tell()

    # ---- The client.

    @property
    def client(self) -> _native.Client:
        """The client, for commands and questions; an error where it was closed, or is of another process."""
        client = self._client
        self.check()
        assert client is not None
        return client

    @property
    def drives(self) -> bool:
        """Whether the client steers: not in a fork, and not once nothing comes any more."""
        client = self._client
        is_there = self.failure is None and os.getpid() == self._process
        return is_there and client is not None and client.drives

    @property
    def missed(self) -> int:
        """How many events made way for newer ones before they were read."""
        client = self._client
        return self._missed if client is None else client.missed

    def check(self) -> None:
        """An error where it was closed, or is of another process."""
        if os.getpid() != self._process:
            raise CallError("the run was connected before this process was forked; connect here")
        if self.closed:
            raise CallError("the run was closed; connect again")

    def check_goes_on(self) -> None:
        """An error where it was closed or is of another process, the run has ended or the connection is lost."""
        self.check()
        if self.failure is not None:
            raise self._over(self.failure)

    def close(self) -> None:
        """Close the connection, and end every wait."""
        if os.getpid() != self._process:
            return
        with self.changed:
            self.closed = True
            self._wake()
            if self._looks == threading.get_ident():
                # What this thread waits for has closed it: the one that reads lets go once `changed` is free.
                return
        if threading.current_thread() is not self._thread:
            self._thread.join(5.0)
        self._let_go()

    def abandon(self) -> None:
        """Have the connection closed by the thread that reads.

        The garbage collector calls it, on any thread and whatever that thread holds: nothing is waited for here.
        """
        self.closed = True

    def _let_go(self) -> None:
        with self.changed:
            client, self._missed, self._client = self._client, self.missed, None
            self._wake()
        if client is not None:
            # Letting go of it would not do: the traceback of an error may hold it, and the wheel with it.
            client.close()

    # ---- Waiting.

    def wait_for(self, found: Callable[[], Found], timeout: Optional[float] = None, in_vain: str = NOT_FOUND) -> Found:
        """What is asked for at each event until it is there; `in_vain` is what an error says that did not come."""
        until = moment_after(timeout)
        with self.changed:
            while True:
                answer = self.look(found)
                if answer:
                    return answer
                left = until - clock.monotonic()
                if left <= 0:
                    raise late(in_vain, timeout)
                # Short enough for Ctrl-C on every system.
                self.changed.wait(min(left, 1.0))

    def look(self, found: Callable[[], Found]) -> Found:
        """What `found` returns now; an error where it is nothing true and nothing comes any more."""
        with self.changed:
            self.check()
            before, self._looks = self._looks, threading.get_ident()
            try:
                answer = found()
            finally:
                self._looks = before
            if not answer and self.failure is not None:
                raise self._over(self.failure)
            return answer

    def begin_telling(self, tell: Callable[[], None]) -> None:
        """Have a function called whenever there may be something new, by any thread; it must not wait."""
        with self.changed:
            self._tells.append(tell)

    def end_telling(self, tell: Callable[[], None]) -> None:
        """Have the function called no more."""
        with self.changed:
            self._tells.remove(tell)

    @contextlib.contextmanager
    def looking_again(self) -> Iterator[None]:
        """Have whoever waits look again once the block, which nobody looks into meanwhile, has changed something."""
        with self.changed:
            yield
            self._wake()

    def carry_out(self, parts: Parts[Result]) -> Result:
        """Carry out a wait in parts."""
        try:
            wanted = next(parts)
            while True:
                try:
                    answer = self.wait_for(*wanted)
                except Exception as error:
                    wanted = parts.throw(error)
                else:
                    wanted = parts.send(answer)
        except StopIteration as end:
            result: Result = end.value
            return result
        finally:
            # What was interrupted lets go of what it holds at once.
            parts.close()

    def _over(self, failure: TomboloError) -> TomboloError:
        end = self._state.end
        if isinstance(failure, EndedError) and end is not None:
            return EndedError(f"the run has ended: {end['how']} at cycle {end['cycle']}")
        return type(failure)(*failure.args)

    def listen(self) -> deque[Event]:
        """What the run tells from now on, until whoever asked lets go of it."""
        self.check()
        waiting: deque[Event] = deque(maxlen=_EVENTS)
        with self.changed:
            if self.failure is not None:
                waiting.append(Event("ended", str(self.failure)))
            self._listeners.append(weakref.ref(waiting))
        return waiting

    def next(self, waiting: deque[Event], timeout: Optional[float]) -> Event:
        """Wait for the next event of a queue that `listen` has returned."""
        self.wait_for(lambda: len(waiting) > 0, timeout)
        return waiting.popleft()


@atexit.register
def _close_all() -> None:
    # A thread that reads must not outlive the interpreter.
    for reader in list(_READERS):
        reader.close()
