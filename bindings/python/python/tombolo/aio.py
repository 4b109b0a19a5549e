"""A run for `async` programs."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Callable, Mapping
from typing import TYPE_CHECKING, Any, Optional, TypeVar, Union

from .errors import CallError, WaitError
from .orders import Command, Edits, Forecast, Order

if TYPE_CHECKING:
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
    """An order whose `wait` is a coroutine; it has what an `Order` has.

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

    def __repr__(self) -> str:
        return repr(self.order)


class AsyncRun:
    """A `Run` whose methods that wait are coroutines: `run.aio`. What is only looked at is read from the run itself.

    Attributes
    ----------
    run : Run
        The run.

    Examples
    --------
    ::

        async def squeeze(run):
            order = await run.aio.order(edits)
            await order.wait()
            async for event in run.aio.events("monitor"):
                print(event.data["values"])
    """

    def __init__(self, run: Run) -> None:
        self.run = run

    async def order(self, edits: Edits, **settings: Any) -> AsyncOrder:
        """As `Run.order`."""
        return AsyncOrder(await asyncio.to_thread(lambda: self.run.order(edits, **settings)))

    async def undo(self, count: int = 1) -> AsyncOrder:
        """As `Run.undo`."""
        return AsyncOrder(await asyncio.to_thread(self.run.undo, count))

    async def forecast(self, edits: Edits, *, timeout: Optional[float] = None, **settings: Any) -> Forecast:
        """As `Run.forecast`."""
        return await asyncio.to_thread(lambda: self.run.forecast(edits, timeout=timeout, **settings))

    async def link_for(self, rights: str = "watch", timeout: float = 60.0) -> str:
        """As `Run.link_for`."""
        return await asyncio.to_thread(lambda: self.run.link_for(rights, timeout))

    async def _give(self, give: Callable[[], Command], timeout: Optional[float]) -> Command:
        command = await asyncio.to_thread(give)
        return await _in_slices(command.wait, timeout)

    async def set(self, parameter: str, value: float, *, timeout: Optional[float] = None) -> Command:
        """As `Run.set`."""
        return await self._give(lambda: self.run.set(parameter, value, wait=False), timeout)

    async def pause(self, *, timeout: Optional[float] = None) -> Command:
        """As `Run.pause`."""
        return await self._give(lambda: self.run.pause(wait=False), timeout)

    async def resume(self, *, timeout: Optional[float] = None) -> Command:
        """As `Run.resume`."""
        return await self._give(lambda: self.run.resume(wait=False), timeout)

    async def stop(self, *, timeout: Optional[float] = None) -> Command:
        """As `Run.stop`."""
        return await self._give(lambda: self.run.stop(wait=False), timeout)

    async def cancel(self, order: Union[Order, str], *, timeout: Optional[float] = None) -> Command:
        """As `Run.cancel`."""
        return await self._give(lambda: self.run.cancel(order, wait=False), timeout)

    async def change_pipelines(self, change: Mapping[str, Any], *, timeout: Optional[float] = None) -> Command:
        """As `Run.change_pipelines`."""
        return await self._give(lambda: self.run.change_pipelines(change, wait=False), timeout)

    async def drive(self, timeout: float = 8.0) -> None:
        """As `Run.drive`."""
        await asyncio.to_thread(self.run.drive, timeout)

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
        """As `Run.events`, for `async for`."""
        return self._events(self.run._reader.listen(), kinds)

    async def _events(self, waiting: deque[Event], kinds: tuple[str, ...]) -> AsyncIterator[Event]:
        while True:
            try:
                event = await _in_slices(lambda left: self.run._reader.next(waiting, left), None)
            except CallError:
                return
            if not kinds or event.kind in kinds:
                yield event
            if event.kind == "ended":
                return

    async def close(self) -> None:
        """As `Run.close`."""
        await asyncio.to_thread(self.run.close)
