"""A run that goes on elsewhere: watched, and steered."""

from __future__ import annotations

import atexit
import os
import time as clock
import weakref
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Optional, TypeVar, Union

from . import _json, _native
from ._reader import Reader
from ._waiting import in_thread
from .errors import EndedError, LinkError, NotDriverError, RejectedError, WaitError
from .events import Callbacks, Event, iterate
from .monitors import Monitors
from .orders import Command, Edits, Forecast, Order
from .state import Parameter, State, Status
from .views import Surface, View

if TYPE_CHECKING:
    from .aio import AsyncRun
    from .jupyter import Plot

__all__ = ["Run", "connect"]

Found = TypeVar("Found")

#: How long the wheel is asked for: longer than a server keeps it for a driver that was lost.
_WHEEL = 8.0
#: How long it is asked for at once.
_SLICE = 0.2
#: How links begin.
_SCHEMES = ("http://", "https://", "unix:")
#: How long a view that nobody knows may take to be announced, in seconds.
_ANNOUNCED = 2.0

_RUNS: weakref.WeakSet[Run] = weakref.WeakSet()


class Run:
    """A run that goes on elsewhere, as `connect` returns it.

    A thread of its own reads what the run tells, so that `status`, `views` and `monitors` are always the newest. A
    connection that is lost is made again with growing pauses. Any thread may use it. Every wait ends with Ctrl-C. It
    closes with `close`, at the end of a `with` block, or with the interpreter; the run itself goes on.

    Attributes
    ----------
    link : str
        The link that it was connected by: whoever has it can do what it is for.
    views : mapping of str to View
        The newest frame of each live view that has come.
    monitors : Monitors
        For each pipeline that has monitors a table that grows.
    """

    def __init__(self, link: str, *, watch: bool, views: bool, attempts: int) -> None:
        self.link = link
        self._watch = watch
        self._state = State()
        self._reader = Reader(in_thread(lambda: _native.Client(link, views, watch, attempts)), self._state)
        self._callbacks = Callbacks(self._reader)
        _RUNS.add(self)
        try:
            self.wait_for(lambda: bool(self._state.hello), 20.0)
        except BaseException:
            self.close()
            raise

    # ---- What is known.

    @property
    def status(self) -> Status:
        """How far the solver is, as it was last told; waits for the first status."""
        if self._state.status is None:
            self.wait_for(lambda: self._state.status is not None, 20.0)
        status = self._state.status
        assert status is not None
        return status

    @property
    def monitors(self) -> Monitors:
        """For each pipeline that has monitors a table that grows."""
        return self._state.monitors

    @property
    def views(self) -> Mapping[str, View]:
        """The newest frame of each live view that has come."""
        return MappingProxyType(self._state.views)

    @property
    def hello(self) -> Mapping[str, Any]:
        """What there is in the run, as docs/protocol.md says it; the newest that was told."""
        return MappingProxyType(self._state.hello)

    @property
    def view_names(self) -> list[str]:
        """The names of the live views."""
        return [view["name"] for view in self._state.hello.get("views", [])]

    @property
    def features(self) -> list[dict[str, Any]]:
        """The named parts of the surface, each with `name`, `faces`, `vertices` and `bounds`."""
        return list(self._state.hello.get("features", []))

    @property
    def fields(self) -> list[dict[str, Any]]:
        """The fields of the steered channel, each with `name`, `association` and `components`."""
        return list(self._state.hello.get("fields", []))

    @property
    def parameters(self) -> dict[str, Parameter]:
        """The numbers of the solver that can be steered."""
        told = self._state.hello.get("parameters", [])
        return {it["name"]: Parameter(it["value"], it["minimum"], it["maximum"]) for it in told}

    @property
    def stack(self) -> list[dict[str, Any]]:
        """The edits that make the present shape, the oldest first, as the run answers now."""
        edits: list[dict[str, Any]] = _json.loads(in_thread(self._reader.client.stack))
        return edits

    @property
    def edit_count(self) -> int:
        """How many edits make the present shape, as it was last told: without a wait, unlike `stack`."""
        return int(self._state.stack.get("edits", 0))

    @property
    def orders(self) -> list[Order]:
        """The orders so far, the oldest first."""
        with self._reader.changed:
            return [Order(self, identity) for identity in self._state.orders]

    @property
    def drives(self) -> bool:
        """Whether this client steers."""
        return self._reader.drives

    @property
    def end(self) -> Optional[dict[str, Any]]:
        """How the run has ended, where it has: `how` (`finished`, `stopped` or `failed`), `cycle` and `time`."""
        return self._state.end

    @property
    def connected(self) -> bool:
        """Whether anything can still come: the run has not ended, and the connection is not given up."""
        return self._reader.failure is None and not self._reader.closed

    @property
    def missed(self) -> int:
        """How many events made way for newer ones before they were read."""
        return self._reader.missed

    @property
    def surface(self) -> Surface:
        """The reference surface, from which all shapes are measured.

        Raises
        ------
        LinkError
            Where there is no mesh whose shape could be changed, or not yet.
        """
        return Surface(**in_thread(self._reader.client.surface))

    @property
    def pipelines(self) -> list[dict[str, Any]]:
        """The pipelines as they are now."""
        pipelines: list[dict[str, Any]] = _json.loads(in_thread(self._reader.client.pipelines))
        return pipelines

    # ---- Waiting.

    def wait_for(self, found: Callable[[], Found], timeout: Optional[float] = None) -> Found:
        """Wait until `found` returns something true, and return that.

        It is called again whenever the run has told something. Ctrl-C ends the wait.

        Parameters
        ----------
        found : callable
            Looks at what is known, such as ``lambda: run.status.cycle > 100``. It must not wait itself.
        timeout : float, optional
            Seconds, at most; without it there is no limit.

        Raises
        ------
        WaitError
            It did not come in time.
        EndedError, LinkError
            It did not come before the run has ended, or the connection was lost for good.

        Examples
        --------
        Waits until a monitor has settled within a hundredth over its last 50 rows::

            table = run.monitors["outlet"]
            def settled():
                flow = table["flow"][-50:]
                return len(flow) == 50 and np.ptp(flow) < 0.01 * abs(flow.mean())
            run.wait_for(settled)
        """
        return self._reader.wait_for(found, timeout)

    def wait_for_cycle(self, cycle: int, timeout: Optional[float] = None) -> Status:
        """Wait until the solver has told a step from `cycle` on, and return its status."""

        def found() -> Optional[Status]:
            return self._state.status if self._state.status is not None and self._state.status.cycle >= cycle else None

        status = self.wait_for(found, timeout)
        assert status is not None
        return status

    def wait_for_view(self, name: str, *, after: Optional[int] = None, timeout: Optional[float] = None) -> View:
        """Wait for a frame of a view, of a step after the cycle `after` where that is given, and return it."""

        def found() -> Optional[View]:
            view = self._state.views.get(name)
            return view if view is not None and (after is None or view.cycle > after) else None

        self._announced(name, timeout)
        view = self.wait_for(found, timeout)
        assert view is not None
        return view

    def _announced(self, name: str, timeout: Optional[float] = None) -> None:
        """An error where there is no view of a name, nor comes to be one."""
        if not self.view_names or name in self.view_names:
            return
        # A view that was added a moment ago is announced a moment later.
        try:
            self.wait_for(lambda: name in self.view_names, _ANNOUNCED if timeout is None else min(_ANNOUNCED, timeout))
        except WaitError:
            raise KeyError(f"no view '{name}'; there are: {', '.join(self.view_names)}") from None

    def wait(self, timeout: Optional[float] = None) -> dict[str, Any]:
        """Wait until the run has ended, and return how."""
        try:
            end = self.wait_for(lambda: self._state.end, timeout)
        except EndedError:
            end = self._state.end
        return end or {"how": "unknown"}

    # ---- Events.

    def events(self, *kinds: str, timeout: Optional[float] = None) -> Iterator[Event]:
        """Iterate over what the run tells from now on, until it ends.

        Parameters
        ----------
        *kinds : str
            Only events of these kinds; without any, all.
        timeout : float, optional
            Seconds to wait for each, at most.

        Yields
        ------
        Event
            Each event, in the order in which they came. Of more than 4096 that wait the oldest make way.

        Raises
        ------
        WaitError
            None came in time.
        """
        return iterate(self._reader, self._reader.listen(), kinds, timeout)

    def on(self, kind: Optional[str], callback: Callable[[Event], object]) -> Callable[[], None]:
        """Have a function called with each event of a kind, or with every one where `kind` is None.

        It is called on a thread of its own, one event at a time, and may wait and give orders. What it raises is
        printed, and it is called again.

        Returns
        -------
        callable
            Call it to have the function called no more.
        """
        return self._callbacks.add(kind, callback)

    # ---- Steering.

    def drive(self, timeout: float = _WHEEL) -> None:
        """Take the wheel: what every command does first.

        Raises
        ------
        NotDriverError
            Somebody else steers, or this client may only watch.
        """
        self._reader.check()
        if self._watch:
            raise NotDriverError("this client only watches: it was connected with watch=True")
        until = clock.monotonic() + timeout
        while not self.drives:
            try:
                in_thread(lambda: self._reader.client.drive(_SLICE))
            except NotDriverError:
                taken = self._state.status is not None and self._state.status.driver is not None
                if taken or clock.monotonic() >= until:
                    raise

    def order(
        self,
        edits: Edits,
        *,
        schedule: Optional[Mapping[str, Any]] = None,
        deform: Optional[Mapping[str, Any]] = None,
        guard: Optional[Mapping[str, Any]] = None,
        replaces: Union[Order, str, None] = None,
    ) -> Order:
        """Give an order of a new shape; it is on its way when this returns, and `Order.wait` waits for it.

        Parameters
        ----------
        edits : list of dict, dict or path
            The edits, or a whole order (`edits`, `stack` or `undo`, with its settings), or a JSON file of either.
            Arrays of NumPy may stand in for lists of numbers.
        schedule, deform, guard : dict, optional
            In how many steps the shape is reached; how the volume follows; what the mesh must keep to. Left out: what
            the run's configuration says.
        replaces : Order or str, optional
            An order that has not begun to move the mesh, whose place this one takes; that one is rejected.

        Raises
        ------
        ConfigurationError
            Something is wrong with it: the text has line, column, path and the nearest known name.
        NotDriverError
            Somebody else steers.

        Examples
        --------
        ::

            order = run.order([{"translate": {"features": ["throat"], "fixed": ["inlet"], "by": [0, 0, 0.1]}}],
                              schedule={"steps": 10})
            order.wait()
        """
        other = replaces.id if isinstance(replaces, Order) else replaces
        settings = {"schedule": schedule, "deform": deform, "guard": guard, "replaces": other}
        text, name = _json.order(edits, settings)
        self.drive()
        return Order(self, in_thread(lambda: self._reader.client.order(text, name)))

    def forecast(
        self,
        edits: Edits,
        *,
        schedule: Optional[Mapping[str, Any]] = None,
        deform: Optional[Mapping[str, Any]] = None,
        guard: Optional[Mapping[str, Any]] = None,
        timeout: Optional[float] = None,
    ) -> Forecast:
        """Ask what an order would come to, were it given now; nothing changes. The parameters are those of `order`."""
        text, name = _json.order(edits, {"schedule": schedule, "deform": deform, "guard": guard})
        self.drive()
        question = in_thread(lambda: self._reader.client.forecast(text, name))
        kind, data = self.wait_for(lambda: self._state.answers.get(question), timeout) or ("", {})
        if kind == "error":
            raise RejectedError(data["message"])
        return Forecast(data["order"])

    def undo(self, count: int = 1) -> Order:
        """Take the last orders back; returns the order that does so."""
        self.drive()
        return Order(self, self._reader.client.undo(count))

    def cancel(self, order: Union[Order, str], *, wait: bool = True, timeout: Optional[float] = None) -> Command:
        """Take back an order that has not begun to move the mesh: it is rejected then."""
        identity = order.id if isinstance(order, Order) else order
        return self._give(lambda: self._reader.client.cancel(identity), "cancel", wait, timeout)

    def set(self, parameter: str, value: float, *, wait: bool = True, timeout: Optional[float] = None) -> Command:
        """Give a parameter of the solver a new value, within its bounds.

        Parameters
        ----------
        parameter : str
            Its name.
        value : float
            Its new value.
        wait : bool
            Whether to wait until the solver has it.
        timeout : float, optional
            Seconds to wait, at most.
        """
        return self._give(lambda: self._reader.client.set(parameter, float(value)), "set", wait, timeout)

    def pause(self, *, wait: bool = True, timeout: Optional[float] = None) -> Command:
        """Hold the solver at its next safe point."""
        return self._give(self._reader.client.pause, "pause", wait, timeout)

    def resume(self, *, wait: bool = True, timeout: Optional[float] = None) -> Command:
        """Let the solver go on."""
        return self._give(self._reader.client.resume, "resume", wait, timeout)

    def stop(self, *, wait: bool = True, timeout: Optional[float] = None) -> Command:
        """Ask the solver to end."""
        return self._give(self._reader.client.stop, "stop", wait, timeout)

    def change_pipelines(
        self, change: Mapping[str, Any], *, wait: bool = True, timeout: Optional[float] = None
    ) -> Command:
        """Change the pipelines while the run goes on.

        Parameters
        ----------
        change : dict
            ``{"set": [...]}`` adds or replaces, ``{"remove": [...]}`` takes names, ``{"all": [...]}`` replaces all.
        wait : bool
            Whether to wait until the change is made.
        timeout : float, optional
            Seconds to wait, at most.
        """
        text = _json.text(change, "pipelines")
        return self._give(lambda: self._reader.client.change_pipelines(text), "pipelines", wait, timeout)

    def _give(self, give: Callable[[], str], task: str, wait: bool, timeout: Optional[float]) -> Command:
        self.drive()
        command = Command(self, give(), task)
        return command.wait(timeout) if wait else command

    # ---- Elsewhere.

    def link_for(self, rights: str = "watch", timeout: float = 60.0) -> str:
        """Make a link for somebody else. It opens one browser, once.

        Parameters
        ----------
        rights : {"watch", "drive"}
            Whether that browser only watches, or may be the one that steers. The second is given only to a client that
            may steer itself.
        timeout : float
            Seconds to wait, at most.

        Returns
        -------
        str
            The address: that of this run's own link, with a key in place of its token.

        Raises
        ------
        RejectedError
            This client may not give such a link.
        """
        return in_thread(lambda: self._reader.client.link_for(rights, timeout))

    @property
    def aio(self) -> AsyncRun:
        """The same for `await`: every method that waits, as a coroutine."""
        from .aio import AsyncRun

        return AsyncRun(self)

    def close(self) -> None:
        """Close the connection. The run goes on."""
        self._reader.close()

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def plot(self, pipeline: str, monitor: str) -> Plot:
        """A monitor as a picture that a notebook shows; `Plot.live` has it grow while the run goes on."""
        from .jupyter import Plot

        return Plot(self, pipeline, monitor)

    def _repr_html_(self) -> str:
        from .jupyter import viewer

        return viewer(self.link)

    def __repr__(self) -> str:
        # The link has a secret in it.
        place = self.link.split("?")[0]
        if self._state.end is not None:
            return f"<tombolo.Run {place}, {self._state.end['how']} at cycle {self._state.end['cycle']}>"
        cycle = "no step told yet" if self._state.status is None else f"cycle {self._state.status.cycle}"
        return f"<tombolo.Run {place}, {cycle}{', driving' if self.drives else ''}>"


