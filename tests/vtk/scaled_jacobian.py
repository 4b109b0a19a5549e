#!/usr/bin/env python3
"""The reference values behind `tombolo_deform::quality::scaled_jacobian`, as VTK computes them.

    tests/vtk/scaled_jacobian.py           checks the stored table against the VTK that is installed
    tests/vtk/scaled_jacobian.py --write   computes the table anew (needs VTK 9.2 or later for wedges and pyramids)

The table is deform/src/quality/scaled_jacobian.json; the tests of the crate read it.
"""

import json
import math
import pathlib
import random
import sys

import vtk

TABLE = pathlib.Path(__file__).parents[2] / "deform" / "src" / "quality" / "scaled_jacobian.json"

# VTK's cell type number, the measure of vtkMeshQuality, and the unit cell in VTK's order of vertices.
CELLS = [
    (5, "TriangleScaledJacobian", [(0, 0, 0), (1, 0, 0), (0, 1, 0)]),
    (9, "QuadScaledJacobian", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]),
    (10, "TetScaledJacobian", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]),
    (
        12,
        "HexScaledJacobian",
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
    ),
    (13, "WedgeScaledJacobian", [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)]),
    (14, "PyramidScaledJacobian", [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 0.7)]),
]
NAMES = {5: "triangle", 9: "quad", 10: "tetra", 12: "hexahedron", 13: "wedge", 14: "pyramid"}

# How far vertices are moved: cells that are nearly ideal, poor ones, and ones turned inside out.
AMOUNTS = [0.0, 0.05, 0.1, 0.2, 0.2, 0.3, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0]


def measure(number, name, points):
    """What VTK says of one cell; None where this VTK has no such measure."""
    function = getattr(vtk.vtkMeshQuality, name, None)
    if function is None:
        return None
    grid = vtk.vtkUnstructuredGrid()
    coordinates = vtk.vtkPoints()
    coordinates.SetDataTypeToDouble()
    for point in points:
        coordinates.InsertNextPoint(point)
    grid.SetPoints(coordinates)
    grid.InsertNextCell(number, len(points), list(range(len(points))))
    return function(grid.GetCell(0))


def worst_corner(cell_type, points):
    """Of wedges and pyramids, for a VTK without a measure of theirs: the least over the corners, computed here."""

    def less(to, at):
        return [a - b for a, b in zip(points[to], points[at])]

    def determinant(a, b, c):
        return (
            a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0])
        )

    if cell_type == "wedge":
        worst = math.inf
        for at in range(6):
            top = at // 3 * 3
            rows = [less(to, at) for to in (top + (at + 1) % 3, top + (at + 2) % 3, (at + 3) % 6)]
            lengths = math.prod(math.hypot(*row) for row in rows)
            worst = min(worst, (1 if top == 0 else -1) * determinant(*rows) / lengths)
        return 2 / math.sqrt(3) * worst
    tets = ((at, (at + 1) % 4, (at + 3) % 4, 4) for at in range(4))
    value = math.sqrt(2) * min(measure(10, "TetScaledJacobian", [points[at] for at in tet]) for tet in tets)
    return max(value, 0.0) if value < 1 else 2 - value


def write():
    generator = random.Random(20240607)
    rows = []
    for number, name, unit in CELLS:
        for amount in AMOUNTS:
            scales = [1.0, generator.uniform(0.3, 2.0), generator.uniform(0.1, 3.0)] if amount else [1.0] * 3
            points = [
                [(x + amount * generator.uniform(-1, 1)) * scale for x, scale in zip(point, scales)] for point in unit
            ]
            value = measure(number, name, points)
            if value is None:
                sys.exit(f"VTK {vtk.vtkVersion().GetVTKVersion()} has no {name}")
            rows.append({"cell_type": NAMES[number], "points": points, "scaled_jacobian": value})
    lines = ",\n".join("  " + json.dumps(row) for row in rows)
    TABLE.write_text(f"[\n{lines}\n]\n")
    print(f"{len(rows)} cells written to {TABLE}")


def check():
    by_name = {NAMES[number]: (number, name) for number, name, _ in CELLS}
    checked, missing, worst = 0, set(), 0.0
    for row in json.loads(TABLE.read_text()):
        number, name = by_name[row["cell_type"]]
        value = measure(number, name, row["points"])
        if value is None:
            missing.add(row["cell_type"])
            value = worst_corner(row["cell_type"], row["points"])
        checked += 1
        worst = max(worst, abs(value - row["scaled_jacobian"]))
    print(f"VTK {vtk.vtkVersion().GetVTKVersion()}: {checked} cells checked, largest difference {worst:.1e}")
    if missing:
        print(f"not measured by this VTK, and so by their corners: {', '.join(sorted(missing))}")
    if checked == 0 or worst > 1e-10:
        sys.exit("the table is not what VTK computes")


write() if sys.argv[1:] == ["--write"] else check()
