"""Prints of VTU files how many points there are, how many cells of each of VTK's types, and the names of the arrays."""

import json
import sys

from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

for file in sys.argv[1:]:
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(file)
    reader.Update()
    grid = reader.GetOutput()
    cells = {}
    for cell in range(grid.GetNumberOfCells()):
        name = str(grid.GetCellType(cell))
        cells[name] = cells.get(name, 0) + 1
    names = [
        sorted(data.GetArrayName(index) for index in range(data.GetNumberOfArrays()))
        for data in (grid.GetPointData(), grid.GetCellData())
    ]
    print(json.dumps({"points": grid.GetNumberOfPoints(), "cells": cells, "arrays": names}))
