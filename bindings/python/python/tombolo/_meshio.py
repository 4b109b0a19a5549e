"""Meshes that meshio has read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Optional

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import MeshError
from .mesh import Cells, Faces, Mesh, faces_of_features, fan

#: The dimension of each of meshio's types that may stand beside the cells of a mesh.
_DIMENSIONS = {
    **{"vertex": 0, "line": 1, "triangle": 2, "quad": 2},
    **{"tetra": 3, "hexahedron": 3, "wedge": 3, "pyramid": 3},
}

#: VTK's numbers of the types that may stand beside polygons in a surface.
_FACES = {"triangle": 5, "polygon": 7, "quad": 9}

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


def _kind(block: Any) -> str:
    """The type of a block of meshio, of polygons with the number of their corners: it is one number in each block."""
    _check_linear(block.type)
    if block.type.rstrip("0123456789") != "polygon":
        return str(block.type)
    if np.ndim(block.data) != 2:
        raise MeshError(f"meshio's mesh: found polygons of shape {np.shape(block.data)}, expected a row for each")
    corners = block.data.shape[1]
    return {3: "triangle", 4: "quad"}.get(corners, f"polygon{corners}")


def _dimension(kind: str) -> Optional[int]:
    """The dimension of a type of meshio that may stand beside others; None for any other."""
    return 2 if kind.startswith("polygon") else _DIMENSIONS.get(kind)


def _faces_of(kind: str, rows: NDArray[Any]) -> list[tuple[str, NDArray[Any]]]:
    """Triangles and quadrangles of a type of meshio; polygons by their triangles."""
    if not kind.startswith("polygon"):
        return [(kind, rows)]
    return [("triangle", rows[:, corners]) for corners in fan(rows.shape[1])]


def _with_polygons(cells: Mapping[str, NDArray[Any]]) -> Cells:
    """Cells by their types; those of a surface with polygons as VTK has them, whose polygons have any size."""
    if not any(kind.startswith("polygon") for kind in cells):
        return cells
    numbers = {kind: _FACES.get(kind.rstrip("0123456789")) for kind in cells}
    if None in numbers.values():
        # It is refused by its name.
        return {kind: rows for kind, rows in cells.items() if numbers[kind] is None}
    sizes = np.concatenate([np.full(len(rows), rows.shape[1]) for rows in cells.values()])
    return {
        "connectivity": np.concatenate([rows.ravel() for rows in cells.values()]),
        "offsets": np.concatenate([[0], np.cumsum(sizes)]),
        "types": np.concatenate([np.full(len(rows), numbers[kind], np.uint8) for kind, rows in cells.items()]),
    }


def of_meshio(mesh: Any) -> Mesh:
    """Read a mesh of meshio, with the features that the program finds in its file."""
    # What meshio calls the numbers of Gmsh's groups, and what the program calls those of features in a file of VTK.
    key = next((key for key in ("gmsh:physical", "features") if key in mesh.cell_data), None)
    groups = mesh.cell_data[key] if key else [np.full(len(block.data), -1) for block in mesh.cells]
    blocks: dict[str, list[tuple[NDArray[Any], NDArray[Any]]]] = {}
    for block, numbers in zip(mesh.cells, groups):
        blocks.setdefault(_kind(block), []).append((block.data, numbers))
    parts: dict[str, tuple[NDArray[Any], NDArray[Any]]] = {}
    for kind, of_kind in blocks.items():
        rows, numbers = (np.concatenate(arrays) for arrays in zip(*of_kind))
        if key == "gmsh:physical":
            # Version 2.2 has a cell of several groups once for each: the first holds.
            first = np.sort(np.unique(rows, axis=0, return_index=True)[1])
            # 0 is that of no group; one below 0 says that a surface is turned round in its group.
            rows, numbers = rows[first], np.where(numbers == 0, -1, np.abs(numbers))[first]
        parts[kind] = rows, numbers
    # Faces and edges beside volume cells are of the boundary. A type that is not known is kept, and refused by name.
    most = max((_dimension(kind) or 0 for kind in parts), default=0)
    cells = {kind: rows for kind, (rows, _) in parts.items() if _dimension(kind) in (most, None)}
    pairs = {name: np.ravel(pair) for name, pair in mesh.field_data.items()}
    names = {int(pair[0]): name for name, pair in pairs.items() if len(pair) == 2 and pair[1] == 2}
    faces = faces_of_features(
        (
            (of_kind, of_rows, numbers)
            for kind, (rows, numbers) in parts.items()
            if _dimension(kind) == 2
            for of_kind, of_rows in _faces_of(kind, rows)
        ),
        names,
    )
    faces = _sets_of_meshio(mesh) if faces is None else faces
    return Mesh(
        mesh.points,
        _with_polygons(cells),
        faces=faces,
        vertex_features=mesh.point_data.get("features") if faces is None else None,
    )


def _numbers_of(name: str, block: Any, rows: ArrayLike) -> NDArray[np.int64]:
    """The cells of a block that are in one of meshio's named sets; an error where the block has no such cell."""
    found = np.asarray(rows)
    which = f"the set of cells '{name}'"
    if found.ndim != 1 or found.dtype.kind not in "iu":
        raise MeshError(f"{which}: found an array of {found.dtype}, expected the numbers of cells")
    is_outside = ~((found >= 0) & (found < len(block.data)))
    if is_outside.any():
        raise MeshError(
            f"{which}: found cell {found[is_outside][0]} in a block of {len(block.data)} cells of type '{block.type}',"
            " expected the numbers of its cells, counted from 0"
        )
    return found.astype(np.int64)


def _sets_of_meshio(mesh: Any) -> Optional[Faces]:
    """The faces in each of meshio's named sets of cells."""
    named: dict[str, dict[str, NDArray[Any]]] = {}
    for name, chosen in mesh.cell_sets.items():
        # Sets such as `gmsh:bounding_entities` are meshio's own, and no sets of cells.
        parts = [] if name.startswith("gmsh:") else zip(mesh.cells, chosen)
        of_kind: dict[str, list[NDArray[Any]]] = {}
        for block, rows in parts:
            if rows is not None and len(rows) and _dimension(_kind(block)) == 2:
                for kind, faces in _faces_of(_kind(block), block.data[_numbers_of(name, block, rows)]):
                    of_kind.setdefault(kind, []).append(faces)
        if of_kind:
            named[name] = {kind: np.concatenate(rows) for kind, rows in of_kind.items()}
    return named or None
