"""Orders, forecasts and commands that were given to a run."""

from __future__ import annotations

import contextlib
import os
import time as clock
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Optional, Union

from ._reader import late
from ._waiting import Parts, moment_after
from .errors import ConfigurationError, EndedError, RejectedError, TomboloError, WaitError

if TYPE_CHECKING:
    from .aio import AsyncOrder
    from .run import Run

__all__ = ["Command", "Forecast", "Order"]

#: How long a status may take to come after an answer, in seconds.
_STATUS = 2.0
#: Edits or a whole order, as Python's values or as a file.
Edits = Union[str, "os.PathLike[str]", Mapping[str, Any], Sequence[Mapping[str, Any]]]
#: An order that was given, also in an `async` program, or its id.
Given = Union["Order", "AsyncOrder", str]


def id_of(order: Given, name: str) -> str:
    """Find the id of an order that a parameter of a name was given."""
    identity = getattr(order, "id", order)
    if not isinstance(identity, str):
        raise ConfigurationError(f"{name}: found {order!r}, expected an order or its id")
    return identity


class Order:
    """An order of a new shape, and what becomes of it.

    Attributes
    ----------
    id : str
        Its name, unique in the run.
    """

    __slots__ = ("_run", "id")

    def __init__(self, run: Run, identity: str) -> None:
        self._run = run
        self.id = identity

    @property
    def report(self) -> Mapping[str, Any]:
        """What the run has told of it last, as docs/protocol.md says it; empty before it told anything."""
        return dict(self._run._state.orders.get(self.id, {}))

    @property
    def status(self) -> str:
        """`sent`, then `accepted`, `computing`, `applying`, and in the end `applied` or `rejected`.

        It is `applied` also once another order or an undo has gone on from a shape before the last: the motion has
        ended early, `reason` says so, and `shape` how far it came.
        """
        refused = self._refused()
        return "rejected" if refused is not None else str(self.report.get("status", "sent"))

    @property
    def reason(self) -> Optional[str]:
        """Why it was rejected, or what else there is to know, such as ``order c1-9 went on from shape 5.4``."""
        reason: Optional[str] = self.report.get("reason") or self._refused()
        return reason

    @property
    def cycle_applied(self) -> Optional[int]:
        """The step that was the first to move the mesh for it."""
        cycle: Optional[int] = self.report.get("cycle_applied")
        return cycle

    @property
    def shape(self) -> tuple[int, int]:
        """How many shapes of its schedule the solver has been given, and how many there are."""
        report = self.report
        return int(report.get("shape", 0)), int(report.get("shapes", 0))

    @property
    def min_scaled_jacobian(self) -> Optional[float]:
        """The least scaled Jacobian of all shapes on its way; None before it is known."""
        least: Optional[float] = self.report.get("min_scaled_jacobian")
        return least

    @property
    def fraction(self) -> Optional[float]:
        """The fraction of its amounts that its last shape has, less than 1 where the guard has clamped it.

        Of an order that was rejected it is what would pass, where that is known. It stays as it is where another order
        or an undo goes on from a shape before the last: `reason` says so.
        """
        fraction: Optional[float] = self.report.get("fraction")
        return fraction

    @property
    def done(self) -> bool:
        """Whether it is `applied` or `rejected`."""
        return self.status in ("applied", "rejected")

    def _refused(self) -> Optional[str]:
        kind, data = self._run._state.answers.get(self.id, ("", {}))
        return str(data["message"]) if kind == "error" else None

    def wait(self, timeout: Optional[float] = None, *, until: str = "applied") -> Order:
        """Wait until the solver has been given the order's last shape, or another order goes on before that.

        An order or an undo that begins while this one moves the mesh goes on from the shape there is. This one is
        `applied` then, though its motion has ended early: `reason` says so, and `shape` how far it came.

        Parameters
        ----------
        timeout : float, optional
            Seconds, at most; without it there is no limit.
        until : {"applied", "applying", "computing", "accepted"}
            How far it has to come.

        Returns
        -------
        Order
            This order.

        Raises
        ------
        RejectedError
            It was rejected: nothing has changed. The text is the reason, and `report` has the feasible fraction.
        WaitError
            It did not come so far in time; it may still.
        EndedError, LinkError
            The run has ended before that, or the connection was lost for good.
        ValueError
            `until` is none of these.
        """
        return self._run._reader.carry_out(self._wait(timeout, until))

    def _wait(self, timeout: Optional[float], until: str) -> Parts[Order]:
        stages = ("accepted", "computing", "applying", "applied")
        if until not in stages:
            raise ValueError(f"until: found {until!r}, expected one of: {', '.join(stages)}")
        enough = (*stages[stages.index(until) :], "rejected")
        yield (lambda: self.status in enough), timeout, f"the order {self.id} was not {until}"
        if self.status == "rejected":
            raise RejectedError(self.reason or "no reason given", dict(self.report))
        return self

    def cancel(self) -> Command:
        """Take it back, where it has not begun to move the mesh, and wait until that is done.

        Returns
        -------
        Command
            The command, which has taken effect.

        Raises
        ------
        RejectedError, NotDriverError, WaitError, EndedError, LinkError
            As of `Run.cancel`.
        """
        return self._run.cancel(self)

    def __repr__(self) -> str:
        shape, shapes = self.shape
        return f"<tombolo.Order {self.id}: {self.status}, shape {shape} of {shapes}>"