@atexit.register
def _close_all() -> None:
    # A thread that reads must not outlive the interpreter.
    for run in list(_RUNS):
        run.close()


def connect(link: Union[str, os.PathLike[str]], *, watch: bool = False, views: bool = True, attempts: int = 10) -> Run:
    """Connect to a run.

    Parameters
    ----------
    link : str or path
        The link that the run has printed, or the file ``tombolo-PORT.link`` that holds it.
    watch : bool
        Whether to only watch: never to have the wheel.
    views : bool
        Whether the frames of the live views are wanted.
    attempts : int
        How often a connection that is lost is tried to be made again, with growing pauses: 10 take about a minute.

    Returns
    -------
    Run
        The run. It steers from the first command on.

    Raises
    ------
    LinkError
        The run is not reached: the text says why.

    Examples
    --------
    ::

        with tombolo.connect("http://127.0.0.1:7070/?token=...") as run:
            print(run.status.cycle, run.monitors["health"].last)
            run.order([{"translate": {"features": ["throat"], "fixed": ["inlet"], "by": [0, 0, 0.1]}}]).wait()
    """
    text = os.fspath(link)
    if "://" not in text and not text.startswith("unix:") and os.path.isfile(text):
        try:
            with open(text, encoding="utf-8") as file:
                words = file.read(1 << 16).split()
        except (OSError, UnicodeDecodeError) as error:
            raise LinkError(f"{text}: the file cannot be read ({error})") from None
        links = [word for word in words if word.startswith(_SCHEMES)]
        if not links:
            raise LinkError(f"{text}: found a file without a link, expected http://HOST:PORT/?token=TOKEN in it")
        text = links[0]
    return Run(text, watch=watch, views=views, attempts=attempts)
