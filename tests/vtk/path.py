#!/usr/bin/python3
"""Looks at the shapes of one mesh with VTK: path.py FOLDER, with reference.vtu and any number of other .vtu files in it.

Prints a line for each other file, in the order of their names: the least scaled Jacobian of its tetrahedra and hexahedra as
vtkMeshQuality computes it (as its bits; that of 2 where it has none), and how many cells of any kind have a place where the
determinant of VTK's own interpolation has not the sign that it has in the reference.
"""

import glob
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
MEASURES = {10: vtk.vtkMeshQuality.TetScaledJacobian, 12: vtk.vtkMeshQuality.HexScaledJacobian}


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
        yield (
            a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
        )


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
        measure = MEASURES.get(cell.GetCellType())
        if measure:
            least = min(least, measure(cell))
        values = list(determinants(cell))
        inverted += any(value == 0 or (value > 0) != positive for value, positive in zip(values, expected))
    print(f"{os.path.basename(path)}{bits([least])} {inverted}")
