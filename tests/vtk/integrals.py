#!/usr/bin/python3
"""Integrates over a mesh, its surface, a cut and a part of it by VTK's own filters, and prints the results as JSON.

    integrals.py MESH.vtu ORIGIN NORMAL

For each region: `size`, and the integrals of the fields `p` and `u`; for the surface and the cut also `flow_rate`, the flux of `u` along
the normals, outward or along the plane's. The part is that on the side that the normal points to. Needs Debian's python3-vtk9; no numpy.
"""

import json
import sys

import vtk


def updated(filter, data):
    filter.SetInputData(data)
    filter.Update()
    return filter.GetOutput()


def integrals(data):
    whole = updated(vtk.vtkIntegrateAttributes(), data)
    size = next(name for name in ("Volume", "Area", "Length") if whole.GetCellData().GetArray(name))
    found = {"size": whole.GetCellData().GetArray(size).GetValue(0)}
    for name in ("p", "u"):
        found[name] = list(whole.GetPointData().GetArray(name).GetTuple(0))
    for name in ("load",):
        found[name] = list(whole.GetCellData().GetArray(name).GetTuple(0))
    return found


def flow_rate(faces, normal=None):
    """The flux of `u` through triangles, turned along the normal where one is given."""
    triangles, total = updated(vtk.vtkTriangleFilter(), faces), 0.0
    for number in range(triangles.GetNumberOfCells()):
        cell = triangles.GetCell(number)
        corners = [cell.GetPoints().GetPoint(corner) for corner in range(3)]
        edges = [[q - p for p, q in zip(corners[0], corner)] for corner in corners[1:]]
        area = [0.0] * 3
        vtk.vtkMath.Cross(*edges, area)
        turn = -1 if normal and vtk.vtkMath.Dot(area, normal) < 0 else 1
        for corner in range(3):
            value = triangles.GetPointData().GetArray("u").GetTuple(cell.GetPointId(corner))
            total += turn * vtk.vtkMath.Dot(area, value) / 6
    return total


reader = vtk.vtkXMLUnstructuredGridReader()
reader.SetFileName(sys.argv[1])
reader.Update()
grid = reader.GetOutput()
origin, normal = ([float(part) for part in argument.split(",")] for argument in sys.argv[2:4])

plane = vtk.vtkPlane()
plane.SetOrigin(origin)
plane.SetNormal(normal)
# Inside another function, since VTK cuts linear cells with a bare plane by a faster way that works in single precision.
function = vtk.vtkImplicitBoolean()
function.AddFunction(plane)
cutter = vtk.vtkCutter()
cutter.SetCutFunction(function)
cutter.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION)
cut = updated(cutter, grid)
surface = updated(vtk.vtkDataSetSurfaceFilter(), grid)
clip = vtk.vtkTableBasedClipDataSet()
clip.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION)
clip.SetClipFunction(plane)
part = updated(clip, grid)

def by_field(filter, name, association):
    filter.SetInputArrayToProcess(0, 0, 0, association, name)
    return filter


level = by_field(vtk.vtkContourFilter(), "p", vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS)
level.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION)
level.SetValue(0, 0.11)
few = by_field(vtk.vtkThreshold(), "load", vtk.vtkDataObject.FIELD_ASSOCIATION_CELLS)
few.SetLowerThreshold(30)
few.SetUpperThreshold(99)
few.SetThresholdFunction(vtk.vtkThreshold.THRESHOLD_BETWEEN)
inside = by_field(vtk.vtkTableBasedClipDataSet(), "p", vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS)
inside.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION)
inside.SetValue(0.2)


def viscous(grid):
    """The force of friction on the surface for a viscosity of 1: minus the gradient of `u` and its transpose, times the areas."""
    gradients = by_field(vtk.vtkGradientFilter(), "u", vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS)
    gradients.SetResultArrayName("G")
    faces = updated(vtk.vtkDataSetSurfaceFilter(), updated(gradients, grid))
    total = [0.0] * 3
    for number in range(faces.GetNumberOfCells()):
        cell = faces.GetCell(number)
        corners = [cell.GetPoints().GetPoint(corner) for corner in range(3)]
        area = [0.0] * 3
        vtk.vtkMath.Cross(*([q - p for p, q in zip(corners[0], corner)] for corner in corners[1:]), area)
        for corner in range(3):
            g = faces.GetPointData().GetArray("G").GetTuple(cell.GetPointId(corner))
            for row in range(3):
                total[row] -= sum((g[3 * row + column] + g[3 * column + row]) * area[column] for column in range(3)) / 6
    return total


results = {"level": integrals(updated(level, grid)), "few": integrals(updated(few, grid)), "inside": integrals(updated(inside, grid))}
results["viscous"] = viscous(grid)
results |= {"whole": integrals(grid), "surface": integrals(surface), "cut": integrals(cut), "part": integrals(part)}
results["surface"]["flow_rate"] = flow_rate(surface)
results["cut"]["flow_rate"] = flow_rate(cut, normal)
json.dump(results, sys.stdout)