class Forecast(Mapping[str, Any]):
    """What an order would come to: a mapping of all that the run tells, and the parts that are asked for most.

    Examples
    --------
    >>> import tombolo
    >>> forecast = tombolo.Forecast({"outcome": "clamped", "fraction": 0.5, "min_scaled_jacobian": 0.1})
    >>> forecast.outcome, forecast.fraction, forecast["min_scaled_jacobian"]
    ('clamped', 0.5, 0.1)
    """

    def __init__(self, told: Mapping[str, Any]) -> None:
        self._told = dict(told)

    @property
    def outcome(self) -> str:
        """`applied`, `clamped` or `rejected`."""
        return str(self._told["outcome"])

    @property
    def reason(self) -> Optional[str]:
        """Why it would be rejected."""
        reason: Optional[str] = self._told.get("reason")
        return reason

    @property
    def fraction(self) -> Optional[float]:
        """The fraction of its amounts that would be done; of one that would be rejected, what would pass."""
        fraction: Optional[float] = self._told.get("fraction")
        return fraction

    @property
    def min_scaled_jacobian(self) -> Optional[float]:
        """The least scaled Jacobian of all shapes on its way."""
        least: Optional[float] = self._told.get("min_scaled_jacobian")
        return least

    @property
    def quality(self) -> Optional[dict[str, Any]]:
        """The quality of the mesh in the end: `min`, `mean`, `inverted`, ..."""
        quality: Optional[dict[str, Any]] = self._told.get("quality")
        return quality

    def __getitem__(self, name: str) -> Any:
        return self._told[name]

    def __iter__(self) -> Any:
        return iter(self._told)

    def __len__(self) -> int:
        return len(self._told)

    def __repr__(self) -> str:
        return f"<tombolo.Forecast: {self.outcome}, least scaled Jacobian {self.min_scaled_jacobian}>"


class Command:
    """A command that is no order, such as `Run.pause`, and whether it has taken effect.

    Attributes
    ----------
    id : str
        Its name.
    task : str
        What it does.
    """

    __slots__ = ("_run", "id", "task")

    def __init__(self, run: Run, identity: str, task: str) -> None:
        self._run = run
        self.id = identity
        self.task = task

    @property
    def cycle(self) -> Optional[int]:
        """The step at which it took effect, where the run tells it."""
        kind, data = self._run._state.answers.get(self.id, ("", {}))
        cycle: Optional[int] = data.get("cycle") if kind in ("done", "pipelines") else None
        return cycle

    @property
    def done(self) -> bool:
        """Whether it has taken effect, or was refused."""
        return self._answer() is not None

    def _answer(self) -> Optional[tuple[str, Any]]:
        kind, data = self._run._state.answers.get(self.id, ("", {}))
        if kind == "" or (kind == "pipelines" and data.get("status") != "applied"):
            return None
        return kind, data

    def wait(self, timeout: Optional[float] = None) -> Command:
        """Wait until it has taken effect; of `pause` and `resume`, until `Run.status` shows it too.

        Parameters
        ----------
        timeout : float, optional
            Seconds, at most; without it there is no limit.

        Returns
        -------
        Command
            This command.

        Raises
        ------
        RejectedError
            The run refuses it.
        WaitError
            It did not take effect in time; it may still.
        EndedError, LinkError
            The run has ended before that, unless the command is `stop`, or the connection was lost for good.
        """
        return self._run._reader.carry_out(self._wait(timeout, timeout))

    def _wait(self, timeout: Optional[float], given: Optional[float]) -> Parts[Command]:
        """Wait so many seconds: what is left of those that were given, which an error tells."""
        until, in_vain = moment_after(timeout), f"the command {self.id} ({self.task}) did not take effect"
        try:
            answer = yield self._answer, timeout, in_vain
        except WaitError:
            raise late(in_vain, given) from None
        except EndedError:
            # A run that was asked to stop may end before it has answered.
            if self.task == "stop":
                return self
            raise
        if answer is not None and answer[0] == "error":
            raise RejectedError(answer[1]["message"])
        if self.task in ("pause", "resume"):
            # The status comes after the answer. Somebody else may have had it otherwise by then, or the run may be
            # over: it has taken effect all the same.
            with contextlib.suppress(TomboloError):
                yield self._is_shown, max(min(until - clock.monotonic(), _STATUS), 0.0), "it was not shown"
        return self

    def _is_shown(self) -> bool:
        status = self._run._state.status
        return status is not None and status.paused == (self.task == "pause")

    def __repr__(self) -> str:
        return f"<tombolo.Command {self.id}: {self.task}, {'done' if self.done else 'on its way'}>"
