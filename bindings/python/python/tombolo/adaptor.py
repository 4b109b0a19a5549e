"""The adaptor: what a solver calls in each step."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple, Optional, SupportsIndex, TypeVar, Union

import numpy as np
from numpy.typing import NDArray

from . import _json, _native
from ._values import number
from .errors import ConfigurationError
from .mesh import Mesh

__all__ = ["Adaptor", "Motion", "Steering", "SurfaceMotion"]

Document = Union[str, "os.PathLike[str]", Mapping[str, Any], Sequence[Any]]
Range = tuple[float, float, float]
Given = TypeVar("Given")
# The settings of a run, as the library takes them.
_Given = tuple[
    Optional[_json.Source],
    Optional[_json.Source],
    Optional[str],
    list[tuple[str, float, float, float]],
    list[tuple[str, str]],
    Optional[str],
]

_CONDITIONS = "'inflow', 'outflow' or 'wall'"


class SurfaceMotion:
    """The motion of the boundary's vertices alone, for a solver that moves its volume by itself.

    Attributes
    ----------
    vertices : array of shape (b,), uint32
        The vertices: numbers into the points that the solver lends. They stay the same in the whole run.
    coordinates, displacement, velocity : arrays of shape (b, 2) or (b, 3)
        Of each of these vertices what `Motion` has of all, in the same units.
    """

    __slots__ = ("_motion",)

    def __init__(self, motion: _native.Motion) -> None:
        self._motion = motion

    @property
    def vertices(self) -> NDArray[np.uint32]:
        """The vertices of the boundary, by their numbers among the points that the solver lends."""
        return self._motion.surface_vertices

    @property
    def coordinates(self) -> NDArray[np.float64]:
        """The coordinates of each vertex of the boundary at the end of the step, in the unit of length of the mesh."""
        return self._motion.surface_coordinates

    @property
    def displacement(self) -> NDArray[np.float64]:
        """How far each vertex of the boundary moves over the step: from the coordinates as they were lent.

        It is in the unit of length of the mesh.
        """
        return self._motion.surface_displacement

    @property
    def velocity(self) -> NDArray[np.float64]:
        """The velocity of each vertex of the boundary: `displacement / time_step`; 0 in a steady solver.

        It is in the unit of length of the mesh, divided by the solver's unit of time.
        """
        return self._motion.surface_velocity


class Motion:
    """A motion of the mesh over one step.

    It is asked for, not assumed to be made: the points lent at the next call say whether it was. The arrays cannot be
    written to, have as many columns as the solver's points, are no copies, and may be kept.

    Attributes
    ----------
    coordinates : array of shape (n, 2) or (n, 3)
        The coordinates of each vertex at the end of the step, in the unit of length of the mesh. With every order taken
        back they are the reference's, bit for bit.
    displacement : array of that shape
        From the coordinates as they were lent to these, in the same unit.
    velocity : array of that shape
        `displacement / time_step`, for an ALE solver: in the unit of length of the mesh, divided by the solver's unit
        of time; 0 in a steady solver.
    surface : SurfaceMotion
        The motion of the boundary's vertices alone.
    order : str
        The order's name.
    shape : tuple of int
        The shape of the order's schedule that the mesh is on its way to, or reaches, counted from 1, and how many there
        are.
    position : float
        Where on the way of the order the mesh is at the end of the step, counted in shapes.
    """

    __slots__ = ("_motion",)

    def __init__(self, motion: _native.Motion) -> None:
        self._motion = motion

    @property
    def coordinates(self) -> NDArray[np.float64]:
        """The coordinates of each vertex at the end of the step, in the unit of length of the mesh."""
        return self._motion.coordinates

    @property
    def displacement(self) -> NDArray[np.float64]:
        """How far each vertex moves over the step: from the coordinates as they were lent, in the same unit."""
        return self._motion.displacement

    @property
    def velocity(self) -> NDArray[np.float64]:
        """The velocity of each vertex, `displacement / time_step`, for an ALE solver; 0 in a steady one.

        It is in the unit of length of the mesh, divided by the solver's unit of time.
        """
        return self._motion.velocity

    @property
    def surface(self) -> SurfaceMotion:
        """The motion of the boundary's vertices alone."""
        return SurfaceMotion(self._motion)

    @property
    def order(self) -> str:
        """The order's name."""
        return self._motion.order

    @property
    def shape(self) -> tuple[int, int]:
        """The shape that is on its way, counted from 1, and how many there are."""
        return self._motion.shape

    @property
    def position(self) -> float:
        """Where on the way of the order the mesh is at the end of the step, counted in shapes."""
        return self._motion.position

    def __repr__(self) -> str:
        shape, shapes = self.shape
        return f"<tombolo.Motion of order {self.order}, shape {shape} of {shapes}>"


