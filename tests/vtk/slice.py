#!/usr/bin/env python3
"""The reference values behind the slices of `tombolo_pipelines::extract`, as vtkCutter cuts them.

    tests/vtk/slice.py           checks the stored table against the VTK that is installed
    tests/vtk/slice.py --write   computes the table anew

The table is pipelines/tests/slice.json; the tests of the crate read it.
"""

import json
import pathlib
import random
import sys

import vtk

TABLE = pathlib.Path(__file__).parents[2] / "pipelines" / "tests" / "slice.json"

PLANES = [
    ((0.5, 0.5, 0.5), (1, 0, 0)),
    ((0.31, 0.2, 0.7), (0.2, -1.0, 0.4)),
    ((0.5, 0.45, 0.4), (1, 1, 1)),
    ((0.05, 0.0, 0.93), (-0.1, 0.3, 2.0)),
]


def box(count, jitter):
    """A unit box of tetrahedra, six to a cube, its inner vertices moved at random."""
    random.seed(7)
    points, cells = [], []
    number = lambda i, j, k: i + (count + 1) * (j + (count + 1) * k)
    for k in range(count + 1):
        for j in range(count + 1):
            for i in range(count + 1):
                inside = all(0 < index < count for index in (i, j, k))
                move = [random.uniform(-jitter, jitter) if inside else 0.0 for _ in range(3)]
                points.append([(index + d) / count for index, d in zip((i, j, k), move)])
    paths = [(0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2)]
    for k in range(count):
        for j in range(count):
            for i in range(count):
                for path in paths:
                    corner, tet = [i, j, k], [number(i, j, k)]
                    for axis in path:
                        corner[axis] += 1
                        tet.append(number(*corner))
                    if paths.index(path) >= 3:
                        tet[1], tet[2] = tet[2], tet[1]
                    cells.append(tet)
    return points, cells


def vertex_field(point):
    x, y, z = point
    return x * y + z * z - 0.5 * x


def grid(points, cells):
    mesh, coordinates = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
    coordinates.SetDataTypeToDouble()
    for point in points:
        coordinates.InsertNextPoint(point)
    mesh.SetPoints(coordinates)
    for cell in cells:
        mesh.InsertNextCell(vtk.VTK_TETRA, 4, cell)
    for name, values, data in [
        ("vertex", [vertex_field(point) for point in points], mesh.GetPointData()),
        ("element", [float(cell % 17) for cell in range(len(cells))], mesh.GetCellData()),
    ]:
        array = vtk.vtkDoubleArray()
        array.SetName(name)
        for value in values:
            array.InsertNextValue(value)
        data.AddArray(array)
    return mesh


def cut(mesh, origin, normal):
    plane, cutter = vtk.vtkPlane(), vtk.vtkCutter()
    plane.SetOrigin(origin)
    plane.SetNormal(normal)
    # Inside another function, since VTK cuts linear cells with a bare plane by a faster way that merges no points and works in
    # single precision.
    function = vtk.vtkImplicitBoolean()
    function.AddFunction(plane)
    cutter.SetCutFunction(function)
    cutter.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION)
    cutter.SetInputData(mesh)
    cutter.Update()
    slice = cutter.GetOutput()
    area = integral = 0.0
    for cell in range(slice.GetNumberOfCells()):
        a, b, c = [slice.GetPoint(slice.GetCell(cell).GetPointId(corner)) for corner in range(3)]
        # Not ComputeArea, whose formula of Heron loses half the digits of a needle.
        cross = [0.0] * 3
        vtk.vtkMath.Cross([q - p for p, q in zip(a, b)], [q - p for p, q in zip(a, c)], cross)
        part = vtk.vtkMath.Norm(cross) / 2
        area += part
        integral += part * slice.GetCellData().GetArray("element").GetValue(cell)
    values = slice.GetPointData().GetArray("vertex")
    points = sorted([*slice.GetPoint(i), values.GetValue(i)] for i in range(slice.GetNumberOfPoints()))
    return {"origin": origin, "normal": normal, "area": area, "element_integral": integral, "points": points}


def differ(a, b):
    if isinstance(a, dict):
        return a.keys() != b.keys() or any(differ(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)):
        return len(a) != len(b) or any(differ(x, y) for x, y in zip(a, b))
    return abs(a - b) > 1e-12


points, cells = box(4, 0.25)
mesh = grid(points, cells)
table = {"mesh": {"points": points, "cells": cells}, "slices": [cut(mesh, *plane) for plane in PLANES]}
if "--write" in sys.argv:
    TABLE.write_text(json.dumps(table) + "\n")
elif differ(table, json.loads(TABLE.read_text())):
    sys.exit(f"VTK {vtk.VTK_VERSION} cuts differently from {TABLE}")
print(f"VTK {vtk.VTK_VERSION}: {len(PLANES)} slices, {sum(len(s['points']) for s in table['slices'])} points")
