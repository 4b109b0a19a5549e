"""Runs that are connected and steered in the background: for programs whose interface must not wait for a network."""

from __future__ import annotations

import contextlib
import threading
import time as clock
import weakref
from collections.abc import Callable
from typing import Any, Optional, Union

from .errors import TomboloError
from .orders import Edits, Order
from .run import Run, connect
from .views import Surface

__all__ = ["Connection", "Look", "Requests", "connection"]

#: Seconds until a run that was not reached is tried again.
_AGAIN = 5.0

#: Those that somebody refers to.
_CONNECTIONS: weakref.WeakValueDictionary[str, Connection] = weakref.WeakValueDictionary()
_LOCK = threading.Lock()


class Look:
    """One who looks at a view of a connection, as long as anybody refers to it: `Connection.look` makes it.

    Attributes
    ----------
    connection : Connection
        The connection, which lasts as long.
    view : str
        The name of the view.
    """

    def __init__(self, connection: Connection, view: str) -> None:
        self.connection = connection
        self.view = view


class Connection:
    """A run that a thread of its own connects to. What is not there yet is None.

    Of the live views those come at which somebody looks (`look`).

    Once the run has ended it is looked for again: another one may be under way behind the same link, such as a file.
    Until then all stays as it was. A surface that did not come is asked for again as well. It lasts as long as anybody
    refers to it.

    Attributes
    ----------
    link : str
        The link, or the file that holds it.
    run : Run or None
        The run.
    surface : Surface or None
        Its reference surface: there is none before its first step.
    failure : str or None
        Why there is no run, or no surface.
    """

    def __init__(self, link: str) -> None:
        self.link = link
        self.run: Optional[Run] = None
        self.surface: Optional[Surface] = None
        self.failure: Optional[str] = None
        self._again = 0.0
        # Who looks, and what was chosen for them: by any thread.
        self._choice = threading.Lock()
        self._looks: weakref.WeakSet[Look] = weakref.WeakSet()
        self._thread: Optional[threading.Thread] = None
        self._ask()

    def look(self, view: str) -> Look:
        """Look at a live view: its frames come to `run.views` as long as anybody refers to what is returned.

        What nobody looks at any more is no longer sent once `connection` is called again.

        Parameters
        ----------
        view : str
            The name of the view; one that the run gets later comes once `connection` is called again.

        Returns
        -------
        Look
            Keep it as long as the view is shown.
        """
        look = Look(self, view)
        with self._choice:
            self._looks.add(look)
        self._choose()
        return look

    def _choose(self) -> None:
        """Choose the views at which somebody looks now."""
        run = self.run
        if run is None or not run.connected:
            return
        with self._choice:
            names = frozenset(look.view for look in self._looks) & frozenset(run.view_names)
            if names != run.chosen_views:
                # The run may end meanwhile, of which whoever looks hears.
                with contextlib.suppress(TomboloError):
                    run._choose(names)

    def _ask(self) -> None:
        """Try, unless it is being tried, is there or was tried just now."""
        is_trying = self._thread is not None and self._thread.is_alive()
        is_there = self.run is not None and self.run.connected
        if not (is_there and self.surface is not None) and not is_trying and clock.monotonic() >= self._again:
            self._again = clock.monotonic() + _AGAIN
            arguments = weakref.ref(self), self.link, self.run
            self._thread = threading.Thread(target=_connect, args=arguments, name="tombolo-connection", daemon=True)
            self._thread.start()

    def _begin(self, run: Run) -> None:
        before, self.run, self.surface, self.failure = self.run, run, None, None
        self._choose()
        if before is not None:
            before.close()

    def _fail(self, error: Exception) -> None:
        self.failure, self._again = _said(error), clock.monotonic() + _AGAIN

    def __repr__(self) -> str:
        # The link has a secret in it.
        return f"<tombolo.background.Connection to {self.run if self.run is not None else self.failure or 'a run'}>"


def _said(error: Exception) -> str:
    """What is wrong: in the library's words, or in those of an error that it does not expect."""
    return str(error) if isinstance(error, TomboloError) else f"{type(error).__name__}: {error}"


