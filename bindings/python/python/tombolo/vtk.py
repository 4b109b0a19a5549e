"""Meshes, views and surfaces as data objects of VTK: for programs on top of it, such as ParaView and PyVista.

It is imported by itself (``import tombolo.vtk``), and needs VTK 9.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from typing import Any, Optional

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints, vtkStringArray, vtkVersion
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkAppendFilter

from ._mesh_checks import what_it_is
from .errors import MeshError
from .mesh import Mesh, faces_of_features, fan
from .shaper import Shaper, Skeleton
from .views import Surface, View

__all__ = [
    "add",
    "array",
    "of_skeleton",
    "of_surface",
    "of_view",
    "points",
    "set_texts",
    "shaper",
    "texts",
    "to_mesh",
]

#: VTK's numbers of the faces that features can be of.
_TRIANGLE, _STRIP, _POLYGON, _PIXEL, _QUAD = 5, 6, 7, 8, 9
#: Its number of polyhedra, and those of the cells with vertices on their edges that PyVista makes linear.
_POLYHEDRON, _QUADRATIC = 42, range(21, 38)
#: Shapers that are kept, the last ones used.
_KEPT = 4

_SHAPERS: OrderedDict[tuple[object, ...], Shaper] = OrderedDict()


# ---- Arrays beside points and cells.


def array(attributes: Any, name: str) -> Optional[NDArray[Any]]:
    """Find an array of numbers.

    Parameters
    ----------
    attributes : vtkFieldData
        What `GetPointData`, `GetCellData` or `GetFieldData` of a data object returns.
    name : str
        The name of the array.

    Returns
    -------
    array of shape (n,) or (n, k), or None
        A view of VTK's memory; None where there is no such array, or one of texts.
    """
    found = attributes.GetArray(name)
    return None if found is None else np.asarray(vtk_to_numpy(found))


def add(attributes: Any, name: str, values: ArrayLike) -> None:
    """Add a copy of an array.

    Parameters
    ----------
    attributes : vtkFieldData
        What `GetPointData`, `GetCellData` or `GetFieldData` of a data object returns.
    name : str
        The name of the array; one of that name makes way.
    values : array of shape (n,) or (n, k)
        Its numbers.
    """
    made = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
    made.SetName(name)
    attributes.AddArray(made)


def texts(data: Any, name: str) -> Optional[list[str]]:
    """Find the texts that stand under a name in the field data of a data object.

    Parameters
    ----------
    data : vtkDataObject
        The data object.
    name : str
        The name of the texts.

    Returns
    -------
    list of str, or None
        The texts; None where there are none.
    """
    found = data.GetFieldData().GetAbstractArray(name)
    if found is None or not found.IsA("vtkStringArray"):
        return None
    return [found.GetValue(index) for index in range(found.GetNumberOfValues())]


def set_texts(data: Any, name: str, values: Sequence[str]) -> None:
    """Put texts into the field data of a data object, in place of what has the name there.

    Parameters
    ----------
    data : vtkDataObject
        The data object.
    name : str
        The name of the texts.
    values : sequence of str
        The texts.
    """
    made = vtkStringArray()
    made.SetName(name)
    for value in values:
        made.InsertNextValue(value)
    data.GetFieldData().AddArray(made)


# ---- To VTK.


def _points(coordinates: ArrayLike) -> Any:
    made = vtkPoints()
    made.SetData(numpy_to_vtk(np.ascontiguousarray(coordinates, np.float64), deep=True))
    return made


def _cells(connectivity: ArrayLike, offsets: ArrayLike) -> Any:
    made = vtkCellArray()
    made.SetData(
        numpy_to_vtk(np.ascontiguousarray(offsets, np.int64), deep=True),
        numpy_to_vtk(np.ascontiguousarray(connectivity, np.int64).ravel(), deep=True),
    )
    return made


def _rows(cells: NDArray[Any]) -> Any:
    return _cells(cells, np.arange(len(cells) + 1) * cells.shape[1])


def of_view(view: View) -> Any:
    """Make polygons of a view.

    Parameters
    ----------
    view : View
        What a live view shows at one step.

    Returns
    -------
    vtkPolyData
        Its lines and triangles with all fields; in cell data lines stand before triangles, as VTK has them. Where there
        are no lines, `features` is an array of cells. In the field data are `cycle` and `TimeValue`.
    """
    made = vtkPolyData()
    made.SetPoints(_points(view.points))
    if len(view.lines):
        made.SetLines(_rows(view.lines))
    if len(view.triangles):
        made.SetPolys(_rows(view.triangles))
    triangles = len(view.triangles)
    for name, values in view.fields.items():
        if view.associations[name] == "vertex":
            add(made.GetPointData(), name, values)
        else:
            add(made.GetCellData(), name, np.concatenate([values[triangles:], values[:triangles]]))
    if view.features is not None and not len(view.lines):
        add(made.GetCellData(), "features", view.features.astype(np.int32))
    add(made.GetFieldData(), "cycle", np.array([view.cycle], np.int64))
    add(made.GetFieldData(), "TimeValue", np.array([view.time]))
    return made


def of_surface(surface: Surface) -> Any:
    """Make polygons of a reference surface.

    Parameters
    ----------
    surface : Surface
        That of a `Run` or of a `Shaper`.

    Returns
    -------
    vtkPolyData
        Its faces with the cell array `features` and the texts `feature_names`, and which vertex of the mesh each of its
        points is: the point array `vertices`. `to_mesh` finds the same features in it.
    """
    made = vtkPolyData()
    made.SetPoints(_points(surface.points))
    made.SetPolys(_cells(surface.connectivity, surface.offsets))
    add(made.GetPointData(), "vertices", surface.vertices.astype(np.int64))
    add(made.GetCellData(), "features", surface.features.astype(np.int32))
    set_texts(made, "feature_names", surface.names)
    return made


def of_skeleton(skeleton: Skeleton) -> Any:
    """Make polylines of a curve skeleton.

    Parameters
    ----------
    skeleton : Skeleton
        That of a `Shaper`.

    Returns
    -------
    vtkPolyData
        A polyline for each curve, and the point array `radius` in the unit of length of the mesh.
    """
    made = vtkPolyData()
    made.SetPoints(_points(skeleton.nodes))
    if skeleton.curves:
        offsets = np.concatenate([[0], np.cumsum([len(curve) for curve in skeleton.curves])])
        made.SetLines(_cells(np.concatenate(skeleton.curves), offsets))
    add(made.GetPointData(), "radius", skeleton.radii)
    return made


# ---- From VTK.


def points(data: Any) -> NDArray[Any]:
    """Find the points of a data object.

    Parameters
    ----------
    data : vtkPointSet
        The data object.

    Returns
    -------
    array of shape (n, 3)
        A view of VTK's memory, in the unit of length that the data object has.
    """
    found = data.GetPoints()
    return np.empty((0, 3)) if found is None else np.asarray(vtk_to_numpy(found.GetData()))


def to_mesh(data: Any) -> Mesh:
    """Make a mesh of a data object, with the features that the program `tombolo` finds in such a file.

    Parameters
    ----------
    data : vtkDataSet
        Polygons, an unstructured grid or any other, PyVista's too.

    Returns
    -------
    Mesh
        Its points and cells, without its fields. Features are those of the cell array `features`, else those of the
        point array `features`. Their names are the texts `feature_names`, or those of arrays ``[number, 2]`` in the
        field data.

    Raises
    ------
    MeshError
        It is no vtkDataSet. It has no cells, or cells that make no mesh, such as polyhedra and cells with vertices on
        their edges. Or the number of a feature is not whole.
    """
    if not (hasattr(data, "IsA") and data.IsA("vtkDataSet")):
        raise MeshError(f"found {what_it_is(data)}, expected a vtkDataSet")
    grid = data
    if not data.IsA("vtkUnstructuredGrid"):
        gathered = vtkAppendFilter()
        gathered.AddInputData(data)
        gathered.Update()
        grid = gathered.GetOutput()
    cells = grid.GetCells()
    if cells is None or grid.GetNumberOfCells() == 0:
        raise MeshError("the data object of VTK: found no cells, expected a mesh")
    connectivity, offsets = vtk_to_numpy(cells.GetConnectivityArray()), vtk_to_numpy(cells.GetOffsetsArray())
    # The older name was given up.
    is_new = (vtkVersion.GetVTKMajorVersion(), vtkVersion.GetVTKMinorVersion()) >= (9, 6)
    types = vtk_to_numpy(grid.GetCellTypes() if is_new else grid.GetCellTypesArray())
    _check_types(types)
    faces = vertex_features = None
    if (numbers := array(data.GetCellData(), "features")) is not None:
        parts = _faces(connectivity, offsets, types, numbers)
        faces = faces_of_features(parts, _feature_names(data))
    if faces is None:
        vertex_features = array(data.GetPointData(), "features")
    return Mesh(
        points(grid),
        {"connectivity": connectivity, "offsets": offsets, "types": types},
        faces=faces,
        vertex_features=vertex_features,
    )


def _check_types(types: NDArray[Any]) -> None:
    """An error for polyhedra, and for cells with vertices on their edges."""
    for number in np.unique(types).tolist():
        found = f"the data object of VTK: found {np.count_nonzero(types == number)}"
        if number == _POLYHEDRON:
            raise MeshError(f"{found} polyhedra, expected cells of other types, such as tetrahedra or hexahedra")
        if number in _QUADRATIC:
            hint = "linear cells: of PyVista's grids, mesh.linear_copy()"
            raise MeshError(f"{found} quadratic cells (VTK's type {number}), expected {hint}")


def _faces(
    connectivity: NDArray[Any], offsets: NDArray[Any], types: NDArray[Any], numbers: NDArray[Any]
) -> list[tuple[int, NDArray[Any], NDArray[Any]]]:
    """Triangles and quadrangles with the number of each one's feature; other polygons and strips by their triangles."""
    sizes = np.diff(offsets)
    is_face = np.isin(types, (_TRIANGLE, _STRIP, _POLYGON, _PIXEL, _QUAD))
    parts: list[tuple[int, NDArray[Any], NDArray[Any]]] = []
    for kind, size in np.unique(np.stack([types, sizes], axis=1)[is_face], axis=0).tolist():
        chosen = np.flatnonzero((types == kind) & (sizes == size))
        rows = connectivity[offsets[chosen][:, None] + np.arange(size)]
        if kind == _STRIP:
            # Every other one is turned round.
            corners = [[at, at + 1, at + 2] if at % 2 == 0 else [at + 1, at, at + 2] for at in range(size - 2)]
        elif size != 4:
            corners = fan(size)
        else:
            # The vertices of a pixel count along its axes, and not around it.
            corners = [[0, 1, 3, 2] if kind == _PIXEL else [0, 1, 2, 3]]
        parts += [(_QUAD if len(of) == 4 else _TRIANGLE, rows[:, of], numbers[chosen]) for of in corners]
    return parts


