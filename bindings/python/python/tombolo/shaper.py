"""Other shapes for a mesh, without a run."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Optional, TypeVar, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _json, _native
from ._identity import by_identity
from ._waiting import in_thread
from .errors import MeshError
from .mesh import Cells, Faces, Mesh, faces_of_features
from .orders import Forecast
from .views import Surface

if TYPE_CHECKING:
    from .orders import Edits

__all__ = ["Progress", "Shape", "Shaper", "Skeleton"]

Result = TypeVar("Result")
Progress = Callable[[str, float], object]
"""Called about ten times a second with the stage and the seconds so far; what it raises ends the work."""


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


#: The dimension of each of meshio's types that may stand beside the cells of a mesh.
_DIMENSIONS = {
    **{"vertex": 0, "line": 1, "triangle": 2, "quad": 2},
    **{"tetra": 3, "hexahedron": 3, "wedge": 3, "pyramid": 3},
}


#: The vertices of a cell of each of meshio's linear types.
_CORNERS = {"line": 2, "triangle": 3, "quad": 4, "tetra": 4, "hexahedron": 8, "wedge": 6, "pyramid": 5}


def _check_linear(kind: str) -> None:
    """An error for meshio's cells with vertices on their edges, and for its polyhedra."""
    linear = kind.rstrip("0123456789")
    if linear == "polyhedron":
        raise MeshError("meshio's mesh: found polyhedra, expected cells of a type such as 'tetra' or 'hexahedron'")
    if linear != kind and linear in _CORNERS:
        corners = f"mesh.cells_dict['{kind}'][:, :{_CORNERS[linear]}]"
        raise MeshError(
            f"meshio's mesh: found cells of type '{kind}', expected linear cells: their corners alone are "
            f"{{'{linear}': {corners}}}, beside mesh.points"
        )


def _of_meshio(mesh: Any) -> Mesh:
    # What meshio calls the numbers of Gmsh's groups, and what the program calls those of features in a file of VTK.
    key = next((key for key in ("gmsh:physical", "features") if key in mesh.cell_data), None)
    groups = mesh.cell_data[key] if key else [np.full(len(block.data), -1) for block in mesh.cells]
    blocks: dict[str, list[tuple[NDArray[Any], NDArray[Any]]]] = {}
    for block, numbers in zip(mesh.cells, groups):
        blocks.setdefault(block.type, []).append((block.data, numbers))
    parts: dict[str, tuple[NDArray[Any], NDArray[Any]]] = {}
    for kind, of_kind in blocks.items():
        rows, numbers = (np.concatenate(arrays) for arrays in zip(*of_kind))
        if key == "gmsh:physical":
            # Version 2.2 has a cell of several groups once for each: the first holds.
            first = np.sort(np.unique(rows, axis=0, return_index=True)[1])
            # 0 is that of no group; one below 0 says that a surface is turned round in its group.
            rows, numbers = rows[first], np.where(numbers == 0, -1, np.abs(numbers))[first]
        parts[kind] = rows, numbers
    for kind in parts:
        _check_linear(kind)
    # Faces and edges beside volume cells are of the boundary. A type that is not known is kept, and refused by name.
    most = max((_DIMENSIONS.get(kind, 0) for kind in parts), default=0)
    cells: dict[Union[str, int], ArrayLike] = {
        kind: rows for kind, (rows, _) in parts.items() if _DIMENSIONS.get(kind, most) == most
    }
    pairs = {name: np.ravel(pair) for name, pair in mesh.field_data.items()}
    names = {int(pair[0]): name for name, pair in pairs.items() if len(pair) == 2 and pair[1] == 2}
    faces = faces_of_features(
        ((kind, rows, numbers) for kind, (rows, numbers) in parts.items() if _DIMENSIONS.get(kind) == 2), names
    )
    faces = _sets_of_meshio(mesh) if faces is None else faces
    return Mesh(
        mesh.points,
        cells,
        faces=faces,
        vertex_features=mesh.point_data.get("features") if faces is None else None,
    )


