#!/usr/bin/python3
"""Prints what VTK finds in a mesh file, as JSON: how many points and cells, how many cells are no ghosts, the faces of the surface,
and of each array its type, components and values.

    arrays.py FILE.vtu

Needs Debian's python3-vtk9; no numpy.
"""

import json
import sys

import vtk


def arrays(data):
    found = {}
    for index in range(data.GetNumberOfArrays()):
        array = data.GetArray(index)
        if array is not None:
            values = [array.GetComponent(t, c) for t in range(array.GetNumberOfTuples()) for c in range(array.GetNumberOfComponents())]
            found[array.GetName()] = [array.GetDataTypeAsString(), array.GetNumberOfComponents(), values]
    return found


reader = vtk.vtkXMLUnstructuredGridReader()
for event in ("ErrorEvent", "WarningEvent"):
    reader.AddObserver(event, lambda source, event: sys.exit(f"VTK reports {event}"))
reader.SetFileName(sys.argv[1])
reader.Update()
grid = reader.GetOutput()
surface = vtk.vtkGeometryFilter()
surface.SetInputData(grid)
surface.Update()
ghosts = grid.GetCellGhostArray()
own = sum(1 for cell in range(grid.GetNumberOfCells()) if ghosts is None or not int(ghosts.GetValue(cell)) & 1)
print(json.dumps({
    "points": grid.GetNumberOfPoints(),
    "cells": grid.GetNumberOfCells(),
    "own_cells": own,
    "faces": surface.GetOutput().GetNumberOfCells(),
    "vertex": arrays(grid.GetPointData()),
    "element": arrays(grid.GetCellData()),
    "mesh": arrays(grid.GetFieldData()),
}))
