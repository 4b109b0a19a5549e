"""A run that goes on elsewhere: watched, and steered."""

from __future__ import annotations

import contextlib
import os
import time as clock
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Optional, SupportsFloat, SupportsIndex, Union

from . import _json
from ._values import number, seconds, whole
from ._waiting import Parts, in_thread, moment_after
from ._watched import Watched
from .errors import LinkError, NotDriverError, RejectedError, TomboloError, WaitError
from .orders import Command, Edits, Forecast, Given, Order, id_of

if TYPE_CHECKING:
    from . import _native
    from .aio import AsyncRun
    from .jupyter import Plot

__all__ = ["Run", "connect"]

#: How long the wheel is asked for: longer than a server keeps it for a driver that was lost.
WHEEL = 8.0
#: How long it is asked for at once.
_SLICE = 0.2
#: How long one who has left may still be told as the driver.
_LEAVING = 3.0
#: How links begin.
_SCHEMES = ("http://", "https://", "unix:")


def left(begin: float, timeout: Optional[float]) -> Optional[float]:
    """What is left of so many seconds since `begin`."""
    return None if timeout is None else max(begin + timeout - clock.monotonic(), 0.0)


class Run(Watched):
    """A run that goes on elsewhere, as `connect` returns it.

    A thread of its own reads what the run tells, so that `status`, `views` and `monitors` are always the newest. A
    connection that is lost is made again with growing pauses. Any thread may use it. Ctrl-C ends every wait. It
    closes with `close`, at the end of a `with` block, once nothing refers to it any more, or with the interpreter; the
    run itself goes on. Commands, questions and waits raise `CallError` once it was closed, and in a process that was
    forked since.

    Attributes
    ----------
    link : str
        The link that it was connected by: whoever has it can do what it is for.
    views : Views
        The newest frame of each live view that has come.
    monitors : Monitors
        For each pipeline that has monitors a table that grows.
    """

    #: What stands for the forecast that is under way.
    _forecasting: Optional[object] = None

    # ---- Steering.

    @property
    def orders(self) -> list[Order]:
        """The orders so far, the oldest first."""
        with self._reader.changed:
            return [Order(self, identity) for identity in self._state.orders]

    def drive(self, timeout: Optional[float] = None) -> None:
        """Take the wheel: what every command does first.

        Parameters
        ----------
        timeout : float, optional
            Seconds to wait, at most. Left out: some seconds where the wheel is kept for another, and as long as a lost
            connection is made again.

        Raises
        ------
        NotDriverError
            Somebody else steers, or this client may only watch.
        WaitError
            Nothing was said within `timeout`.
        EndedError, LinkError
            The run has ended, or the connection was lost for good.
        """
        until = moment_after(WHEEL if timeout is None else timeout)
        while not self._ask_for_wheel(until, timeout is None):
            pass

    def hand_over(self, to: str, timeout: float = 60.0) -> None:
        """Give the wheel to another client; it is there when this returns.

        Parameters
        ----------
        to : str
            The client's name in the run, such as ``c4``: an event `wheel` says who asks for it (``asked_by``), and
            `people` who is there.
        timeout : float
            Seconds to wait, at most.

        Raises
        ------
        NotDriverError
            This client does not steer.
        RejectedError
            There is no such client, or it may only watch.

        Examples
        --------
        ::

            run.on("wheel", lambda event: run.hand_over(event.data["asked_by"]))
        """
        patience = seconds(timeout)
        self._ask(lambda client: client.hand_over(to, patience))

    def _ask_for_wheel(self, until: float, reconnects: bool) -> bool:
        """Ask for the wheel for a moment; whether it is there. An error where it will not be, or is not by then.

        With `reconnects` a connection that is being made again is waited for beyond that.
        """
        self._reader.check_goes_on()
        if self._watch:
            raise NotDriverError("this client only watches: it was connected with watch=True")
        if self.drives:
            return True
        try:
            in_thread(lambda: self._reader.client.drive(_SLICE))
        except NotDriverError:
            if self._is_taken(until) or clock.monotonic() >= until:
                raise
        except WaitError:
            # One who drives is there to refuse: what says nothing then is only slow.
            taken = self._state.status is not None and self._state.status.driver is not None
            if clock.monotonic() >= until and (taken or not reconnects):
                raise
        return self.drives

    def _is_taken(self, until: float) -> bool:
        """Whether somebody else steers, and still does after a moment: of one who has just left it is told late."""

        def is_free() -> bool:
            return self.drives or self._state.status is None or self._state.status.driver is None

        try:
            return not self.wait_for(is_free, max(min(_LEAVING, until - clock.monotonic()), 0.0))
        except WaitError:
            return True

    def order(
        self,
        edits: Edits,
        *,
        schedule: Optional[Mapping[str, Any]] = None,
        deform: Optional[Mapping[str, Any]] = None,
        guard: Optional[Mapping[str, Any]] = None,
        replaces: Optional[Given] = None,
        deadline: Optional[SupportsIndex] = None,
    ) -> Order:
        """Give an order of a new shape; it is on its way when this returns, and `Order.wait` waits for it.

        Parameters
        ----------
        edits : list of dict, dict or path
            The edits, or a whole order (`edits`, `stack` or `undo`, with its settings), or a JSON file of either.
            Arrays of NumPy may stand in for lists of numbers. Lengths are in the unit of length of the mesh, angles in
            degrees.
        schedule, deform, guard : dict, optional
            In how many steps the shape is reached; how the volume follows; what the mesh must keep to. Left out: what
            the run's configuration says.
        replaces : Order, AsyncOrder or str, optional
            An order that has not begun to move the mesh, whose place this one takes; that one is rejected.
        deadline : int, optional
            Seconds that it may wait for its turn, where the run's configuration does not say less; it is rejected then.

        Returns
        -------
        Order
            The order, which has been sent.

        Raises
        ------
        ConfigurationError
            Something is wrong with it: the text has line, column, path and the nearest known name.
        NotDriverError
            Somebody else steers.
        WaitError, EndedError, LinkError
            As of `drive`.

        Examples
        --------
        ::

            order = run.order([{"translate": {"features": ["throat"], "fixed": ["inlet"], "by": [0, 0, 0.1]}}],
                              schedule={"steps": 10})
            order.wait()
        """
        text = _text(edits, schedule=schedule, deform=deform, guard=guard, replaces=replaces, deadline=deadline)
        prepared = self._prepared(text)
        self.drive()
        return Order(self, self._reader.client.order(prepared))

    def _prepared(self, order: tuple[str, str]) -> _native.Prepared:
        """An order that was read, with the numbers of the displacements whose files it names."""
        client = self._reader.client
        return in_thread(lambda: client.prepare(*order))

    def forecast(
        self,
        edits: Edits,
        *,
        schedule: Optional[Mapping[str, Any]] = None,
        deform: Optional[Mapping[str, Any]] = None,
        guard: Optional[Mapping[str, Any]] = None,
        timeout: Optional[float] = None,
    ) -> Forecast:
        """Ask what an order would come to, were it given now; nothing changes.

        Parameters
        ----------
        edits : list of dict, dict or path
            As of `order`.
        schedule, deform, guard : dict, optional
            As of `order`.
        timeout : float, optional
            Seconds to wait for the wheel, and then for the answer, at most. Before it come the answers to forecasts
            that other threads and tasks have asked for by this client.

        Returns
        -------
        Forecast
            What the order would come to.

        Raises
        ------
        ConfigurationError
            Something is wrong with the order: the text has line, column, path and the nearest known name.
        RejectedError
            The run does not find out what it would come to, and says why. An order that would be rejected is an answer
            (`Forecast.outcome`), and none of these.
        NotDriverError
            Somebody else steers.
        WaitError
            No answer came in time.
        EndedError, LinkError
            As of `drive`.
        """
        seconds(timeout)
        prepared = self._prepared(_text(edits, schedule=schedule, deform=deform, guard=guard))
        self.drive(timeout)
        return self._reader.carry_out(self._foretold(prepared, timeout))

    def _foretold(self, prepared: _native.Prepared, timeout: Optional[float]) -> Parts[Forecast]:
        """Ask for a forecast, and wait for the answer.

        A run finds out one at a time for each client, and forgets what has not begun when the next one is asked for. So
        those of several threads and tasks take turns here.
        """
        begin, turn = clock.monotonic(), object()
        question: Optional[str] = None

        def has_turn() -> bool:
            if self._forecasting is None:
                self._forecasting = turn
            return self._forecasting is turn

        def answer() -> Optional[tuple[str, Any]]:
            return None if question is None else self._state.answers.get(question)

        try:
            yield has_turn, timeout, "the turn of the forecast, behind others of this client, did not come"
            question = self._reader.client.forecast(prepared)
            kind, data = yield answer, left(begin, timeout), "no answer to the forecast came"
        finally:
            if question is not None and answer() is None:
                # Nobody waits for it any more. Where the run is gone, so is the forecast.
                with contextlib.suppress(TomboloError):
                    self._reader.client.withdraw_forecast()
            if self._forecasting is turn:
                with self._reader.looking_again():
                    self._forecasting = None
        if kind == "error":
            raise RejectedError(data["message"])
        return Forecast(data["order"])

    def undo(self, count: SupportsIndex = 1) -> Order:
        """Take the last orders back.

        Parameters
        ----------
        count : int
            How many orders. The shape is the one before them then, to the bit.

        Returns
        -------
        Order
            The order that takes them back, which has been sent. What there is against it, such as fewer orders, is told
            by its `Order.wait`.

        Raises
        ------
        ConfigurationError
            That is no number of orders.
        NotDriverError
            Somebody else steers.
        WaitError, EndedError, LinkError
            As of `drive`.
        """
        orders = whole(count, "count", 1)
        self.drive()
        return Order(self, self._reader.client.undo(orders))

    def cancel(self, order: Given, *, wait: bool = True, timeout: Optional[float] = None) -> Command:
        """Take back an order that has not begun to move the mesh: it is rejected then.

        Parameters
        ----------
        order : Order, AsyncOrder or str
            The order, or its id.
        wait : bool
            Whether to wait until it has taken effect.
        timeout : float, optional
            Seconds to wait, at most.

        Returns
        -------
        Command
            The command, which has taken effect where that was waited for.

        Raises
        ------
        RejectedError
            It moves the mesh already, is over, or never was.
        NotDriverError
            Somebody else steers.
        WaitError
            It did not take effect in time; it may still.
        EndedError, LinkError
            As of `drive`.
        """
        identity = id_of(order, "order")
        return self._give(lambda: self._reader.client.cancel(identity), "cancel", wait, timeout)

    def set(
        self, parameter: str, value: SupportsFloat, *, wait: bool = True, timeout: Optional[float] = None
    ) -> Command:
        """Give a parameter of the solver a new value, within its bounds.

        Parameters
        ----------
        parameter : str
            Its name.
        value : float
            Its new value, in the unit that the solver has it in.
        wait : bool
            Whether to wait until the solver has it.
        timeout : float, optional
            Seconds to wait, at most.

        Returns
        -------
        Command
            The command, which has taken effect where that was waited for.

        Raises
        ------
        ConfigurationError
            The value is no finite number.
        RejectedError
            There is no such parameter, or the value is beyond its bounds.
        NotDriverError
            Somebody else steers.
        WaitError
            The solver did not have it in time; it may still.
        FailedError
            256 commands of this client have no answer yet, such as those of a loop with ``wait=False``.
        EndedError, LinkError
            As of `drive`.
        """
        given = number(value, f"parameter {parameter!r}")
        return self._give(lambda: self._reader.client.set(parameter, given), "set", wait, timeout)

    def pause(self, *, wait: bool = True, timeout: Optional[float] = None) -> Command:
        """Hold the solver at its next safe point.

        Parameters
        ----------
        wait : bool
            Whether to wait until it is held, and `status` shows it.
        timeout : float, optional
            Seconds to wait, at most.

        Returns
        -------
        Command
            The command, which has taken effect where that was waited for.

        Raises
        ------
        RejectedError
            The run refuses it.
        NotDriverError
            Somebody else steers.
        WaitError
            It did not take effect in time; it may still.
        EndedError, LinkError
            As of `drive`.
        """
        return self._give(self._reader.client.pause, "pause", wait, timeout)

    def resume(self, *, wait: bool = True, timeout: Optional[float] = None) -> Command:
        """Let the solver go on.

        Parameters
        ----------
        wait : bool
            Whether to wait until it goes on, and `status` shows it.
        timeout : float, optional
            Seconds to wait, at most.

        Returns
        -------
        Command
            The command, which has taken effect where that was waited for.

        Raises
        ------
        RejectedError
            The run refuses it.
        NotDriverError
            Somebody else steers.
        WaitError
            It did not take effect in time; it may still.
        EndedError, LinkError
            As of `drive`.
        """
        return self._give(self._reader.client.resume, "resume", wait, timeout)

    def stop(self, *, wait: bool = True, timeout: Optional[float] = None) -> Command:
        """Ask the solver to end.

        A run that ends before it has answered is no error.

        Parameters
        ----------
        wait : bool
            Whether to wait until the solver has been told.
        timeout : float, optional
            Seconds to wait, at most.

        Returns
        -------
        Command
            The command, which has taken effect where that was waited for.

        Raises
        ------
        RejectedError
            The run refuses it.
        NotDriverError
            Somebody else steers.
        WaitError
            It did not take effect in time; it may still.
        EndedError, LinkError
            As of `drive`.
        """
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

        Returns
        -------
        Command
            The command, which has taken effect where that was waited for.

        Raises
        ------
        ConfigurationError
            Something is wrong with the change: the text has line, column, path and the nearest known name.
        RejectedError
            The run refuses it, and says why.
        NotDriverError
            Somebody else steers.
        WaitError
            It did not take effect in time; it may still.
        EndedError, LinkError
            As of `drive`.
        """
        text = _json.text(change, "pipelines")
        return self._give(lambda: self._reader.client.change_pipelines(text), "pipelines", wait, timeout)

    def _give(self, give: Callable[[], str], task: str, wait: bool, timeout: Optional[float]) -> Command:
        begin = clock.monotonic()
        self.drive(timeout)
        command = Command(self, give(), task)
        if wait:
            self._reader.carry_out(command._wait(left(begin, timeout), timeout))
        return command

    # ---- Elsewhere.

    def link_for(self, rights: str = "watch", timeout: float = 60.0) -> str:
        """Make a link for somebody else. It opens one browser, once, and lets no program in.

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
        ConfigurationError
            The rights are none of these.
        RejectedError
            This client may not give such a link.
        WaitError
            None came in time.
        EndedError, LinkError
            The run has ended, or the connection was lost for good.
        """
        patience = seconds(timeout)
        return self._ask(lambda client: client.link_for(rights, patience))

    @property
    def aio(self) -> AsyncRun:
        """The run for `async` programs: each of its methods that waits is a coroutine there."""
        from .aio import AsyncRun

        return AsyncRun(self)

    def __enter__(self) -> Run:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def plot(self, pipeline: str, monitor: str) -> Plot:
        """A monitor as a picture that a notebook shows; `Plot.live` has it grow while the run goes on.

        Parameters
        ----------
        pipeline, monitor : str
            The monitor, and the pipeline that it is one of.

        Returns
        -------
        tombolo.jupyter.Plot
            The plot. Where there is no such monitor, to show it is a `KeyError`.
        """
        from .jupyter import Plot

        return Plot(self, pipeline, monitor)

    def _repr_html_(self) -> str:
        from .jupyter import summary

        return summary(self)


def _text(
    edits: Edits,
    *,
    schedule: Optional[Mapping[str, Any]] = None,
    deform: Optional[Mapping[str, Any]] = None,
    guard: Optional[Mapping[str, Any]] = None,
    replaces: Optional[Given] = None,
    deadline: Optional[SupportsIndex] = None,
) -> tuple[str, str]:
    """An order as a text with its name."""
    other = None if replaces is None else id_of(replaces, "replaces")
    settings = {"schedule": schedule, "deform": deform, "guard": guard, "replaces": other, "deadline": deadline}
    return _json.order(edits, settings)


def connect(
    link: Union[str, os.PathLike[str]],
    *,
    watch: bool = False,
    views: Union[bool, Sequence[str]] = True,
    attempts: SupportsIndex = 10,
    timeout: Optional[float] = None,
) -> Run:
    """Connect to a run.

    Parameters
    ----------
    link : str or path
        The run's `Adaptor.link`, or `Adaptor.watching_link` to watch only; or the file ``tombolo-PORT.link`` that holds
        both, of which the first counts: the one for driving. A link for programs has a token in it (``?token=``). One
        with ``?key=``, which a run prints on a terminal, opens one browser, once, and lets no program in.
    watch : bool
        Whether to only watch: never to have the wheel.
    views : bool or list of str
        Whether the frames of the live views are wanted, or the names of those that are: see `Run.choose_views`.
    attempts : int
        How often a connection that is lost is tried to be made again, with growing pauses: 10 take about a minute.
    timeout : float, optional
        Seconds that the run may take to answer, now and to each question later (`Run.surface`, `stack`, `pipelines`).
        Left out: 20 now, and 120 later, as a run may have a large surface to prepare.

    Returns
    -------
    Run
        The run. It steers from the first command on.

    Raises
    ------
    LinkError
        The run is not reached: the text says why.
    WaitError
        It does not answer within `timeout`.
    KeyError
        There is no view of a name in `views`.
    TypeError
        `views` is a text.

    Examples
    --------
    ::

        with tombolo.connect("http://127.0.0.1:7070/?token=...") as run:
            print(run.status.cycle, run.monitors["health"].last)
            run.order([{"translate": {"features": ["throat"], "fixed": ["inlet"], "by": [0, 0, 0.1]}}]).wait()
    """
    text = os.fspath(link)
    if not isinstance(text, str):
        raise TypeError(f"link: found {text!r}, expected a text or a path")
    path = os.path.expanduser(text)
    # What has a secret in it is a link, which the client refuses without the secret.
    may_be_file = "://" not in text and "?" not in text and not text.startswith("unix:")
    if may_be_file and os.path.isfile(path):
        try:
            with open(path, encoding="utf-8") as file:
                words = file.read(1 << 16).split()
        except (OSError, UnicodeDecodeError) as error:
            raise LinkError(f"{text}: the file cannot be read ({error})") from None
        links = [word for word in words if word.startswith(_SCHEMES)]
        if not links:
            raise LinkError(f"{text}: found a file without a link, expected http://HOST:PORT/?token=TOKEN in it")
        text = links[0]
    elif may_be_file:
        raise LinkError(
            f"found no file {os.path.abspath(path)!r}, and no link; expected http://HOST:PORT/?token=TOKEN or a file "
            "that has it, which a run takes away as it ends"
        )
    retries, patience = whole(attempts, "attempts", 0), None if timeout is None else seconds(timeout)
    # A text would be taken for a list of letters.
    if isinstance(views, str):
        raise TypeError(f"views: found the text {views!r}, expected True, False or a list of names")
    has_views = views is not False
    run = Run(text, watch=watch, views=has_views, attempts=retries, timeout=patience)
    if has_views and not isinstance(views, bool):
        try:
            run.choose_views(views)
        except BaseException:
            run.close()
            raise
    return run