def _sets_of_meshio(mesh: Any) -> Optional[Faces]:
    """The faces in each of meshio's named sets of cells."""
    named: dict[str, dict[Union[str, int], ArrayLike]] = {}
    for name, chosen in mesh.cell_sets.items():
        # Sets such as `gmsh:bounding_entities` are meshio's own, and no sets of cells.
        parts = [] if name.startswith("gmsh:") else zip(mesh.cells, chosen)
        of_kind: dict[Union[str, int], list[NDArray[Any]]] = {}
        for block, rows in parts:
            if rows is not None and len(rows) and _DIMENSIONS.get(block.type) == 2:
                of_kind.setdefault(block.type, []).append(block.data[np.asarray(rows, np.int64)])
        if of_kind:
            named[name] = {kind: np.concatenate(rows) for kind, rows in of_kind.items()}
    return named or None


def _order(edits: Edits, settings: Mapping[str, Any]) -> tuple[str, str]:
    if "replaces" in settings:
        raise TypeError("replaces: without a run there is no order that could be replaced")
    return _json.order(edits, settings)


_EXPECTED = "a tombolo.Mesh, a mesh of meshio or PyVista, a vtkDataSet, or coordinates with their cells"


def _check_faces(faces: Optional[Faces]) -> None:
    """An error where a feature has no faces, by its name."""
    for name, given in faces.items() if isinstance(faces, Mapping) else ():
        parts: Iterable[Any] = given.values() if isinstance(given, Mapping) else [given]
        if all(hasattr(part, "__len__") and len(part) == 0 for part in parts):
            raise MeshError(f"the feature '{name}' has no faces, expected at least one")


def _blocks(given: Any) -> str:
    """The blocks of one of VTK's data objects of several, by their names."""
    from vtkmodules.vtkCommonDataModel import vtkCompositeDataSet

    names = []
    for number in range(given.GetNumberOfBlocks()):
        about = given.GetMetaData(number) if given.HasMetaData(number) else None
        name = None if about is None else about.Get(vtkCompositeDataSet.NAME())
        names.append(f"block {number}" if name is None else f"'{name}'")
    return ", ".join(names) or "no block"


def _what_it_is(given: Any) -> str:
    """What was given in place of a mesh, and what would have made one of it."""
    if hasattr(given, "GetNumberOfBlocks"):
        joined = ", or all together: mesh.combine()" if hasattr(given, "combine") else ""
        return f"a {type(given).__name__} of {_blocks(given)} (take one of them{joined})"
    if isinstance(given, (str, os.PathLike)):
        return f"the name of a file, '{os.fspath(given)}' (read it first: tombolo.Shaper(meshio.read(...)))"
    if isinstance(given, (np.ndarray, Sequence)):
        return "coordinates without cells (tombolo.Shaper(points, cells))"
    return f"a {type(given).__name__}"


def _with_stage(progress: Optional[Progress], stage: Callable[[], str]) -> Optional[Callable[[float], object]]:
    """What is called with the seconds alone."""
    if progress is None:
        return None
    return lambda seconds: progress(stage(), seconds)


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
        As of `shape`, while the mesh is read and its surface found; the stage is `"mesh"`.

    Raises
    ------
    MeshError
        It is no mesh whose shape could be changed: the text says why, and where.

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
            if hasattr(mesh, "point_sets") and hasattr(mesh, "cells_dict"):
                mesh = _of_meshio(mesh)
            elif hasattr(mesh, "GetCellData"):
                from . import vtk

                mesh = vtk.to_mesh(mesh)
            else:
                raise MeshError(f"found {_what_it_is(mesh)}, expected {_EXPECTED}")
        elif isinstance(mesh, Mapping) and "points" not in mesh and len(mesh) != 1:
            raise MeshError(f"found {len(mesh)} meshes ({', '.join(map(str, mesh))}), expected one")
        _check_faces(mesh.faces if isinstance(mesh, Mesh) else mesh.get("faces"))
        make = functools.partial(_native.Shaper, mesh, angle)
        self._shaper = in_thread(make, _with_stage(progress, lambda: "mesh"))

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
            As of `shape`; the stage is `"skeleton"`.

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
            ``progress(stage, seconds)`` is called at once, and then about ten times a second. The stage is `"surface"`,
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
        self, call: Callable[[], Result], progress: Optional[Progress], stage: Optional[Callable[[], str]] = None
    ) -> Result:
        """A call that can be interrupted: it is given up before the mesh can be used again."""
        self._shaper.renew()
        return in_thread(call, _with_stage(progress, stage or self._shaper.stage), self._shaper.cancel)

    def __repr__(self) -> str:
        return f"<tombolo.Shaper, features: {', '.join(feature['name'] for feature in self.features)}>"