class Steering(NamedTuple):
    """What the solver is asked to do in the step that follows.

    Attributes
    ----------
    motion : Motion or None
        Where to move the mesh over the step; None: it stays where it is.
    stop : bool
        Whether the solver should end. Once true it stays true.
    parameters : mapping of str to float
        All parameters and their values now, each in the unit that the solver has it in.
    """

    motion: Optional[Motion]
    stop: bool
    parameters: Mapping[str, float]


def _handle(communicator: Any) -> Optional[int]:
    """The handle by which the library knows a communicator; None where this process is all of it."""
    try:
        size, handle = communicator.Get_size(), communicator.py2f()
    except Exception as error:
        # Of the null communicator and of one that was freed mpi4py raises what is no error of Python's own.
        raise ConfigurationError(
            f"the communicator: found {communicator!r} ({error}), expected one of mpi4py that this process is in"
        ) from None
    if _native.DISTRIBUTED:
        return int(handle)
    if size > 1:
        raise ConfigurationError(
            f"the communicator: found {size} ranks, and this package was built without MPI; "
            "expected one that was built with the feature 'distributed'"
        )
    return None


def _ranges(parameters: Optional[Mapping[str, Range]]) -> list[tuple[str, float, float, float]]:
    ranges = []
    for name, given in _named(parameters, "parameters", "(value, minimum, maximum)"):
        try:
            value, minimum, maximum = (number(it, name) for it in given)
        except (TypeError, ValueError):
            raise ConfigurationError(
                f"parameter '{name}': found {given!r}, expected (value, minimum, maximum)"
            ) from None
        ranges.append((name, value, minimum, maximum))
    return ranges


def _named(given: Optional[Mapping[str, Given]], title: str, expected: str) -> Iterable[tuple[str, Given]]:
    """The names in a dict, and what it says of each."""
    if given is None:
        return ()
    if not isinstance(given, Mapping):
        raise ConfigurationError(f"{title}: found {given!r}, expected a dict from names to {expected}")
    for name in given:
        if not isinstance(name, str) or not name:
            raise ConfigurationError(f"{title}: found the name {name!r}, expected a text that is not empty")
    return given.items()


