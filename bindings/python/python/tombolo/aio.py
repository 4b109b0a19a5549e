"""A run for `async` programs."""

from __future__ import annotations

import asyncio
import time as clock
from collections import deque
from collections.abc import AsyncIterator, Callable, Mapping
from typing import TYPE_CHECKING, Any, Optional, TypeVar, Union

from . import _json
from ._values import number, whole
from .errors import CallError, WaitError
from .events import check_kinds
from .orders import Command, Edits, Forecast, Order
from .run import _text

if TYPE_CHECKING:
    from . import _native
    from .events import Event
    from .run import Run
    from .state import Status
    from .views import Surface, View

__all__ = ["AsyncOrder", "AsyncRun"]

Found = TypeVar("Found")

#: How long a thread waits at once, in seconds: so long a task that was cancelled keeps one.
_SLICE = 0.5


async def _in_slices(wait: Callable[[float], Found], timeout: Optional[float]) -> Found:
    """A wait in a thread, in pieces, so that none goes on long after its task was cancelled."""
    loop = asyncio.get_running_loop()
    until = None if timeout is None else loop.time() + timeout
    while True:
        left = _SLICE if until is None else min(_SLICE, max(until - loop.time(), 0.0))
        try:
            return await asyncio.to_thread(wait, left)
        except WaitError as error:
            if until is not None and loop.time() >= until:
                raise WaitError(f"it did not come within {timeout} seconds") from error


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
        return await _in_slices(lambda left: self.order.wait(left, until=until), timeout)

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
            # The thread only waits: of one that was cancelled the event would be lost.
            try:
                await _in_slices(lambda left: self._reader.wait_for(lambda: len(self._waiting) > 0, left), None)
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
        text, name = await asyncio.to_thread(
            lambda: _text(edits, schedule=schedule, deform=deform, guard=guard, replaces=replaces, deadline=deadline)
        )
        return AsyncOrder(Order(self.run, await self._send(lambda client: client.order(text, name))))

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
        text, name = await asyncio.to_thread(lambda: _text(edits, schedule=schedule, deform=deform, guard=guard))
        question = await self._send(lambda client: client.forecast(text, name))
        return await _in_slices(lambda left: self.run._foretold(question, left), timeout)

    async def link_for(self, rights: str = "watch", timeout: float = 60.0) -> str:
        """As `Run.link_for`."""
        return await asyncio.to_thread(lambda: self.run.link_for(rights, timeout))

    async def _send(self, send: Callable[[_native.Client], str]) -> str:
        """Take the wheel, and send then: one that was cancelled meanwhile sends nothing."""
        await self.drive()
        return await asyncio.to_thread(lambda: send(self.run._reader.client))

    async def _give(self, send: Callable[[_native.Client], str], task: str, timeout: Optional[float]) -> Command:
        command = Command(self.run, await self._send(send), task)
        return await _in_slices(command.wait, timeout)

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

    async def drive(self, timeout: float = 8.0) -> None:
        """As `Run.drive`."""
        until = clock.monotonic() + timeout
        while not await asyncio.to_thread(self.run._ask_for_wheel, until):
            pass

    async def surface(self) -> Surface:
        """As `Run.surface`."""
        return await asyncio.to_thread(lambda: self.run.surface)

    async def stack(self) -> list[dict[str, Any]]:
        """As `Run.stack`."""
        return await asyncio.to_thread(lambda: self.run.stack)

    async def pipelines(self) -> list[dict[str, Any]]:
        """As `Run.pipelines`."""
        return await asyncio.to_thread(lambda: self.run.pipelines)

    async def wait_for(self, found: Callable[[], Found], timeout: Optional[float] = None) -> Found:
        """As `Run.wait_for`; `found` is called on another thread."""
        return await _in_slices(lambda left: self.run.wait_for(found, left), timeout)

    async def wait_for_cycle(self, cycle: int, timeout: Optional[float] = None) -> Status:
        """As `Run.wait_for_cycle`."""
        return await _in_slices(lambda left: self.run.wait_for_cycle(cycle, left), timeout)

    async def wait_for_view(self, name: str, *, after: Optional[int] = None, timeout: Optional[float] = None) -> View:
        """As `Run.wait_for_view`."""
        await asyncio.to_thread(self.run._announced, name, timeout)
        return await _in_slices(lambda left: self.run.wait_for_view(name, after=after, timeout=left), timeout)

    async def wait(self, timeout: Optional[float] = None) -> dict[str, Any]:
        """As `Run.wait`."""
        return await _in_slices(self.run.wait, timeout)

    def events(self, *kinds: str) -> AsyncIterator[Event]:
        """As `Run.events`, for `async for`; the wait for one event may be cancelled."""
        check_kinds(kinds)
        return _Events(self.run, kinds)

    async def close(self) -> None:
        """As `Run.close`."""
        await asyncio.to_thread(self.run.close)
