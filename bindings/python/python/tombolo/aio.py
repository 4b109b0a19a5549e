"""A run for `async` programs."""

from __future__ import annotations

import asyncio
import contextlib
import os
import threading
import time as clock
from collections import deque
from collections.abc import AsyncIterator, Callable, Generator, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Optional, TypeVar, Union

from . import _json
from ._reader import Reader, late
from ._values import number, whole
from ._waiting import Parts, Result, moment_after
from .errors import CallError
from .events import check_kinds
from .orders import Command, Edits, Forecast, Order
from .run import WHEEL, Run, _text, left
from .run import connect as _connect

if TYPE_CHECKING:
    from . import _native
    from .events import Event
    from .state import Status
    from .views import Surface, View

__all__ = ["AsyncOrder", "AsyncRun", "connect"]

Found = TypeVar("Found")


class _Waits:
    """The waits of one loop for one run: they look again together, once for all that has come meanwhile."""

    def __init__(self, loop: asyncio.AbstractEventLoop, reader: Reader) -> None:
        self._loop, self._reader = loop, reader
        self._told: set[asyncio.Event] = set()
        self._is_due = False

    @contextlib.contextmanager
    def one(self) -> Iterator[asyncio.Event]:
        """One wait, which is told by this event that there may be something new."""
        told = asyncio.Event()
        if not self._told:
            self._reader.begin_telling(self._tell)
        self._told.add(told)
        try:
            yield told
        finally:
            self._told.remove(told)
            if not self._told:
                del _WAITS[self._loop, self._reader]
                self._reader.end_telling(self._tell)

    def _tell(self) -> None:
        """By the thread that reads: a loop that is slower than what comes has one call that waits, not thousands."""
        if not self._is_due:
            self._is_due = True
            # A loop that was closed has nobody who waits.
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._look)

    def _look(self) -> None:
        self._is_due = False
        for told in self._told:
            told.set()


#: The waits that there are. Those of a loop are made and ended on it.
_WAITS: dict[tuple[asyncio.AbstractEventLoop, Reader], _Waits] = {}


async def _wait_for(reader: Reader, found: Callable[[], Found], timeout: Optional[float]) -> Found:
    """A wait that holds no thread: the one that reads has the loop look again."""
    loop, until = asyncio.get_running_loop(), moment_after(timeout)
    waits = _WAITS.setdefault((loop, reader), _Waits(loop, reader))
    with waits.one() as told:
        while True:
            told.clear()
            answer = reader.look(found)
            if answer:
                return answer
            left = until - clock.monotonic()
            if left <= 0:
                raise late(timeout)
            timer = None if timeout is None else loop.call_later(left, told.set)
            try:
                await told.wait()
            finally:
                if timer is not None:
                    timer.cancel()


async def _carry_out(reader: Reader, parts: Parts[Result]) -> Result:
    """As `Reader.carry_out`, on a loop."""
    try:
        found, timeout = next(parts)
        while True:
            try:
                answer = await _wait_for(reader, found, timeout)
            except Exception as error:
                found, timeout = parts.throw(error)
            else:
                found, timeout = parts.send(answer)
    except StopIteration as end:
        result: Result = end.value
        return result


async def _in_thread(call: Callable[[], Result]) -> Result:
    """What a call returns that blocks.

    It has a thread of its own: asyncio's pool has few, which are the program's, and its end waits for them.
    """
    loop = asyncio.get_running_loop()
    done: asyncio.Future[Result] = loop.create_future()

    def settle(settled: Callable[[Any], None], outcome: object) -> None:
        # Whoever waited may have been cancelled.
        if not done.done():
            settled(outcome)

    def work() -> None:
        try:
            settled: tuple[Callable[[Any], None], object] = (done.set_result, call())
        except BaseException as error:
            settled = (done.set_exception, error)
        with contextlib.suppress(RuntimeError):
            loop.call_soon_threadsafe(settle, *settled)

    threading.Thread(target=work, name="tombolo-call", daemon=True).start()
    return await done


class _Connecting:
    """A connection that is made by `await`, or for the length of an `async with` block."""

    def __init__(self, connect: Callable[[], Run]) -> None:
        self._connect = connect
        self._made: Optional[AsyncRun] = None

    def __await__(self) -> Generator[Any, None, AsyncRun]:
        return self._make().__await__()

    async def _make(self) -> AsyncRun:
        return (await _in_thread(self._connect)).aio

    async def __aenter__(self) -> AsyncRun:
        self._made = await self._make()
        return self._made

    async def __aexit__(self, *error: object) -> None:
        if self._made is not None:
            await self._made.close()