class Adaptor:
    """Links a solver to its viewers and to the orders that change its shape.

    Made before the first step, called in each step, closed after the last: best by `with`. On several ranks every
    call is collective.

    Parameters
    ----------
    configuration : path, dict or None
        What to watch, stream and write, and how orders become mesh motion: a file, or what would be in it. None:
        nothing is watched.
    parameters : dict, optional
        Numbers of the solver that can be steered, each with its value and its range: ``{"inflow": (10, 0, 40)}``.
    conditions : dict, optional
        What features of the mesh are to the flow, `inflow`, `outflow` or `wall`: ``{"inlet": "inflow"}``. Viewers hold
        inflow and outflow still until somebody wants otherwise.
    orders : path or list, optional
        Orders known beforehand, which take effect at their cycle exactly.
    replay : path, optional
        A journal whose run is carried out again, in place of `orders`.
    output : path, optional
        The directory of the files that pipelines write and of the journal. Left out: the current one.
    communicator : mpi4py.MPI.Comm, optional
        The ranks that the mesh is distributed over. Left out: all ranks there are where this package was built with
        the feature `distributed`, else this process.

    Raises
    ------
    ConfigurationError
        Something is wrong with the configuration, the orders, a parameter or a condition: the text names each line and
        column.
    FailedError
        An address is in use, or a file cannot be written.

    Notes
    -----
    On several ranks what is wrong on one is an error on all of them, of the same class. An exception that ends the
    `with` block on one rank ends the run on the others too: their next `execute` raises `FailedError`. Where they wait
    for that rank in messages of their own, ``python -m mpi4py solver.py`` ends them. `orders` and the orders of
    `report` are told on rank 0 alone.

    Examples
    --------
    A solver of ten steps. An order squeezes its box at cycle 2, another restores it at cycle 6:

    >>> import numpy as np, tombolo
    >>> points = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    >>> cells = {"hexahedron": np.array([[0, 1, 3, 2, 4, 5, 7, 6]])}
    >>> faces = {"top": np.array([[4, 5, 7, 6]]), "bottom": np.array([[0, 1, 3, 2]])}
    >>> squeeze = {"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, -0.2]}}
    >>> orders = [{"at": {"cycle": 2}, "order": {"edits": [squeeze]}}, {"at": {"cycle": 6}, "order": {"undo": 1}}]
    >>> mesh = tombolo.Mesh(points, cells, {"temperature": np.ones(8)}, faces=faces)
    >>> heights = []
    >>> with tombolo.Adaptor({"version": 1}, parameters={"heating": (1, 0, 10)}, orders=orders) as adaptor:
    ...     for cycle in range(10):
    ...         steering = adaptor.execute(cycle, 0.1 * cycle, 0.1, {"solid": mesh})
    ...         if steering.stop:
    ...             break
    ...         if steering.motion is not None:
    ...             points[:] = steering.motion.coordinates
    ...         heights.append(round(float(points[:, 2].max()), 3))
    >>> heights
    [1.0, 1.0, 0.8, 0.8, 0.8, 0.8, 1.0, 1.0, 1.0, 1.0]
    >>> [order["status"] for order in adaptor.report["orders"]]
    ['applied', 'applied']
    """

    def __init__(
        self,
        configuration: Optional[Document] = None,
        *,
        parameters: Optional[Mapping[str, Range]] = None,
        conditions: Optional[Mapping[str, str]] = None,
        orders: Optional[Document] = None,
        replay: Optional[Union[str, os.PathLike[str]]] = None,
        output: Optional[Union[str, os.PathLike[str]]] = None,
        communicator: Any = None,
    ) -> None:
        handle = None if communicator is None else _handle(communicator)
        mistake: Optional[Exception] = None
        given: _Given = (None, None, None, [], [], None)
        try:
            given = (
                None if configuration is None else _json.source(configuration, "configuration"),
                None if orders is None else _json.source(orders, "orders"),
                None if replay is None else _json.file(replay, "replay"),
                _ranges(parameters),
                [(name, str(condition)) for name, condition in _named(conditions, "conditions", _CONDITIONS)],
                None if output is None else _json.file(output, "output"),
            )
        except Exception as error:
            mistake = error
        try:
            # What is wrong on one rank is told on all: the others would wait for it.
            self._run: _native.Run = _native.Run(*given, handle, None if mistake is None else str(mistake))
        except ConfigurationError as error:
            raise error if mistake is None else mistake from None
        self._still = Steering(None, False, MappingProxyType(dict(self._run.parameters)))

    def execute(
        self,
        cycle: SupportsIndex,
        time: float,
        time_step: float,
        channels: Union[Mapping[str, Union[Mesh, Mapping[str, Any]]], Mesh],
    ) -> Steering:
        """Show the solver's present state, and learn what to do in the step that follows.

        The arrays are borrowed for the length of the call and must not change meanwhile; other threads of Python run.
        Where nothing is due, nothing is copied, and it costs some microseconds. While a run is paused, or waits for its
        first viewer, the handlers of signals run, on rank 0 alone. What one raises, as Ctrl-C does, stops the run, and
        is raised here.

        Parameters
        ----------
        cycle : int
            The number of the step, from 0 on.
        time : float
            The simulated time, in the solver's unit of time.
        time_step : float
            The length of the step that follows, in the same unit; 0 in a steady solver.
        channels : dict from names to meshes
            The meshes, each a `Mesh` or a dict of what one is made from. The first is the one that orders change,
            unless the configuration names another. One mesh alone is the channel `mesh`.

        Returns
        -------
        Steering
            The motion that is asked for, whether to stop, and the parameters.

        Raises
        ------
        MeshError
            Arrays that do not fit together. Nothing was done: the solver may mend it and call again.
        StepError
            A negative cycle, a time that is not finite, or no channel.
        CallError
            The adaptor is closed, or in a call of another thread.
        """
        asked = self._run.execute(cycle, time, time_step, channels)
        if asked is None:
            return self._still
        motion, stop, parameters = asked
        if parameters is not None or stop != self._still.stop:
            known = self._still.parameters if parameters is None else MappingProxyType(parameters)
            self._still = Steering(None, stop, known)
        if motion is None:
            return self._still
        return self._still._replace(motion=Motion(motion))

    def looks_at(self, cycle: SupportsIndex, time: float, time_step: float) -> bool:
        """Whether anything at this step looks at the mesh and its fields.

        A solver that has to compute a field only to show it asks first.

        Parameters
        ----------
        cycle, time, time_step : int, float, float
            The step, as `execute` takes it.

        Returns
        -------
        bool
            Whether `execute` will look at them, such as for a pipeline that is due or for an order.

        Raises
        ------
        StepError
            As of `execute`.
        CallError
            The adaptor is closed, or in a call of another thread.
        """
        return self._run.looks_at(cycle, time, time_step)

    @property
    def link(self) -> Optional[str]:
        """What a viewer opens, and `connect` takes, with the secret of those who may steer; None without a server.

        It is for programs and can be used any number of times: do not print it where others read. `invitation` is for
        people.
        """
        return self._run.link

    @property
    def watching_link(self) -> Optional[str]:
        """The link of those who watch and can never steer, which `connect` takes too; None without a server."""
        return self._run.watching_link

    def invitation(self) -> Optional[str]:
        """What to print for a person to open the run; None without a server.

        The file ``tombolo-PORT.link`` is written in the directory of the output, with the links for driving and for
        watching; only its owner can read it, and `connect` and other programs take it. On a terminal the text holds a
        link that opens one browser, once, and lets no program in. Elsewhere, as in the log of a batch job, it names the
        file alone.

        Returns
        -------
        str or None
            The text, of one or more lines.

        Raises
        ------
        OSError
            The file cannot be written.
        CallError
            The adaptor is closed, or in a call of another thread.
        """
        return self._run.invitation(sys.stdout.isatty())

    @property
    def parameters(self) -> Mapping[str, float]:
        """The parameters and their values now, each in the unit that the solver has it in."""
        return self._still.parameters

    @property
    def orders(self) -> list[dict[str, Any]]:
        """The orders so far, and what became of each; on several ranks they are told on rank 0 alone."""
        if self._run.ended:
            return list(self.report["orders"])
        orders: list[dict[str, Any]] = _json.loads(self._run.orders)
        return orders

    def stop(self) -> None:
        """Ask the solver to end: the next `execute` says so. From any thread, also while another is in `execute`.

        Raises
        ------
        CallError
            The run has ended, or this process was forked from that of the run.
        """
        self._run.stop()

    def finalize(self) -> dict[str, Any]:
        """End the run, and return its report. The end of a `with` block does so too; a second call changes nothing.

        Returns
        -------
        dict
            Calls, orders, seconds by part, bytes streamed, the cost and monitors of each pipeline.

        Raises
        ------
        FailedError
            A file could not be written; the report is there all the same.
        """
        if not self._run.ended:
            self._run.finalize()
        return self.report

    @property
    def report(self) -> dict[str, Any]:
        """The report of a run that has ended; empty before."""
        report: dict[str, Any] = _json.loads(self._run.report or "{}")
        return report

    def __enter__(self) -> Adaptor:
        return self

    def __exit__(self, kind: object, error: Optional[BaseException], trace: object) -> None:
        if error is None:
            self.finalize()
            return
        try:
            if not self._run.ended:
                self._run.leave(f"{type(error).__name__}: {error}")
            self.finalize()
        except Exception as other:
            # The first error says why the run is over.
            print(f"tombolo: {other}", file=sys.stderr)

    def __repr__(self) -> str:
        run = getattr(self, "_run", None)
        return f"<tombolo.Adaptor, {'not begun' if run is None else 'ended' if run.ended else 'under way'}>"
