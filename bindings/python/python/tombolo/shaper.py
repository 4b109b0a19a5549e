"""Other shapes for a mesh, without a run."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, Optional, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _json, _native
from ._identity import by_identity
from ._mesh_checks import check_faces, check_found, degrees, part, what_it_is
from ._meshio import of_meshio
from ._waiting import in_thread
from .errors import MeshError
from .mesh import Cells, Faces, Mesh
from .orders import Forecast
from .views import Surface

if TYPE_CHECKING:
    from .orders import Edits

__all__ = ["Progress", "Shape", "Shaper", "Skeleton"]

Result = TypeVar("Result")
Progress = Callable[[str, float], object]
"""Called about ten times a second with the phase and the seconds so far; what it raises ends the work."""


@by_identity
class Shape(NamedTuple):
    """A mesh in another shape.

    Attributes
    ----------
    points : array of shape (n, 2) or (n, 3)
        The coordinates of each vertex in the unit of length of the mesh, in as many columns as it was given with.
    fraction : float
        The fraction of the edits that was done: below 1 where the guard clamped them.
    min_scaled_jacobian : float or None
        The least scaled Jacobian of all meshes on the way.
    quality : dict
        The scaled Jacobian in the end: `min`, `mean`, `max`, how many cells are `inverted`, the `worst` of them, ...
    details : dict
        All of that, and how it was found: `iterations`, `sub_steps`, `largest_displacement` in the unit of length of
        the mesh, `seconds`.
    """

    points: NDArray[np.float64]
    fraction: float
    min_scaled_jacobian: Optional[float]
    quality: dict[str, Any]
    details: dict[str, Any]

    def __repr__(self) -> str:
        return f"<tombolo.Shape of {len(self.points)} points, least scaled Jacobian {self.quality['min']:.4f}>"


@by_identity
class Skeleton(NamedTuple):
    """The curve skeleton of a surface: polylines along its middle.

    Attributes
    ----------
    nodes : array of shape (k, 3), float64
        The coordinates of each node, in the unit of length of the mesh.
    radii : array of shape (k,), float64
        How far the surface is from each node, in the same unit.
    curves : list of arrays, uint32
        The nodes of each curve, from end to end; a closed one ends with its first.
    node_of_vertex : array of shape (b,), uint32
        The node that each vertex of the surface goes with.
    """

    nodes: NDArray[np.float64]
    radii: NDArray[np.float64]
    curves: list[NDArray[np.uint32]]
    node_of_vertex: NDArray[np.uint32]

    def __repr__(self) -> str:
        return f"<tombolo.Skeleton: {len(self.nodes)} nodes on {len(self.curves)} curves>"


def _order(edits: Edits, settings: Mapping[str, Any]) -> tuple[str, str]:
    if "replaces" in settings:
        raise TypeError("replaces: without a run there is no order that could be replaced")
    return _json.order(edits, settings)


_EXPECTED = "a tombolo.Mesh, a mesh of meshio or PyVista, a vtkDataSet, or coordinates with their cells"


def _with_phase(progress: Optional[Progress], phase: Callable[[], str]) -> Optional[Callable[[float], object]]:
    """What is called with the seconds alone."""
    if progress is None:
        return None
    return lambda seconds: progress(phase(), seconds)


class Shaper:
    """Gives a mesh other shapes: what `tombolo edit` does, to the bit.

    The operators are set up once, by the first shape, and serve all that follow. Every shape is measured from the mesh
    as it was given. Work ends with Ctrl-C, and with `cancel` from another thread, once the step of a set-up or of a
    factor that was begun is finished.

    Parameters
    ----------
    mesh : Mesh, meshio.Mesh, pyvista mesh, vtkDataSet, or array of shape (n, 2) or (n, 3)
        The mesh, or the coordinates of its vertices. It is copied. Features are those that the program finds in the
        file that it was read from: Gmsh's physical surfaces by name, where meshio has read them (PyVista does not keep
        the names), and the array `features` of VTK. Without these, meshio's named sets of faces (`cell_sets`, such as
        those of Abaqus, MED and XDMF).
    cells : dict, optional
        With coordinates: the cells, as `Mesh` takes them.
    faces, features : dict, optional
        With coordinates: named parts of the boundary, as `Mesh` takes them, under either name.
    angle : float, optional
        Name the parts of the surface between edges of so many degrees or more, whatever parts the mesh names.
    progress : callable, optional
        As of `shape`, while the mesh is read and its surface found; the phase is `"mesh"`.

    Raises
    ------
    MeshError
        It is no mesh whose shape could be changed, such as one with a feature whose faces are all in others before it,
        or the angle is not from 0 to 180 degrees: the text says why, and where.

    Examples
    --------
    >>> import numpy as np, tombolo
    >>> points = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    >>> cells = {"hexahedron": np.array([[0, 1, 3, 2, 4, 5, 7, 6]])}
    >>> shaper = tombolo.Shaper(points, cells, {"top": [[4, 5, 7, 6]], "bottom": [[0, 1, 3, 2]]})
    >>> [feature["name"] for feature in shaper.features]
    ['top', 'bottom', 'untagged']
    >>> shape = shaper.shape([{"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, 0.5]}}])
    >>> float(shape.points[:, 2].max()), shape.quality["inverted"]
    (1.5, 0)
    """

    def __init__(
        self,
        mesh: Any,
        cells: Optional[Cells] = None,
        faces: Optional[Faces] = None,
        *,
        features: Optional[Faces] = None,
        angle: Optional[float] = None,
        progress: Optional[Progress] = None,
    ) -> None:
        if faces is not None and features is not None:
            raise MeshError("features: found faces beside them, expected one of the two: they are the same")
        faces = features if faces is None else faces
        if cells is not None:
            mesh = Mesh(mesh, cells, faces=faces)
        elif faces is not None:
            raise MeshError("faces: found them without cells, expected both or neither: a mesh has its own parts")
        elif not isinstance(mesh, (Mesh, Mapping)):
            # PyVista's meshes have `cells_dict` too, which would be made of all their cells.
            # The type is asked: meshio itself would join its blocks, and fail for polygons of several sizes.
            if hasattr(mesh, "point_sets") and hasattr(type(mesh), "cells_dict"):
                mesh = of_meshio(mesh)
            elif hasattr(mesh, "GetCellData"):
                from . import vtk

                mesh = vtk.to_mesh(mesh)
            else:
                raise MeshError(f"found {what_it_is(mesh)}, expected {_EXPECTED}")
        elif isinstance(mesh, Mapping) and "points" not in mesh and len(mesh) != 1:
            raise MeshError(f"found {len(mesh)} meshes ({', '.join(map(str, mesh))}), expected one")
        faces = part(mesh, "faces")
        check_faces(faces)
        make = functools.partial(_native.Shaper, mesh, degrees(angle))
        self._shaper = in_thread(make, _with_phase(progress, lambda: "mesh"))
        if angle is None:
            check_found(faces, {feature["name"] for feature in self.features})

    # ---- What the mesh is.

    @property
    def features(self) -> list[dict[str, Any]]:
        """The named parts of the surface, each with `name`, `faces`, `vertices`, `area` and `bounds`.

        The bounds are in the unit of length of the mesh, the area in its square.
        """
        features: list[dict[str, Any]] = _json.loads(self._shaper.features())
        return features

    @property
    def surface(self) -> Surface:
        """The surface of the mesh."""
        return Surface(**self._shaper.surface())

    def skeleton(self, *, progress: Optional[Progress] = None) -> Skeleton:
        """Find the curve skeleton of the surface, on which an edit `skeleton` drags nodes.

        Parameters
        ----------
        progress : callable, optional
            As of `shape`; the phase is `"skeleton"`.

        Returns
        -------
        Skeleton
            The curves with their nodes.

        Raises
        ------
        MeshError
            The surface has no skeleton: the text says why.
        RejectedError
            `cancel` gave it up.
        CallError
            Another thread is in a call of this shaper.
        """
        return Skeleton(**self._work(self._shaper.skeleton, progress, lambda: "skeleton"))

    def quality(self, points: Optional[ArrayLike] = None) -> dict[str, Any]:
        """Measure the scaled Jacobian of the mesh, or of it with other points.

        Parameters
        ----------
        points : array of shape (n, 2) or (n, 3), optional
            The coordinates of each vertex in the unit of length of the mesh, in as many columns as it was given with.
            Left out: the mesh as it is.

        Returns
        -------
        dict
            `min`, `mean`, `max`, how many cells are `inverted`, a `histogram` of 20 classes from -1 to 1, and the
            `worst` cells. In a mesh with volume cells only these are measured.

        Raises
        ------
        MeshError
            There is not one row for each vertex, another number of columns, or a coordinate that is not finite.
        """
        quality: dict[str, Any] = _json.loads(self._shaper.quality(points))
        return quality

    def scaled_jacobians(self, points: Optional[ArrayLike] = None) -> NDArray[np.float64]:
        """Measure the scaled Jacobian of each cell of the mesh, or of it with other points.

        Parameters
        ----------
        points : array of shape (n, 2) or (n, 3), optional
            As of `quality`.

        Returns
        -------
        array of shape (m,), float64
            That of each cell, in the order of the cells; NaN for cells of a lower dimension than the mesh's.

        Raises
        ------
        MeshError
            As of `quality`.
        """
        return self._shaper.scaled_jacobians(points)

    # ---- Other shapes.

    def shape(self, edits: Edits, *, progress: Optional[Progress] = None, **settings: Mapping[str, Any]) -> Shape:
        """Find the shape that edits make, and see to it that no cell is inverted there or on the way.

        Parameters
        ----------
        edits : list of dict, dict or path
            The edits, or an order with its settings, or a JSON file of either. Lengths are in the unit of length of the
            mesh, angles in degrees.
        progress : callable, optional
            ``progress(phase, seconds)`` is called at once, and then about ten times a second. The phase is `"surface"`,
            `"volume"` or `"guard"`, the check of the meshes on the way; it may come back where a mesh is mended.
        **settings : dict
            `deform`: how the volume follows; `guard`: what the mesh must keep to; `schedule`: in how many shapes the
            way is looked at.

        Returns
        -------
        Shape
            The points of the mesh in its new shape, and its quality.

        Raises
        ------
        ConfigurationError
            Something is wrong with the edits, with line, column and path.
        RejectedError
            The mesh would be broken, or one of two coordinates would leave its plane. The text says where; `report` has
            the fraction that would pass. Or `cancel` gave it up.
        CallError
            Another thread is in a call of this shaper.
        """
        text, name = _order(edits, settings)
        points, told = self._work(lambda: self._shaper.shape(text, name), progress)
        details = _json.loads(told)
        return Shape(points, details["fraction"], details["min_scaled_jacobian"], details["quality"], details)

    def forecast(self, edits: Edits, *, progress: Optional[Progress] = None, **settings: Mapping[str, Any]) -> Forecast:
        """Find out what edits would come to, also where they would be rejected. Parameters are as of `shape`.

        Returns
        -------
        Forecast
            What they would come to. Where `cancel` gave it up, it is `rejected`, and the reason says so.

        Raises
        ------
        ConfigurationError, CallError
            As of `shape`.
        """
        text, name = _order(edits, settings)
        return Forecast(_json.loads(self._work(lambda: self._shaper.forecast(text, name), progress)))

    def displacement(self, edits: Edits, *, progress: Optional[Progress] = None) -> NDArray[np.float64]:
        """Find how far edits move each vertex of the surface.

        An edit ``{"displacement": {"vertices": surface.vertices, "values": ...}}`` takes it again.

        Parameters
        ----------
        edits : list of dict, dict or path
            As of `shape`.
        progress : callable, optional
            As of `shape`.

        Returns
        -------
        array of shape (b, 3), float64
            A row `(x, y, z)` for each of `surface.points`, in the unit of length of the mesh.

        Raises
        ------
        ConfigurationError
            Something is wrong with the edits, with line, column and path.
        RejectedError
            The edits cannot be carried out: the text says why. Or `cancel` gave it up.
        CallError
            Another thread is in a call of this shaper.
        """
        text, name = _json.order(edits, {})
        return self._work(lambda: self._shaper.displacement(text, name), progress)

    def cancel(self) -> None:
        """Have the work under way given up, from any thread: it raises `RejectedError`, or forecasts a rejection."""
        self._shaper.cancel()

    def _work(
        self, call: Callable[[], Result], progress: Optional[Progress], phase: Optional[Callable[[], str]] = None
    ) -> Result:
        """A call that can be interrupted: it is given up before the mesh can be used again."""
        self._shaper.renew()
        return in_thread(call, _with_phase(progress, phase or self._shaper.phase), self._shaper.cancel)

    def __repr__(self) -> str:
        return f"<tombolo.Shaper, features: {', '.join(feature['name'] for feature in self.features)}>"
