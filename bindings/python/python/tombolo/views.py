"""What a live view shows at one step, as arrays."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple, Optional

import numpy as np
from numpy.typing import NDArray

from ._identity import by_identity
from ._names import unknown

__all__ = ["Surface", "View", "Views"]

#: What is said where frames were not asked for.
NOT_WANTED = "no frames of views come: the run was connected with views=False"


def not_chosen(name: str) -> str:
    """Say that a view was not chosen."""
    return f"no frames of the view '{name}' come: it was not chosen by run.choose_views"


#: What meshio calls faces of so many vertices.
_POLYGONS = {3: "triangle", 4: "quad"}


def _of(fields: Mapping[str, NDArray[np.float64]], associations: Mapping[str, str], kind: str) -> dict[str, Any]:
    return {name: values for name, values in fields.items() if associations[name] == kind}


@by_identity
class View(NamedTuple):
    """A view at one step: triangles and lines, with fields. It does not change any more: its arrays are read-only.

    Attributes
    ----------
    name : str
        The name of its pipeline.
    cycle : int
        The step.
    time : float
        The simulated time, in the solver's unit of time.
    points : array of shape (n, 3), float64
        The coordinates of each point, in the unit of length of the mesh.
    triangles : array of shape (t, 3), uint32
        Triangles by the numbers of their points.
    lines : array of shape (l, 2), uint32
        Lines by the numbers of their points.
    features : array of shape (t,), uint32, or None
        The feature of each triangle, where the view has features: an index into `Run.features`.
    fields : dict of str to array
        `(n,)` or `(n, k)` at points; of elements a value for each triangle, then for each line. Numbers are within the
        bound that the view's `stream` stage states, in the unit of the solver's field.
    associations : dict of str to {"vertex", "element"}
        Where the values of each field are.
    """

    name: str
    cycle: int
    time: float
    points: NDArray[np.float64]
    triangles: NDArray[np.uint32]
    lines: NDArray[np.uint32]
    features: Optional[NDArray[np.uint32]]
    fields: dict[str, NDArray[np.float64]]
    associations: dict[str, Literal["vertex", "element"]]

    def to_pyvista(self) -> Any:
        """The view for PyVista.

        Returns
        -------
        pyvista.PolyData
            A copy; in its cell data lines stand before triangles, as VTK keeps them.

        Raises
        ------
        ImportError
            There is no PyVista.
        """
        import pyvista

        from . import vtk

        return pyvista.wrap(vtk.of_view(self))

    def to_meshio(self) -> Any:
        """The view for meshio.

        Returns
        -------
        meshio.Mesh
            A copy, with a block of triangles and one of lines, where there are any.

        Raises
        ------
        ImportError
            There is no meshio.
        """
        import meshio

        count = len(self.triangles)
        cells = [("triangle", self.triangles.astype(np.int64)), ("line", self.lines.astype(np.int64))]
        # Copies: what is here is read-only.
        data = {
            name: [values[:count].copy(), values[count:].copy()]
            for name, values in _of(self.fields, self.associations, "element").items()
        }
        kept = [index for index, (_, rows) in enumerate(cells) if len(rows)]
        return meshio.Mesh(
            self.points.copy(),
            [cells[index] for index in kept],
            point_data={name: values.copy() for name, values in _of(self.fields, self.associations, "vertex").items()},
            cell_data={name: [parts[index] for index in kept] for name, parts in data.items()},
        )

    def __repr__(self) -> str:
        fields = ", ".join(self.fields) or "none"
        return (
            f"<tombolo.View '{self.name}' at cycle {self.cycle}: {len(self.points)} points, "
            f"{len(self.triangles)} triangles, {len(self.lines)} lines, fields: {fields}>"
        )


class Views(Mapping[str, View]):
    """The newest frame of each live view that has come.

    Parameters
    ----------
    frames : dict of str to View
        The frames, which change while the run goes on.
    announced : callable
        Returns the names of the live views.
    chosen : callable
        Returns the names of those that were chosen, None for all.
    wanted : bool
        Whether frames come at all.
    """

    def __init__(
        self,
        frames: Mapping[str, View],
        announced: Callable[[], Sequence[str]],
        chosen: Callable[[], Optional[Collection[str]]],
        wanted: bool = True,
    ) -> None:
        self._frames = frames
        self._announced = announced
        self._chosen = chosen
        self._wanted = wanted

    def __getitem__(self, name: str) -> View:
        if not self._wanted:
            raise KeyError(NOT_WANTED)
        names = self._announced()
        if name not in names:
            raise KeyError(unknown("view", name, names))
        chosen = self._chosen()
        if chosen is not None and name not in chosen:
            raise KeyError(not_chosen(name))
        frame = self._frames.get(name)
        if frame is None:
            raise KeyError(f"no frame of the view '{name}' has come yet; run.wait_for_view({name!r}) waits for it")
        return frame

    def __iter__(self) -> Iterator[str]:
        # A frame of a view that was removed, or is looked at no more, may have been on its way.
        chosen = self._chosen()
        names = [name for name in self._announced() if chosen is None or name in chosen]
        return iter([name for name in names if name in self._frames])

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __repr__(self) -> str:
        return f"<tombolo.Views: {', '.join(self) or 'none has come yet'}>"


@by_identity
class Surface(NamedTuple):
    """The reference surface: what edits are measured from, every bit of it.

    Attributes
    ----------
    points : array of shape (n, 3), float64
        The coordinates of each of its vertices, in the unit of length of the mesh.
    vertices : array of shape (n,), uint32
        Which vertex of the mesh each is.
    connectivity : array of uint32
        The vertices of each face, one face after the other, as indices into `points`.
    offsets : array of shape (f + 1,), int64
        Where each face begins in `connectivity`, and where the last ends.
    features : array of shape (f,), uint32
        The feature of each face, an index into `names`.
    names : list of str
        The names of the features.
    """

    points: NDArray[np.float64]
    vertices: NDArray[np.uint32]
    connectivity: NDArray[np.uint32]
    offsets: NDArray[np.int64]
    features: NDArray[np.uint32]
    names: list[str]

    def faces_of(self, feature: str) -> NDArray[np.int64]:
        """The numbers of a feature's faces, as the region `faces` of an edit takes them.

        Parameters
        ----------
        feature : str
            The name of the feature, one of `names`.

        Returns
        -------
        array of shape (k,), int64
            The numbers of its faces, counted from 0.

        Raises
        ------
        KeyError
            There is no such feature.
        """
        if feature not in self.names:
            raise KeyError(unknown("feature", feature, self.names))
        return np.flatnonzero(self.features == self.names.index(feature))

    def to_pyvista(self) -> Any:
        """The surface for PyVista.

        Returns
        -------
        pyvista.PolyData
            A copy, with the cell array `features` and the point array `vertices`.

        Raises
        ------
        ImportError
            There is no PyVista.
        """
        import pyvista

        from . import vtk

        return pyvista.wrap(vtk.of_surface(self))

    def to_meshio(self) -> Any:
        """The surface for meshio.

        Returns
        -------
        meshio.Mesh
            A copy, with the cell data `features`, their names, and the point data `vertices`.

        Raises
        ------
        ImportError
            There is no meshio.
        """
        import meshio

        sizes = np.diff(self.offsets)
        chosen = [(size, np.flatnonzero(sizes == size)) for size in np.unique(sizes).tolist()]
        cells = [
            (_POLYGONS.get(size, "polygon"), self.connectivity[self.offsets[faces][:, None] + np.arange(size)])
            for size, faces in chosen
        ]
        return meshio.Mesh(
            self.points.copy(),
            [(kind, rows.astype(np.int64)) for kind, rows in cells],
            point_data={"vertices": self.vertices.astype(np.int64)},
            cell_data={"features": [self.features[faces].astype(np.int32) for _, faces in chosen]},
            field_data={name: np.array([number, 2]) for number, name in enumerate(self.names)},
        )

    def __repr__(self) -> str:
        return f"<tombolo.Surface: {len(self.points)} points, features: {', '.join(self.names)}>"