def _connect(known: weakref.ref[Connection], link: str, run: Optional[Run]) -> None:
    """Connect, and ask for the surface, while anybody refers to the connection: this thread does not."""
    try:
        if run is None or not run.connected:
            run = connect(link)
            if (connected := known()) is not None:
                connected._begin(run)
                del connected
        of_run = run
        # Before the first step there is no mesh.
        run.wait_for(lambda: of_run.features or known() is None)
        if known() is None:
            # It closes with this thread, unless somebody refers to the run itself.
            return
        surface = run.surface
        if (connected := known()) is not None:
            connected.surface, connected.failure = surface, None
    except Exception as error:
        # Whatever it is, nobody else would tell it.
        if (connected := known()) is not None:
            connected._fail(error)


def connection(link: str) -> Optional[Connection]:
    """Find the connection of a link, which all who ask for it share; it never waits.

    A connection is begun when it is first asked for. Where the run is not reached, it is tried again later, when it is
    asked for once more. It is closed once nobody refers to it: keep it as long as it is of use.

    Parameters
    ----------
    link : str
        As `connect` takes it; nothing comes of an empty one.

    Returns
    -------
    Connection or None
        The connection, which may have no run yet; None for an empty link.
    """
    link = link.strip()
    if not link:
        return None
    with _LOCK:
        known = _CONNECTIONS.get(link)
        if known is None:
            known = _CONNECTIONS[link] = Connection(link)
        known._ask()
    known._choose()
    return known


class Requests:
    """Forecasts, orders and undos, each asked for by a thread of its own, and what has become of the last."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        # Held by the thread whose forecast is under way.
        self._forecasting = threading.Lock()
        self._count = 0
        # Of each kind the number of the last question, and its answer.
        self._asked: dict[str, int] = {}
        self._answers: dict[str, str] = {}
        # The last order or undo, behind the number of its question.
        self._order: tuple[int, Optional[Order]] = 0, None

    def forget(self) -> None:
        """Let go of the last order, and of the run that it was given to."""
        with self._lock:
            self._order = self._order[0], None

    def forecast(self, run: Run, edits: Edits, **settings: Any) -> None:
        """Ask what an order would come to. Parameters as of `Run.forecast`."""

        def ask(is_newest: Callable[[], bool]) -> str:
            # One waits for the other, and all but the last of those that wait are of no interest any more.
            with self._forecasting:
                if not is_newest():
                    return "overtaken"
                forecast = run.forecast(edits, **settings)
            reason = "" if forecast.reason is None else f", {forecast.reason}"
            return f"{forecast.outcome}, least scaled Jacobian {forecast.min_scaled_jacobian}{reason}"

        self._begin("forecast", ask)

    def order(self, run: Run, edits: Edits, **settings: Any) -> None:
        """Give an order. Parameters as of `Run.order`."""
        self._begin("order", lambda _: run.order(edits, **settings))

    def undo(self, run: Run) -> None:
        """Take the last order back."""
        self._begin("undo", lambda _: run.undo())

    def _begin(self, title: str, ask: Callable[[Callable[[], bool]], Union[Order, str]]) -> None:
        """Have a thread ask; it is told by a function whether its question is the newest of its kind."""
        with self._lock:
            self._count += 1
            number = self._asked[title] = self._count
            self._answers[title] = "asked"

        def is_newest() -> bool:
            return self._asked[title] == number

        def work() -> None:
            order: Optional[Order] = None
            try:
                answer = ask(is_newest)
                if isinstance(answer, Order):
                    order, answer = answer, f"given as {answer.id}"
            except TomboloError as error:
                answer = f"refused: {error}"
            except Exception as error:
                # Whatever it is, nobody else would tell it.
                answer = f"failed: {_said(error)}"
            with self._lock:
                # A later question may have been answered sooner.
                if is_newest():
                    self._answers[title] = answer
                if order is not None and self._order[0] < number:
                    self._order = number, order

        threading.Thread(target=work, name=f"tombolo-{title}", daemon=True).start()

    @property
    def outcomes(self) -> dict[str, str]:
        """What has become of them, to be shown to a person.

        The answers to the last `forecast`, `order` and `undo`; of the last order or undo the `status`, and the `reason`
        where there is one.
        """
        with self._lock:
            outcomes, (_, order) = dict(self._answers), self._order
        if order is not None:
            shape, shapes = order.shape
            outcomes["status"] = f"{order.status}, shape {shape} of {shapes}"
            if order.reason:
                outcomes["reason"] = order.reason
        return outcomes
