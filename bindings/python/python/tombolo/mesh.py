"""A solver's mesh and its fields, as they lie in its memory."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, MutableMapping, Sequence
from typing import Any, Literal, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import MeshError

__all__ = ["Cells", "Field", "Mesh", "Values"]

# Keys are texts or numbers. Of a Mapping they are invariant: a dict[str, ...] is no Mapping[Union[str, int], ...].
Cells = Mapping[Any, ArrayLike]
"""Cells: from types to vertex numbers, a row for each cell; or `connectivity`, `offsets` and `types` of VTK."""

Faces = Mapping[str, Union[ArrayLike, Cells]]
"""Named parts of the boundary: from names to faces `(m, 3)` or `(m, 4)`, or to a dict from types to such arrays."""

Values = Union[ArrayLike, Sequence[NDArray[Any]], "Field"]
"""Values of a field: `(n,)` or `(n, k)`, or one array `(n,)` for each component."""


class Field:
    """Values with where they are, for a mesh that has as many cells as vertices.

    Parameters
    ----------
    values : array of shape (n,) or (n, k)
        A value for each vertex or for each cell, of at most 9 components.
    association : {"vertex", "element"}
        Whether they are at vertices or in cells.

    Examples
    --------
    >>> import numpy as np, tombolo
    >>> tombolo.Field(np.zeros(8), "element").association
    'element'
    """

    __slots__ = ("association", "values")

    def __init__(self, values: Values, association: Literal["vertex", "element"]) -> None:
        self.values = values
        self.association = association


class Mesh:
    """A mesh and its fields, borrowed: nothing is copied here, nor while nobody looks at it.

    It holds the arrays that it is given, and they are read anew in each call of `Adaptor.execute`: so it is made once,
    before the first step. Where a solver makes new arrays in each step, it puts them in: ``mesh.fields["T"] = T``.

    Parameters
    ----------
    points : array of shape (n, 2) or (n, 3)
        The coordinates of each vertex, in the solver's unit of length, which is that of all lengths in edits, views and
        motions; also one array `(n,)` for each axis. With two of them, orders that would move a vertex along the third
        axis are rejected.
    cells : dict, optional
        From cell types to vertex numbers, counted from 0, a row for each cell: ``{"tetra": tets}`` with an array
        `(m, 4)`. Types are called `vertex`, `line`, `triangle`, `quad`, `tetra`, `hexahedron`, `wedge`, `pyramid`, ...
        (as meshio does), or by VTK's numbers; vertices are numbered as VTK numbers them. Of several types the cells
        count in the order of the dict. Or, as VTK has them, ``{"connectivity": ..., "offsets": ..., "types": ...}``
        with one more offset than there are cells. Left out: points alone.
    fields : dict, optional
        From names to values: an array with as many values as there are vertices or cells, `(n,)` or `(n, k)` of at
        most 9 components; a `Field` where it has to be said which.
    faces : dict, optional
        Named parts of the boundary, which edits can move or hold: from names to faces by their vertices, `(m, 3)` or
        `(m, 4)`, or a dict from types to such arrays. A face in several of them is of the first. A rank that has none
        of a part says so by an empty list. Left out: parts are found between sharp edges.
    vertex_features : array of shape (n,), optional
        In place of `faces`: of each vertex the number of its part.
    ghost_cells : array of shape (m,), optional
        On several ranks: VTK's `vtkGhostType` of each cell, 0 for those of this rank.
    global_vertices : array of shape (n,), optional
        On several ranks: the number of each vertex among those of all ranks.
    global_cells : array of shape (m,), optional
        On several ranks: the number of each cell among those of all ranks.

    Notes
    -----
    Points and fields of float32, float64, int32, int64 and uint8 are borrowed in any layout: rows or columns first,
    with strides of either sign, read-only. So are cells of int32, int64, uint32 and uint64, of one type or of several,
    and in VTK's form with its types as uint8. Points and fields of another type of whole numbers, of another byte order
    or not aligned are copied at each step that looks at them; such cells, `faces`, `vertex_features` and what there is
    for several ranks are copied once, and again where they have changed. Other types, such as float16 and complex
    numbers, are errors, and so is an array of `numpy.ma` of which values are masked.

    Fields and named parts are read at steps that look at them (`Adaptor.looks_at`), and where the mesh has another size
    than before: what is wrong with one, such as its length, is told then.

    Examples
    --------
    >>> import numpy as np, tombolo
    >>> points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    >>> mesh = tombolo.Mesh(points, {"tetra": np.array([[0, 1, 2, 3]])}, {"temperature": np.ones(4)})
    >>> mesh.fields["pressure"] = np.zeros(1)
    >>> sorted(mesh.fields)
    ['pressure', 'temperature']
    """

    __slots__ = (
        "cells",
        "faces",
        "fields",
        "ghost_cells",
        "global_cells",
        "global_vertices",
        "points",
        "vertex_features",
    )

    def __init__(
        self,
        points: Union[ArrayLike, Sequence[NDArray[Any]]],
        cells: Optional[Cells] = None,
        fields: Optional[Mapping[str, Values]] = None,
        *,
        faces: Optional[Faces] = None,
        vertex_features: Optional[ArrayLike] = None,
        ghost_cells: Optional[ArrayLike] = None,
        global_vertices: Optional[ArrayLike] = None,
        global_cells: Optional[ArrayLike] = None,
    ) -> None:
        self.points = points
        self.cells = cells
        self.fields: MutableMapping[str, Values] = dict(fields or {})
        self.faces = faces
        self.vertex_features = vertex_features
        self.ghost_cells = ghost_cells
        self.global_vertices = global_vertices
        self.global_cells = global_cells

    def __repr__(self) -> str:
        fields = ", ".join(self.fields) or "none"
        return f"<tombolo.Mesh with the fields: {fields}>"


def fan(corners: int) -> list[list[int]]:
    """Cut a polygon into triangles.

    Parameters
    ----------
    corners : int
        How many it has.

    Returns
    -------
    list of [int, int, int]
        Which of its corners each triangle has.
    """
    return [[0, at, at + 1] for at in range(1, corners - 1)]


def faces_of_features(
    parts: Iterable[tuple[Union[str, int], NDArray[Any], NDArray[Any]]], names: Mapping[int, str]
) -> Optional[Faces]:
    """Find the faces of each feature, as `Mesh` takes them.

    Parameters
    ----------
    parts : iterable of (type, rows, numbers)
        Faces of one type, a row each, and the number of each one's feature; a number below 0 is that of none.
    names : dict
        From numbers to names; a feature without one is called after its number, as in the program `tombolo`.

    Returns
    -------
    dict or None
        In the order of the numbers; None where no face has a feature.

    Raises
    ------
    MeshError
        The number of a feature is no whole number.
    """
    found: dict[int, dict[Union[str, int], list[NDArray[Any]]]] = {}
    for kind, rows, numbers in parts:
        is_of_numbers = numbers.ndim == 1 and numbers.dtype.kind in "biuf"
        if not is_of_numbers or not np.array_equal(numbers, np.trunc(numbers)):
            raise MeshError("the cell array 'features': found other values, expected a whole number for each cell")
        for number in np.unique(numbers[numbers >= 0]):
            found.setdefault(int(number), {}).setdefault(kind, []).append(rows[numbers == number])
    named: dict[str, dict[Union[str, int], list[NDArray[Any]]]] = {}
    for number in sorted(found):
        # Numbers with one name are one feature.
        of_name = named.setdefault(names.get(number, f"feature-{number}"), {})
        for kind, faces in found[number].items():
            of_name.setdefault(kind, []).extend(faces)
    joined = {name: {kind: np.concatenate(faces) for kind, faces in kinds.items()} for name, kinds in named.items()}
    return joined or None
