"""Tombolo: watch a running simulation in a browser, and change the shape of its domain while it runs.

Three ways in:

- **In a solver**: an `Adaptor` is shown the mesh and fields in each step, and says what to do in the next.
- **From outside**: `connect` to a run that goes on elsewhere; a `Run` watches and steers it.
- **Without a run**: a `Shaper` gives a mesh another shape.

Three modules are imported by themselves: `tombolo.vtk` for data objects of VTK, `tombolo.background` for programs
with an interface, `tombolo.jupyter` for notebooks.

What a class is for and how it is used is in its own help, such as ``help(tombolo.Shaper)``. See docs/python.md for a
tutorial.
"""

from ._native import DISTRIBUTED as _DISTRIBUTED
from ._native import VERSION as __version__
from .adaptor import Adaptor, Motion, Steering, SurfaceMotion
from .aio import AsyncRun
from .errors import (
    CallError,
    ConfigurationError,
    EndedError,
    FailedError,
    LinkError,
    MeshError,
    NotDriverError,
    RejectedError,
    StepError,
    TomboloError,
    WaitError,
)
from .events import Event
from .mesh import Field, Mesh
from .monitors import Monitors, MonitorTable
from .orders import Command, Forecast, Order
from .run import Run, connect
from .shaper import Shape, Shaper, Skeleton
from .state import Parameter, Status
from .views import Surface, View, Views

distributed: bool = _DISTRIBUTED
"""Whether this package was built with MPI."""

__all__ = [
    "Adaptor",
    "AsyncRun",
    "CallError",
    "Command",
    "ConfigurationError",
    "EndedError",
    "Event",
    "FailedError",
    "Field",
    "Forecast",
    "LinkError",
    "Mesh",
    "MeshError",
    "MonitorTable",
    "Monitors",
    "Motion",
    "NotDriverError",
    "Order",
    "Parameter",
    "RejectedError",
    "Run",
    "Shape",
    "Shaper",
    "Skeleton",
    "Status",
    "Steering",
    "StepError",
    "Surface",
    "SurfaceMotion",
    "TomboloError",
    "View",
    "Views",
    "WaitError",
    "__version__",
    "connect",
    "distributed",
]
