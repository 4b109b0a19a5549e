#!/usr/bin/python3
"""Looks at the shapes of one mesh with VTK: path.py FOLDER, with reference.vtu and any number of other .vtu files in it.

Prints a line for each other file, in the order of their names: the least scaled Jacobian (as its bits; that of 2 where it has no
cells of volume), and how many cells of any kind have a place where the
determinant of VTK's own interpolation has not the sign that it has in the reference.

The scaled Jacobian of tetrahedra and hexahedra is vtkMeshQuality's; that of pyramids is made of vtkMeshQuality's of the tetrahedra at
the corners of their bases, as Verdict's is. Of wedges the VTK of Debian has none: the least over the corners of the determinant of
the three edges by their lengths is computed here, its sign that in the reference, so that it does not matter in which order they are.
"""

import glob
import math
import os
import random
import sys

import vtk

from read_back import bits, read

# Places in parametric coordinates, a little inside: corners, and others.
GENERATOR = random.Random(1)
LOW, HIGH = 0.01, 0.99
CUBE = [(x, y, z) for x in (LOW, HIGH) for y in (LOW, HIGH) for z in (LOW, HIGH)]
CUBE += [tuple(GENERATOR.uniform(LOW, HIGH) for _ in range(3)) for _ in range(8)]
PLACES = {
    10: [(0.25, 0.25, 0.25)],
    12: CUBE,
    13: [(x, y * (1 - x), z) for x, y, z in CUBE],
    14: CUBE,
}


def determinants(cell):
    count = cell.GetNumberOfPoints()
    points = [cell.GetPoints().GetPoint(vertex) for vertex in range(count)]
    for place in PLACES[cell.GetCellType()]:
        slopes = [0.0] * (3 * count)
        cell.InterpolateDerivs(place, slopes)
        a, b, c = (
            [sum(slopes[count * way + vertex] * points[vertex][axis] for vertex in range(count)) for axis in range(3)]
            for way in range(3)
        )
        yield determinant(a, b, c)


def edges(points, corner):
    top = corner // 3 * 3
    neighbours = [top + (corner + 1) % 3, top + (corner + 2) % 3, (corner + 3) % 6]
    return [[points[to][axis] - points[corner][axis] for axis in range(3)] for to in neighbours]


def determinant(a, b, c):
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


def wedge(cell, reference):
    shape, start = (
        [it.GetPoints().GetPoint(vertex) for vertex in range(6)] for it in (cell, reference)
    )
    worst = 2.0
    for corner in range(6):
        rows = edges(shape, corner)
        sign = math.copysign(1.0, determinant(*edges(start, corner)))
        lengths = math.prod(math.sqrt(sum(x * x for x in row)) for row in rows)
        worst = min(worst, sign * determinant(*rows) / lengths)
    return 2 / math.sqrt(3) * worst


def mirrored(cell):
    points = cell.GetPoints()
    for vertex in range(cell.GetNumberOfPoints()):
        x, y, z = points.GetPoint(vertex)
        points.SetPoint(vertex, -x, y, z)


def pyramid(cell, _):
    worst = 2.0
    for corner in range(4):
        tetra = vtk.vtkTetra()
        for place, vertex in enumerate((corner, (corner + 1) % 4, (corner + 3) % 4, 4)):
            tetra.GetPoints().SetPoint(place, cell.GetPoints().GetPoint(vertex))
        worst = min(worst, vtk.vtkMeshQuality.TetScaledJacobian(tetra))
    value = math.sqrt(2) * worst
    return max(value, 0.0) if value < 1 else 2 - value


MEASURES = {
    10: lambda cell, _: vtk.vtkMeshQuality.TetScaledJacobian(cell),
    12: lambda cell, _: vtk.vtkMeshQuality.HexScaledJacobian(cell),
    13: wedge,
    14: pyramid,
}

folder = sys.argv[1]
reference = read(os.path.join(folder, "reference.vtu"))
solid = [number for number in range(reference.GetNumberOfCells()) if reference.GetCellType(number) in PLACES]
signs = [[value > 0 for value in determinants(reference.GetCell(number))] for number in solid]
for path in sorted(glob.glob(os.path.join(folder, "*.vtu"))):
    if os.path.basename(path) == "reference.vtu":
        continue
    shape = read(path)
    least, inverted = 2.0, 0
    for number, expected in zip(solid, signs):
        cell = shape.GetCell(number)
        values = list(determinants(cell))
        measure = MEASURES.get(cell.GetCellType())
        if measure:
            if cell.GetCellType() != 13 and not any(expected):
                # Left-handed in the reference: in a mirror it is what the measures take it to be.
                mirrored(cell)
            least = min(least, measure(cell, reference.GetCell(number)))
        inverted += any(value == 0 or (value > 0) != positive for value, positive in zip(values, expected))
    print(f"{os.path.basename(path)}{bits([least])} {inverted}")
