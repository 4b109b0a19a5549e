"""A run for `async` programs."""

from __future__ import annotations

import asyncio
import contextlib
import os
import threading
import time as clock
from collections import deque
from collections.abc import AsyncIterator, Callable, Generator, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Optional, SupportsFloat, SupportsIndex, TypeVar, Union

from . import _json
from ._reader import NOT_FOUND, Reader, late
from ._values import number, seconds, whole
from ._waiting import Parts, Result, moment_after
from .errors import CallError
from .events import check_kinds
from .orders import Command, Edits, Forecast, Given, Order, id_of
from .run import WHEEL, Run, _text, left
from .run import connect as _connect

if TYPE_CHECKING:
    from . import _native
    from ._watched import Cycle
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


async def _wait_for(
    reader: Reader, found: Callable[[], Found], timeout: Optional[float], in_vain: str = NOT_FOUND
) -> Found:
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
                raise late(in_vain, timeout)
            timer = None if timeout is None else loop.call_later(left, told.set)
            try:
                await told.wait()
            finally:
                if timer is not None:
                    timer.cancel()


async def _carry_out(reader: Reader, parts: Parts[Result]) -> Result:
    """As `Reader.carry_out`, on a loop."""
    try:
        wanted = next(parts)
        while True:
            try:
                answer = await _wait_for(reader, *wanted)
            except Exception as error:
                wanted = parts.throw(error)
            else:
                wanted = parts.send(answer)
    except StopIteration as end:
        result: Result = end.value
        return result
    finally:
        # What was cancelled lets go of what it holds at once.
        parts.close()


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

    Raises
    ------
    LinkError, WaitError
        As of `tombolo.connect`, where it is awaited.

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
        # One that is being copied has no order yet, and is asked for Python's own names.
        if name == "order" or name.startswith("__"):
            raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")
        return getattr(self.order, name)

    async def wait(self, timeout: Optional[float] = None, *, until: str = "applied") -> Order:
        """Wait until the solver has been given the order's last shape, as `Order.wait` does.

        An order that another one, or an undo, goes on from is `applied` then too: see `Order.wait`.

        Parameters and Raises are as of `Order.wait`.

        Returns
        -------
        Order
            The order itself: `order`.
        """
        return await _carry_out(self.order._run._reader, self.order._wait(timeout, until))

    async def cancel(self, *, timeout: Optional[float] = None) -> Command:
        """Take the order back, where it has not begun to move the mesh, and wait until that is done.

        Parameters and Raises are as of `Run.cancel`, without `wait`.

        Returns
        -------
        Command
            The command, which has taken effect.
        """
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
            # It is taken after the wait: of one that was cancelled the event would be lost.
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
        replaces: Optional[Given] = None,
        deadline: Optional[SupportsIndex] = None,
    ) -> AsyncOrder:
        """Give an order of a new shape, as `Run.order` does.

        A call that is cancelled while it waits for the wheel gives none.

        Parameters and Raises are as of `Run.order`.

        Returns
        -------
        AsyncOrder
            The order, which has been sent.
        """
        prepared = await self._prepared(
            edits, schedule=schedule, deform=deform, guard=guard, replaces=replaces, deadline=deadline
        )
        return AsyncOrder(Order(self.run, await self._send(lambda client: client.order(prepared))))

    async def _prepared(self, edits: Edits, **settings: Any) -> _native.Prepared:
        return await _in_thread(lambda: self.run._prepared(_text(edits, **settings)))

    async def undo(self, count: SupportsIndex = 1) -> AsyncOrder:
        """Take the last orders back, as `Run.undo` does.

        Parameters and Raises are as of `Run.undo`.

        Returns
        -------
        AsyncOrder
            The order that takes them back, which has been sent.
        """
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
        """Ask what an order would come to, were it given now, as `Run.forecast` does; nothing changes.

        Parameters and Raises are as of `Run.forecast`.

        Returns
        -------
        Forecast
            What the order would come to.
        """
        seconds(timeout)
        prepared = await self._prepared(edits, schedule=schedule, deform=deform, guard=guard)
        await self.drive(timeout)
        return await self._carry_out(self.run._foretold(prepared, timeout))

    async def hand_over(self, to: str, timeout: float = 60.0) -> None:
        """Give the wheel to another client, as `Run.hand_over` does; it is there when this returns.

        Parameters and Raises are as of `Run.hand_over`.
        """
        await _in_thread(lambda: self.run.hand_over(to, timeout))

    async def link_for(self, rights: str = "watch", timeout: float = 60.0) -> str:
        """Make a link for somebody else, as `Run.link_for` does. It opens one browser, once.

        Parameters and Raises are as of `Run.link_for`.

        Returns
        -------
        str
            The address: that of this run's own link, with a key in place of its token.
        """
        return await _in_thread(lambda: self.run.link_for(rights, timeout))

    async def _send(self, send: Callable[[_native.Client], str], timeout: Optional[float] = None) -> str:
        """Take the wheel, and send then: one that was cancelled meanwhile sends nothing."""
        await self.drive(timeout)
        # After the last wait, on the loop: it only queues.
        return send(self.run._reader.client)

    async def _carry_out(self, parts: Parts[Result]) -> Result:
        return await _carry_out(self.run._reader, parts)

    async def _give(self, send: Callable[[_native.Client], str], task: str, timeout: Optional[float]) -> Command:
        begin = clock.monotonic()
        command = Command(self.run, await self._send(send, timeout), task)
        return await self._carry_out(command._wait(left(begin, timeout), timeout))

    async def set(self, parameter: str, value: SupportsFloat, *, timeout: Optional[float] = None) -> Command:
        """Give a parameter of the solver a new value, as `Run.set` does, and wait until the solver has it.

        Parameters and Raises are as of `Run.set`, without `wait`.

        Returns
        -------
        Command
            The command, which has taken effect.
        """
        given = number(value, f"parameter {parameter!r}")
        return await self._give(lambda client: client.set(parameter, given), "set", timeout)

    async def pause(self, *, timeout: Optional[float] = None) -> Command:
        """Hold the solver at its next safe point, and wait until it is held.

        Parameters and Raises are as of `Run.pause`, without `wait`.

        Returns
        -------
        Command
            The command, which has taken effect.
        """
        return await self._give(lambda client: client.pause(), "pause", timeout)

    async def resume(self, *, timeout: Optional[float] = None) -> Command:
        """Let the solver go on, and wait until it does.

        Parameters and Raises are as of `Run.resume`, without `wait`.

        Returns
        -------
        Command
            The command, which has taken effect.
        """
        return await self._give(lambda client: client.resume(), "resume", timeout)

    async def stop(self, *, timeout: Optional[float] = None) -> Command:
        """Ask the solver to end, and wait until it was told so.

        A run that ends before it has answered is no error.

        Parameters and Raises are as of `Run.stop`, without `wait`.

        Returns
        -------
        Command
            The command, which has taken effect.
        """
        return await self._give(lambda client: client.stop(), "stop", timeout)

    async def cancel(self, order: Given, *, timeout: Optional[float] = None) -> Command:
        """Take back an order that has not begun to move the mesh, as `Run.cancel` does, and wait until that is done.

        Parameters and Raises are as of `Run.cancel`, without `wait`.

        Returns
        -------
        Command
            The command, which has taken effect.
        """
        identity = id_of(order, "order")
        return await self._give(lambda client: client.cancel(identity), "cancel", timeout)

    async def change_pipelines(self, change: Mapping[str, Any], *, timeout: Optional[float] = None) -> Command:
        """Change the pipelines while the run goes on, as `Run.change_pipelines` does, and wait until it is done.

        Parameters and Raises are as of `Run.change_pipelines`, without `wait`.

        Returns
        -------
        Command
            The command, which has taken effect.
        """
        text = _json.text(change, "pipelines")
        return await self._give(lambda client: client.change_pipelines(text), "pipelines", timeout)

    async def drive(self, timeout: Optional[float] = None) -> None:
        """Take the wheel, as `Run.drive` does: what every command does first.

        Parameters and Raises are as of `Run.drive`.
        """
        until = moment_after(WHEEL if timeout is None else timeout)
        while not await _in_thread(lambda: self.run._ask_for_wheel(until, timeout is None)):
            pass

    async def surface(self) -> Surface:
        """Ask for the reference surface, from which all shapes are measured: what `Run.surface` is.

        Raises are as of `Run.surface`.

        Returns
        -------
        Surface
            The surface. Its points are in the unit of length of the mesh.
        """
        return await _in_thread(lambda: self.run.surface)

    async def stack(self) -> list[dict[str, Any]]:
        """Ask for the edits that make the present shape: what `Run.stack` is.

        Raises are as of `Run.stack`.

        Returns
        -------
        list of dict
            The edits, the oldest first. Lengths are in the unit of length of the mesh, angles in degrees.
        """
        return await _in_thread(lambda: self.run.stack)

    async def pipelines(self) -> list[dict[str, Any]]:
        """Ask for the pipelines as they are now: what `Run.pipelines` is.

        Raises are as of `Run.pipelines`.

        Returns
        -------
        list of dict
            The pipelines, as the configuration has them.
        """
        return await _in_thread(lambda: self.run.pipelines)

    async def wait_for(self, found: Callable[[], Found], timeout: Optional[float] = None) -> Found:
        """Wait until `found`, which is called on the loop, returns something true, as `Run.wait_for` does.

        Parameters and Raises are as of `Run.wait_for`.

        Returns
        -------
        object
            What `found` has returned.
        """
        return await _wait_for(self.run._reader, found, timeout)

    async def wait_for_cycle(self, cycle: Cycle, timeout: Optional[float] = None) -> Status:
        """Wait until the solver has told a step from `cycle` on, and return its status.

        Parameters and Raises are as of `Run.wait_for_cycle`.

        Returns
        -------
        Status
            The newest status, which may be of a later step.
        """
        return await self._carry_out(self.run._wait_for_cycle(cycle, timeout))

    async def wait_for_view(self, name: str, *, after: Optional[Cycle] = None, timeout: Optional[float] = None) -> View:
        """Wait for a frame of a view, and return it, as `Run.wait_for_view` does.

        Parameters and Raises are as of `Run.wait_for_view`.

        Returns
        -------
        View
            The newest frame of the view.
        """
        return await self._carry_out(self.run._wait_for_view(name, after, timeout))

    async def wait(self, timeout: Optional[float] = None) -> dict[str, Any]:
        """Wait until the run has ended, and return how.

        Parameters and Raises are as of `Run.wait`.

        Returns
        -------
        dict
            What `Run.end` is. `how` is `unknown`, and alone, where the run has gone without a word.
        """
        return await self._carry_out(self.run._wait_for_end(timeout))

    def events(self, *kinds: str) -> AsyncIterator[Event]:
        """Iterate over what the run tells from now on by `async for`; the wait for one event may be cancelled.

        `asyncio.wait_for` gives such a wait a time limit.

        Parameters
        ----------
        *kinds : str
            Only events of these kinds, which `Event` lists; without any, all.

        Returns
        -------
        AsyncIterator of Event
            Each event, in the order in which they came, until the run ends. Of more than 4096 that wait the oldest make
            way.

        Raises
        ------
        ConfigurationError
            There are no events of such a kind.
        CallError
            The run was closed.
        """
        check_kinds(kinds)
        return _Events(self.run, kinds)

    async def close(self) -> None:
        """Close the connection, without holding the loop up. The run goes on."""
        await _in_thread(self.run.close)
