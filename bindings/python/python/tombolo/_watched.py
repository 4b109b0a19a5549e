"""What is known of a run that goes on elsewhere, the waits for it, and its events."""

from __future__ import annotations

import weakref
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any, Optional, SupportsIndex, TypeVar, Union

from . import _json, _native
from ._names import unknown
from ._reader import Reader
from ._values import number, seconds
from ._waiting import Parts, in_thread
from .errors import CallError, EndedError, LinkError, WaitError
from .events import Callbacks, Event, check_kinds, iterate
from .monitors import Monitors
from .state import Parameter, State, Status
from .views import NOT_WANTED, Surface, View, Views, not_chosen

Found = TypeVar("Found")
#: A step, also as a table of monitors has it.
Cycle = Union[SupportsIndex, float]

#: How long what a run tells first may take to come, in seconds.
_FIRST = 20.0
#: How long a view that nobody knows may take to be announced, in seconds.
_ANNOUNCED = 2.0


class Watched:
    """What a client does that only watches; a `Run` steers too."""

    def __init__(self, link: str, *, watch: bool, views: bool, attempts: int, timeout: Optional[float]) -> None:
        self.link = link
        self._watch = watch
        self._has_views = views
        # The names of the views that are looked at; None for all.
        self._chosen: Optional[frozenset[str]] = None
        self._state = State()
        client = in_thread(lambda: _native.Client(link, views, watch, attempts, timeout))
        self._reader = Reader(client, self._state)
        self._callbacks = Callbacks(self._reader)
        # The thread that reads holds the reader: without this a run that nobody has any more would keep the wheel.
        weakref.finalize(self, self._reader.abandon).atexit = False
        try:
            self._reader.wait_for(lambda: bool(self._state.hello), _FIRST, "nothing was told of the run")
        except BaseException:
            self.close()
            raise

    # ---- What is known.

    @property
    def status(self) -> Status:
        """How far the solver is, as it was last told. Before the first status it waits for it, 20 seconds at most.

        Raises
        ------
        WaitError
            The solver has not told any step in that time.
        EndedError, LinkError
            The run has ended before its first step, or the connection was lost for good.
        """
        status = self._state.status
        if status is None:
            status = self._reader.wait_for(lambda: self._state.status, _FIRST, "no status of the solver came")
        assert status is not None
        return status

    @property
    def monitors(self) -> Monitors:
        """For each pipeline that has monitors a table that grows."""
        return self._state.monitors

    @property
    def views(self) -> Mapping[str, View]:
        """The newest frame of each live view that has come; none of a view that was removed."""
        return Views(self._state.views, lambda: self.view_names, lambda: self._chosen, self._has_views)

    @property
    def chosen_views(self) -> Optional[frozenset[str]]:
        """The names of the live views whose frames come; None for all."""
        return self._chosen if self._has_views else frozenset()

    def choose_views(self, names: Optional[Iterable[str]] = None) -> None:
        """Choose the live views whose frames come; all of them come at first.

        A view at which nobody looks rests: it costs the solver nothing.

        Parameters
        ----------
        names : iterable of str, optional
            Their names; none of them for an empty list, all of them for None.

        Raises
        ------
        KeyError
            There is no such view.
        TypeError
            They are a text, which would be taken for a list of letters.
        CallError
            No frames come at all: the run was connected with ``views=False``.
        """
        if not self._has_views:
            raise CallError(NOT_WANTED)
        if isinstance(names, str):
            raise TypeError(f"names: found the text {names!r}, expected a list of names")
        chosen = None if names is None else frozenset(names)
        for name in chosen or ():
            if not self._is_announced(name):
                raise KeyError(unknown("view", name, self.view_names))
        self._choose(chosen)

    def _choose(self, chosen: Optional[frozenset[str]]) -> None:
        """Choose views without a wait, whether they are there or not."""
        client = self._reader.client
        with self._reader.changed:
            before, self._chosen = self._chosen, chosen
            # One that is chosen later begins anew: what it showed last is old by then.
            for name in list(self._state.views):
                if (before is not None and name not in before) or (chosen is not None and name not in chosen):
                    del self._state.views[name]
            client.choose_views(None if chosen is None else set(chosen))

    def _is_announced(self, name: str) -> bool:
        """Whether there is a view of this name: one that was added a moment ago is announced a moment later."""
        try:
            return self._reader.wait_for(lambda: name in self.view_names, _ANNOUNCED, "it was not announced")
        except WaitError:
            return False

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
        """The named parts of the surface, each with `name`, `faces`, `vertices` and `bounds`.

        The bounds are in the unit of length of the mesh.
        """
        return list(self._state.hello.get("features", []))

    @property
    def fields(self) -> list[dict[str, Any]]:
        """The fields of the steered channel, each with `name`, `association` and `components`."""
        return list(self._state.hello.get("fields", []))

    @property
    def parameters(self) -> dict[str, Parameter]:
        """The numbers of the solver that can be steered."""
        told = self._state.hello.get("parameters", [])
        return {it["name"]: Parameter(it["value"], it["minimum"], it["maximum"], it.get("unit")) for it in told}

    @property
    def stack(self) -> list[dict[str, Any]]:
        """The edits that make the present shape, the oldest first, as the run answers now.

        Lengths are in the unit of length of the mesh, angles in degrees.

        Raises
        ------
        EndedError
            The run has ended.
        WaitError
            It does not answer in time: see `connect`.
        """
        edits: list[dict[str, Any]] = _json.loads(self._ask(lambda client: client.stack()))
        return edits

    def _ask(self, question: Callable[[_native.Client], Found]) -> Found:
        """The answer to a question that is asked apart from all that the run tells."""
        self._reader.check_goes_on()
        client = self._reader.client
        try:
            return in_thread(lambda: question(client))
        except LinkError:
            # It may have ended meanwhile.
            self._reader.check_goes_on()
            raise

    @property
    def edit_count(self) -> int:
        """How many edits make the present shape, as it was last told: without a wait, unlike `stack`."""
        return int(self._state.stack.get("edits", 0))

    @property
    def drives(self) -> bool:
        """Whether this client steers."""
        return self._reader.drives

    @property
    def end(self) -> Optional[dict[str, Any]]:
        """How the run has ended, where it has: `how` (`finished`, `stopped` or `failed`), `cycle` and `time`.

        The time is in the solver's unit of time.
        """
        return self._state.end

    @property
    def connected(self) -> bool:
        """Whether anything can still come: the run has not ended, and the connection is not given up."""
        return self._reader.failure is None and not self._reader.closed

    @property
    def reconnecting(self) -> bool:
        """Whether the connection was lost, and is being made again: what is known is as old as that."""
        return self.connected and self._state.lost is not None

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
        EndedError
            The run has ended.
        WaitError
            The run does not answer in time: see `connect`.
        """
        return Surface(**self._ask(lambda client: client.surface()))

    @property
    def pipelines(self) -> list[dict[str, Any]]:
        """The pipelines as they are now.

        Raises
        ------
        EndedError
            The run has ended.
        WaitError
            The run does not answer in time: see `connect`.
        """
        pipelines: list[dict[str, Any]] = _json.loads(self._ask(lambda client: client.pipelines()))
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

        Returns
        -------
        object
            What `found` has returned.

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

    def wait_for_cycle(self, cycle: Cycle, timeout: Optional[float] = None) -> Status:
        """Wait until the solver has told a step from `cycle` on, and return its status.

        Parameters
        ----------
        cycle : int
            The step; a number from a table of monitors will do.
        timeout : float, optional
            Seconds, at most; without it there is no limit.

        Returns
        -------
        Status
            The newest status, which may be of a later step.

        Raises
        ------
        ConfigurationError
            The cycle is no number.
        WaitError
            No such step came in time.
        EndedError, LinkError
            None came before the run has ended, or the connection was lost for good.
        """
        return self._reader.carry_out(self._wait_for_cycle(cycle, timeout))

    def _wait_for_cycle(self, cycle: Cycle, timeout: Optional[float]) -> Parts[Status]:
        first = number(cycle, "cycle")

        def found() -> Optional[Status]:
            return self._state.status if self._state.status is not None and self._state.status.cycle >= first else None

        status: Status = yield found, timeout, f"no step from cycle {cycle} on was told"
        return status

    def wait_for_view(self, name: str, *, after: Optional[Cycle] = None, timeout: Optional[float] = None) -> View:
        """Wait for a frame of a view, of a step after the cycle `after` where that is given, and return it.

        Parameters
        ----------
        name : str
            The name of the view, one of `view_names`. One that is not known is waited for 2 seconds: it may have been
            added a moment ago.
        after : int, optional
            The step that the frame has to be later than. Left out: one that is there already will do.
        timeout : float, optional
            Seconds, at most; without it there is no limit.

        Returns
        -------
        View
            The newest frame of the view.

        Raises
        ------
        KeyError
            There is no such view.
        CallError
            No frames of it come: it was not chosen, or the run was connected with ``views=False``.
        WaitError
            None came in time.
        EndedError, LinkError
            None came before the run has ended, or the connection was lost for good.
        """
        return self._reader.carry_out(self._wait_for_view(name, after, timeout))

    def _wait_for_view(self, name: str, after: Optional[Cycle], timeout: Optional[float]) -> Parts[View]:
        if not self._has_views:
            raise CallError(NOT_WANTED)
        since, patience = None if after is None else number(after, "after"), min(_ANNOUNCED, seconds(timeout))

        def found() -> Optional[View]:
            if self._chosen is not None and name not in self._chosen:
                raise CallError(not_chosen(name))
            view = self.views.get(name)
            return view if view is not None and (since is None or view.cycle > since) else None

        if self.view_names and name not in self.view_names:
            # A view that was added a moment ago is announced a moment later.
            try:
                yield (lambda: name in self.view_names), patience, "it was not announced"
            except WaitError:
                raise KeyError(unknown("view", name, self.view_names)) from None
        view: View = yield found, timeout, f"no {'' if after is None else 'newer '}frame of the view '{name}' came"
        return view

    def wait(self, timeout: Optional[float] = None) -> dict[str, Any]:
        """Wait until the run has ended, and return how.

        Parameters
        ----------
        timeout : float, optional
            Seconds, at most; without it there is no limit.

        Returns
        -------
        dict
            What `end` is. `how` is `unknown`, and alone, where the run has gone without a word.

        Raises
        ------
        WaitError
            It did not end in time.
        LinkError
            The connection was lost for good.
        """
        return self._reader.carry_out(self._wait_for_end(timeout))

    def _wait_for_end(self, timeout: Optional[float]) -> Parts[dict[str, Any]]:
        try:
            end = yield (lambda: self._state.end), timeout, "the run did not end"
        except EndedError:
            end = self._state.end
        return end or {"how": "unknown"}

    # ---- Events.

    def events(self, *kinds: str, timeout: Optional[float] = None) -> Iterator[Event]:
        """Iterate over what the run tells from now on, until it ends.

        Parameters
        ----------
        *kinds : str
            Only events of these kinds, which `Event` lists; without any, all.
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
        ConfigurationError
            There are no events of such a kind.
        """
        check_kinds(kinds)
        return self._iterate(self._reader.listen(), kinds, timeout)

    def _iterate(self, waiting: deque[Event], kinds: tuple[str, ...], timeout: Optional[float]) -> Iterator[Event]:
        # A generator of the run's own, which holds the run as long as somebody iterates.
        yield from iterate(self._reader, waiting, kinds, timeout)

    def on(self, kind: Optional[str], callback: Callable[[Event], object]) -> Callable[[], None]:
        """Have a function called with each event of a kind, as `Event` lists them, or with every one for None.

        It is called on a thread of its own, one event at a time, and may wait and give orders. What it raises is
        printed, and it is called again. While there is such a function, the run stays connected until it is closed,
        though nothing else refers to it.

        Parameters
        ----------
        kind : str or None
            Only events of this kind, which `Event` lists; None: all.
        callback : callable
            The function, which takes an `Event`.

        Returns
        -------
        callable
            Call it to have the function called no more.

        Raises
        ------
        ConfigurationError
            There are no events of such a kind.
        TypeError
            It is no function.
        """
        if kind is not None:
            check_kinds((kind,))
        if not callable(callback):
            raise TypeError(f"callback: found {callback!r}, expected a function")
        return self._callbacks.add(self, kind, callback)

    # ---- The end.

    def close(self) -> None:
        """Close the connection. The run goes on."""
        self._reader.close()

    def __repr__(self) -> str:
        # The link has a secret in it.
        place = self.link.split("?")[0]
        if self._state.end is not None:
            return f"<tombolo.Run {place}, {self._state.end['how']} at cycle {self._state.end['cycle']}>"
        cycle = "no step told yet" if self._state.status is None else f"cycle {self._state.status.cycle}"
        if not self.connected:
            doing = ", not connected"
        elif self.reconnecting:
            doing = ", connecting again"
        else:
            doing = ", driving" if self.drives else ""
        return f"<tombolo.Run {place}, {cycle}{doing}>"
