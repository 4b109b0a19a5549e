"""What was given as a mesh, and what is wrong with it."""

from __future__ import annotations

import math
import os
from collections.abc import Collection, Mapping, Sequence
from typing import Any, Optional

import numpy as np

from .errors import MeshError


def part(mesh: Any, name: str) -> Any:
    """A part of a mesh, of a dict that is one, or of the only one in a dict; None where it has none."""
    if isinstance(mesh, Mapping):
        return mesh.get(name) if "points" in mesh else part(next(iter(mesh.values()), None), name)
    return getattr(mesh, name, None)


def _arrays_of(given: Any) -> list[Any]:
    """The arrays of a feature's faces: one, or one for each type."""
    return list(given.values()) if isinstance(given, Mapping) else [given]


def check_faces(faces: Any) -> None:
    """An error where a feature has no faces, by its name."""
    for name, given in faces.items() if isinstance(faces, Mapping) else ():
        if all(hasattr(part, "__len__") and len(part) == 0 for part in _arrays_of(given)):
            raise MeshError(f"the feature '{name}' has no faces, expected at least one")


def check_found(faces: Any, found: Collection[str]) -> None:
    """An error where all faces of a feature are of features before it, so that nothing of it was found."""
    names = list(faces) if isinstance(faces, Mapping) else []
    missing = [feature for feature, name in enumerate(names) if name not in found]
    if not missing:
        return
    parts = [(feature, np.asarray(rows)) for feature, name in enumerate(names) for rows in _arrays_of(faces[name])]
    parts = [(feature, part) for feature, part in parts if len(part)]
    widest = max(part.shape[1] for _, part in parts)
    # A face is the same whatever vertex it begins with; those with fewer vertices are filled up.
    rows = [np.pad(np.sort(part, axis=1), ((0, 0), (0, widest - part.shape[1])), mode="edge") for _, part in parts]
    features = np.repeat([feature for feature, _ in parts], [len(part) for _, part in parts])
    _, first, same = np.unique(np.concatenate(rows), axis=0, return_index=True, return_inverse=True)
    owners = features[first[same.ravel()]]
    for feature in missing:
        others = np.unique(owners[features == feature]).tolist()
        if feature not in others:
            listed = " and ".join(f"'{names[other]}'" for other in others)
            raise MeshError(
                f"the feature '{names[feature]}': found all of its faces in {listed} as well, expected a face of its"
                " own: one in several features is of the first of them"
            )


def degrees(angle: Any) -> Optional[float]:
    """An angle between edges, or an error that says what was found."""
    if angle is None:
        return None
    try:
        given = math.nan if isinstance(angle, (str, bytes, bool)) else float(angle)
    except (TypeError, ValueError, OverflowError):
        given = math.nan
    if not 0 <= given <= 180:
        raise MeshError(f"angle: found {angle!r}, expected degrees from 0 to 180")
    return given


def _blocks(given: Any) -> str:
    """The blocks of one of VTK's data objects of several, by their names."""
    from vtkmodules.vtkCommonDataModel import vtkCompositeDataSet

    names = []
    for number in range(given.GetNumberOfBlocks()):
        about = given.GetMetaData(number) if given.HasMetaData(number) else None
        name = None if about is None else about.Get(vtkCompositeDataSet.NAME())
        names.append(f"block {number}" if name is None else f"'{name}'")
    return ", ".join(names) or "no block"


def what_it_is(given: Any) -> str:
    """Say what was given in place of a mesh, and what would have made one of it.

    Parameters
    ----------
    given : object
        Anything that is no mesh.

    Returns
    -------
    str
        Such as "a NoneType", or the name of a file with the call that reads it.
    """
    if hasattr(given, "GetNumberOfBlocks"):
        joined = ", or all together: mesh.combine()" if hasattr(given, "combine") else ""
        return f"a {type(given).__name__} of {_blocks(given)} (take one of them{joined})"
    if isinstance(given, (str, os.PathLike)):
        return f"the name of a file, '{os.fspath(given)}' (read it first: tombolo.Shaper(meshio.read(...)))"
    if isinstance(given, (np.ndarray, Sequence)):
        return "coordinates without cells (tombolo.Shaper(points, cells))"
    return f"a {type(given).__name__}"