def connect(link: Union[str, os.PathLike[str]], **settings: Any) -> _Connecting:
    """Connect to a run, as `tombolo.connect` does: ``await`` it, or have the end of an ``async with`` block close it.

    Parameters
    ----------
    link : str or path
        As of `tombolo.connect`.
    **settings
        As of `tombolo.connect`.

    Returns
    -------
    awaitable of AsyncRun
        The run, which an `async with` block gives too.

    Examples
    --------
    ::

        async def watch():
            async with tombolo.aio.connect("http://127.0.0.1:7070/?token=...", watch=True) as aio:
                status = await aio.wait_for_cycle(3)
                print(status.cycle, aio.run.features)
    """
    return _Connecting(lambda: _connect(link, **settings))


class AsyncOrder:
    """An order whose `wait` and `cancel` are coroutines; it has what an `Order` has.

    Attributes
    ----------
    order : Order
        The order itself.
    """

    def __init__(self, order: Order) -> None:
        self.order = order

    def __getattr__(self, name: str) -> Any:
        return getattr(self.order, name)

    async def wait(self, timeout: Optional[float] = None, *, until: str = "applied") -> Order:
        """As `Order.wait`."""
        return await _carry_out(self.order._run._reader, self.order._wait(timeout, until))

    async def cancel(self, *, timeout: Optional[float] = None) -> Command:
        """As `Order.cancel`."""
        return await self.order._run.aio.cancel(self.order, timeout=timeout)

    def __repr__(self) -> str:
        return repr(self.order)


class _Events(AsyncIterator["Event"]):
    """What a run tells. No generator, which the cancellation of one wait for an event would end for good."""

    def __init__(self, run: Run, kinds: tuple[str, ...]) -> None:
        self._run, self._reader, self._kinds = run, run._reader, kinds
        self._waiting: deque[Event] = self._reader.listen()
        self._is_over = False

    async def __anext__(self) -> Event:
        while not self._is_over:
            # It is taken behind the wait: of one that was cancelled the event would be lost.
            try:
                await _wait_for(self._reader, lambda: len(self._waiting) > 0, None)
            except CallError:
                break
            if self._waiting:
                event = self._waiting.popleft()
                self._is_over = event.kind == "ended"
                if not self._kinds or event.kind in self._kinds:
                    return event
        self._is_over = True
        raise StopAsyncIteration


