#!/usr/bin/python3
"""Prints what VTK draws of a file of hexahedra whose `vtkGhostType` has bits set, as JSON: the bits, and the number of faces and
their area of the surface, and of the cut with a plane.

    ghosts.py FILE.vtu X Y Z NX NY NZ

Hidden cells, and refined ones, which are hidden in a vtkUniformGrid, are taken out by their bits; copies of other processes' cells
are left to vtkGeometryFilter. Where there are no copies, vtkDataSetSurfaceFilter has to agree, which takes hidden cells out itself.
Needs Debian's python3-vtk9; no numpy.
"""

import json
import sys

import vtk

DUPLICATE, REFINED, HIDDEN = 1, 8, 32


def kept(grid, bits, left_out):
    numbers = vtk.vtkIdList()
    for cell, of_cell in enumerate(bits):
        if not of_cell & left_out:
            numbers.InsertNextId(cell)
    extract = vtk.vtkExtractCells()
    extract.SetInputData(grid)
    extract.SetCellList(numbers)
    extract.Update()
    return extract.GetOutput()


def measured(output):
    triangles, mass = vtk.vtkTriangleFilter(), vtk.vtkMassProperties()
    triangles.SetInputData(output)
    mass.SetInputConnection(triangles.GetOutputPort())
    return {"faces": output.GetNumberOfCells(), "area": mass.GetSurfaceArea() if output.GetNumberOfCells() else 0.0}


def drawn(kind, data):
    surface = kind()
    surface.SetInputData(data)
    surface.Update()
    return measured(surface.GetOutput())


reader = vtk.vtkXMLUnstructuredGridReader()
reader.SetFileName(sys.argv[1])
reader.Update()
grid = reader.GetOutput()
array = grid.GetCellData().GetArray("vtkGhostType")
bits = [int(array.GetValue(cell)) for cell in range(grid.GetNumberOfCells())]
surface = drawn(vtk.vtkGeometryFilter, kept(grid, bits, HIDDEN | REFINED))
plane, cutter = vtk.vtkPlane(), vtk.vtkCutter()
plane.SetOrigin(*[float(number) for number in sys.argv[2:5]])
plane.SetNormal(*[float(number) for number in sys.argv[5:8]])
cutter.SetCutFunction(plane)
cutter.GenerateTrianglesOff()
cutter.SetInputData(kept(grid, bits, DUPLICATE | HIDDEN | REFINED))
cutter.Update()
if not any(of_cell & DUPLICATE for of_cell in bits):
    marked = vtk.vtkUnsignedCharArray()
    marked.SetName("vtkGhostType")
    for of_cell in bits:
        marked.InsertNextValue(HIDDEN if of_cell & (HIDDEN | REFINED) else 0)
    grid.GetCellData().AddArray(marked)
    other = drawn(vtk.vtkDataSetSurfaceFilter, grid)
    assert other["faces"] == surface["faces"], (other, surface)
print(json.dumps({"bits": bits, "surface": surface, "cut": measured(cutter.GetOutput())}))
