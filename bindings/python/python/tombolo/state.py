"""What is known of a run: the newest of all that it has told."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any, NamedTuple, Optional

import numpy as np

from .events import Event
from .monitors import Monitors
from .views import View

__all__ = ["Parameter", "Status"]

#: Answers to commands and forecasts that are kept until somebody asks for them.
_ANSWERS = 4096


class Status(NamedTuple):
    """How far the solver is.

    Attributes
    ----------
    cycle : int
        The last step that it told.
    time : float
        The simulated time, in the solver's unit of time.
    paused, stopped : bool
        Whether it waits to be resumed; whether it was asked to stop.
    step_seconds : float or None
        Seconds that a step takes, where that is known.
    viewers : int
        How many clients are connected.
    driver : str or None
        The name of the client that steers.
    quality : dict or None
        The scaled Jacobian of the mesh: `min`, `mean`, and how many cells are `inverted`.
    message : dict
        The whole message, which is not shown with the rest.
    """

    cycle: int
    time: float
    paused: bool
    stopped: bool
    step_seconds: Optional[float]
    viewers: int
    driver: Optional[str]
    quality: Optional[dict[str, Any]]
    message: dict[str, Any]

    def __repr__(self) -> str:
        # The message says all of it again, in a thousand characters.
        shown = ", ".join(f"{name}={value!r}" for name, value in self._asdict().items() if name != "message")
        return f"Status({shown})"

    @classmethod
    def _of(cls, message: dict[str, Any]) -> Status:
        return cls(
            message["cycle"],
            message["time"],
            message.get("paused", False),
            message.get("stopped", False),
            message.get("step_seconds"),
            message.get("viewers", 0),
            message.get("driver"),
            message.get("quality"),
            message,
        )


class Parameter(NamedTuple):
    """A number of the solver that can be steered: its value now, and the least and greatest it may take.

    All three are in the unit that the solver has it in; `unit` says which, where the run's configuration does.
    """

    value: float
    minimum: float
    maximum: float
    unit: Optional[str] = None


class State:
    """What is known of a run.

    Attributes
    ----------
    hello, stack : dict
        What there is in the run, and the edits of its shape, as docs/protocol.md says it; empty before it was told.
    status : Status or None
        How far the solver is.
    end : dict or None
        How the run has ended.
    monitors : Monitors
        The tables of the monitors.
    views : dict of str to View
        The newest frame of each view.
    orders : dict of str to dict
        The report of each order.
    answers : dict of str to (str, dict)
        The kind of the answer to a question or command, and what it says.
    """

    def __init__(self) -> None:
        self.hello: dict[str, Any] = {}
        self.stack: dict[str, Any] = {}
        self.status: Optional[Status] = None
        self.end: Optional[dict[str, Any]] = None
        # Why the connection was lost, until it is there again.
        self.lost: Optional[str] = None
        self.monitors = Monitors()
        self.views: dict[str, View] = {}
        # The triangles, lines and features of each view, which come once as long as they stay the same.
        self._cells: dict[str, tuple[Any, Any, Any]] = {}
        # The names of views that were there once.
        self.removed: set[str] = set()
        self.orders: OrderedDict[str, dict[str, Any]] = OrderedDict()
        self.answers: OrderedDict[str, tuple[str, Any]] = OrderedDict()

    def take(self, kind: str, data: Any) -> Event:
        """Take what the run has told; returns the event that it is."""
        if kind == "frame":
            data = self._view(data)
            self.views[data.name] = data
        elif kind == "lost":
            self.lost = data
        else:
            identity = data.get("id")
            is_known = kind != "unknown"
            kind, data = next((key, value) for key, value in data.items() if key != "id")
            if isinstance(data, dict):
                identity = data.get("id", identity)
            # One of a known name may have a form of another version: whoever listens is told all the same.
            if is_known:
                self._take_message(kind, data, identity)
        return Event(kind, data)

    def _take_message(self, kind: str, data: Any, identity: Optional[str]) -> None:
        if kind == "hello":
            self.lost = None
            for report in data.pop("orders", []):
                self._take_order(report)
            self.stack = data.get("stack", self.stack)
            for monitor in data.get("monitors", []):
                self.monitors._table(monitor["pipeline"])._announce(monitor["name"])
            before, now = ({view["name"] for view in hello.get("views", [])} for hello in (self.hello, data))
            # One that was removed, and one that is there again, of which a late frame of before may be left. What was
            # never announced may be so a moment later.
            gone = before - now
            back = self.removed & now
            for name in gone | back:
                self.views.pop(name, None)
                self._cells.pop(name, None)
            self.removed = (self.removed | gone) - now
            self.hello = data
        elif kind == "status":
            self.status = Status._of(data)
        elif kind == "order":
            self._take_order(data)
        elif kind == "parameters":
            values = data["values"]
            before = self.hello.get("parameters", [])
            parameters = [{**it, "value": values.get(it["name"], it["value"])} for it in before]
            # Whoever has the one of before keeps it as it was.
            self.hello = {**self.hello, "parameters": parameters}
        elif kind == "stack":
            self.stack = data
        elif kind == "monitor":
            self.monitors._table(data["pipeline"])._append(data)
        elif kind == "end":
            self.end = data
        elif isinstance(identity, str) and kind in ("forecast", "done", "error", "pipelines"):
            self._answer(identity, kind, data)

    def _take_order(self, report: dict[str, Any]) -> None:
        known = self.orders.setdefault(report["id"], {})
        known.update(report)
        while len(self.orders) > _ANSWERS:
            self.orders.popitem(last=False)

    def _answer(self, identity: str, kind: str, data: Any) -> None:
        self.answers[identity] = (kind, data)
        while len(self.answers) > _ANSWERS:
            self.answers.popitem(last=False)

    def _view(self, frame: dict[str, Any]) -> View:
        name = frame["view"]
        if "triangles" in frame or name not in self._cells:
            none = np.empty((0, 3), np.uint32), np.empty((0, 2), np.uint32)
            self._cells[name] = frame.get("triangles", none[0]), frame.get("lines", none[1]), frame.get("features")
        triangles, lines, features = self._cells[name]
        fields = {field: values for field, _, values in frame["fields"]}
        for array in (frame["points"], triangles, lines, features, *fields.values()):
            if array is not None:
                # Views of later steps share what has not changed.
                array.setflags(write=False)
        return View(
            name,
            frame["cycle"],
            frame["time"],
            frame["points"],
            triangles,
            lines,
            features,
            fields,
            {field: association for field, association, _ in frame["fields"]},
        )