def _feature_names(data: Any) -> dict[int, str]:
    names, numbers = texts(data, "feature_names"), array(data.GetFieldData(), "feature_numbers")
    if names is not None:
        return dict(zip(range(len(names)) if numbers is None else map(int, numbers), names))
    found: dict[int, str] = {}
    fields = data.GetFieldData()
    for index in range(fields.GetNumberOfArrays()):
        name = fields.GetArrayName(index)
        values = None if name is None else array(fields, name)
        if values is None or values.dtype.kind not in "iu" or values.size % 2:
            continue
        pairs = values.reshape(-1, 2)
        if (pairs[:, 1] == 2).all():
            found |= dict.fromkeys(map(int, pairs[:, 0]), name)
    return found


def shaper(data: Any, *, angle: Optional[float] = None) -> Shaper:
    """Make the shaper of a data object, or find the one that was made of the same data.

    Programs on top of VTK ask again and again for the same mesh, whose operators are expensive to set up. The last
    four are kept.

    Parameters
    ----------
    data : vtkDataSet
        As `to_mesh` takes it.
    angle : float, optional
        As `Shaper` takes it, in degrees.

    Returns
    -------
    Shaper
        The shaper, which others that asked for the same have too.

    Raises
    ------
    MeshError
        As of `to_mesh` and `Shaper`.
    """
    mesh = to_mesh(data)
    assert isinstance(mesh.cells, dict)
    arrays = [mesh.points, *mesh.cells.values(), mesh.vertex_features]
    for name, parts in (mesh.faces or {}).items():
        assert isinstance(parts, dict)
        arrays += [name, *parts, *parts.values()]
    key = (angle, *(it.tobytes() if isinstance(it, np.ndarray) else it for it in arrays))
    found = _SHAPERS.pop(key, None)
    _SHAPERS[key] = Shaper(mesh, angle=angle) if found is None else found
    while len(_SHAPERS) > _KEPT:
        _SHAPERS.popitem(last=False)
    return _SHAPERS[key]