class AsyncRun:
    """A `Run` whose methods that wait are coroutines: `run.aio`. What is only looked at is read from the run itself.

    The end of an `async with` block closes the run.

    Attributes
    ----------
    run : Run
        The run.

    Examples
    --------
    ::

        async def squeeze(run):
            async with run.aio as aio:
                order = await aio.order(edits)
                await order.wait()
                async for event in aio.events("monitor"):
                    print(event.data["values"])
    """

    def __init__(self, run: Run) -> None:
        self.run = run

    async def __aenter__(self) -> AsyncRun:
        return self

    async def __aexit__(self, *error: object) -> None:
        await self.close()

    async def order(
        self,
        edits: Edits,
        *,
        schedule: Optional[Mapping[str, Any]] = None,
        deform: Optional[Mapping[str, Any]] = None,
        guard: Optional[Mapping[str, Any]] = None,
        replaces: Union[Order, str, None] = None,
        deadline: Optional[int] = None,
    ) -> AsyncOrder:
        """As `Run.order`. One that is cancelled while it waits for the wheel is not given."""
        prepared = await self._prepared(
            edits, schedule=schedule, deform=deform, guard=guard, replaces=replaces, deadline=deadline
        )
        return AsyncOrder(Order(self.run, await self._send(lambda client: client.order(prepared))))

    async def _prepared(self, edits: Edits, **settings: Any) -> _native.Prepared:
        return await _in_thread(lambda: self.run._prepared(_text(edits, **settings)))

    async def undo(self, count: int = 1) -> AsyncOrder:
        """As `Run.undo`."""
        orders = whole(count, "count", 1)
        return AsyncOrder(Order(self.run, await self._send(lambda client: client.undo(orders))))

    async def forecast(
        self,
        edits: Edits,
        *,
        schedule: Optional[Mapping[str, Any]] = None,
        deform: Optional[Mapping[str, Any]] = None,
        guard: Optional[Mapping[str, Any]] = None,
        timeout: Optional[float] = None,
    ) -> Forecast:
        """As `Run.forecast`."""
        prepared = await self._prepared(edits, schedule=schedule, deform=deform, guard=guard)
        question = await self._send(lambda client: client.forecast(prepared))
        return await self._carry_out(self.run._foretold(question, timeout))

    async def hand_over(self, to: str, timeout: float = 60.0) -> None:
        """As `Run.hand_over`."""
        await _in_thread(lambda: self.run.hand_over(to, timeout))

    async def link_for(self, rights: str = "watch", timeout: float = 60.0) -> str:
        """As `Run.link_for`."""
        return await _in_thread(lambda: self.run.link_for(rights, timeout))

    async def _send(self, send: Callable[[_native.Client], str], timeout: Optional[float] = None) -> str:
        """Take the wheel, and send then: one that was cancelled meanwhile sends nothing."""
        await self.drive(timeout)
        # Behind the last wait, on the loop: it only queues.
        return send(self.run._reader.client)

    async def _carry_out(self, parts: Parts[Result]) -> Result:
        return await _carry_out(self.run._reader, parts)

    async def _give(self, send: Callable[[_native.Client], str], task: str, timeout: Optional[float]) -> Command:
        begin = clock.monotonic()
        command = Command(self.run, await self._send(send, timeout), task)
        return await self._carry_out(command._wait(left(begin, timeout)))

    async def set(self, parameter: str, value: float, *, timeout: Optional[float] = None) -> Command:
        """As `Run.set`."""
        given = number(value, f"parameter {parameter!r}")
        return await self._give(lambda client: client.set(parameter, given), "set", timeout)

    async def pause(self, *, timeout: Optional[float] = None) -> Command:
        """As `Run.pause`."""
        return await self._give(lambda client: client.pause(), "pause", timeout)

    async def resume(self, *, timeout: Optional[float] = None) -> Command:
        """As `Run.resume`."""
        return await self._give(lambda client: client.resume(), "resume", timeout)

    async def stop(self, *, timeout: Optional[float] = None) -> Command:
        """As `Run.stop`."""
        return await self._give(lambda client: client.stop(), "stop", timeout)

    async def cancel(self, order: Union[Order, str], *, timeout: Optional[float] = None) -> Command:
        """As `Run.cancel`."""
        identity = order.id if isinstance(order, Order) else order
        return await self._give(lambda client: client.cancel(identity), "cancel", timeout)

    async def change_pipelines(self, change: Mapping[str, Any], *, timeout: Optional[float] = None) -> Command:
        """As `Run.change_pipelines`."""
        text = _json.text(change, "pipelines")
        return await self._give(lambda client: client.change_pipelines(text), "pipelines", timeout)

    async def drive(self, timeout: Optional[float] = None) -> None:
        """As `Run.drive`."""
        until = clock.monotonic() + (WHEEL if timeout is None else timeout)
        while not await _in_thread(lambda: self.run._ask_for_wheel(until, timeout is None)):
            pass

    async def surface(self) -> Surface:
        """As `Run.surface`."""
        return await _in_thread(lambda: self.run.surface)

    async def stack(self) -> list[dict[str, Any]]:
        """As `Run.stack`."""
        return await _in_thread(lambda: self.run.stack)

    async def pipelines(self) -> list[dict[str, Any]]:
        """As `Run.pipelines`."""
        return await _in_thread(lambda: self.run.pipelines)

    async def wait_for(self, found: Callable[[], Found], timeout: Optional[float] = None) -> Found:
        """As `Run.wait_for`; `found` is called on the loop."""
        return await _wait_for(self.run._reader, found, timeout)

    async def wait_for_cycle(self, cycle: int, timeout: Optional[float] = None) -> Status:
        """As `Run.wait_for_cycle`."""
        return await self._carry_out(self.run._wait_for_cycle(cycle, timeout))

    async def wait_for_view(self, name: str, *, after: Optional[int] = None, timeout: Optional[float] = None) -> View:
        """As `Run.wait_for_view`."""
        return await self._carry_out(self.run._wait_for_view(name, after, timeout))

    async def wait(self, timeout: Optional[float] = None) -> dict[str, Any]:
        """As `Run.wait`."""
        return await self._carry_out(self.run._wait_for_end(timeout))

    def events(self, *kinds: str) -> AsyncIterator[Event]:
        """As `Run.events`, for `async for`; the wait for one event may be cancelled."""
        check_kinds(kinds)
        return _Events(self.run, kinds)

    async def close(self) -> None:
        """As `Run.close`."""
        await _in_thread(self.run.close)
