"""Sends a ray through the middle of each pixel of a picture, and compares what it meets with what is drawn there.

    picture.py MESH PICTURE true|false

The mesh is the extract that the picture shows, seen as in pipelines/tests/render.rs (true: along parallel rays), coloured by `x` from -1
to 2 in grey, without light. Prints how many pixels are hit, at how many the outline differs, and at how many the colour.
"""

import json
import math
import sys

import vtk
from vtk.util.numpy_support import vtk_to_numpy

mesh_file, picture_file, parallel = sys.argv[1], sys.argv[2], sys.argv[3] == "true"

reader = vtk.vtkXMLUnstructuredGridReader()
reader.SetFileName(mesh_file)
surface = vtk.vtkDataSetSurfaceFilter()
surface.SetInputConnection(reader.GetOutputPort())
triangles = vtk.vtkTriangleFilter()
triangles.SetInputConnection(surface.GetOutputPort())
triangles.Update()
mesh = triangles.GetOutput()
values = mesh.GetPointData().GetArray("x")

png = vtk.vtkPNGReader()
png.SetFileName(picture_file)
png.Update()
image = png.GetOutput()
width, height, _ = image.GetDimensions()
pixels = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, -1)[::-1]


def subtract(a, b):
    return [x - y for x, y in zip(a, b)]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(a):
    length = math.sqrt(sum(x * x for x in a))
    return [x / length for x in a]


eye, focus = [3.5, -3.0, 2.4], [1.0, 0.5, 0.4]
away = unit(subtract(focus, eye))
right = unit(cross(away, [0.0, 0.0, 1.0]))
up = cross(right, away)
tangent = math.tan(math.radians(15.0))
distance = math.sqrt(sum(x * x for x in subtract(focus, eye)))

locator = vtk.vtkStaticCellLocator()
locator.SetDataSet(mesh)
locator.BuildLocator()
cell = vtk.vtkGenericCell()
t, sub, number = vtk.mutable(0.0), vtk.mutable(0), vtk.mutable(0)
hit = outline = color = 0
for row in range(height):
    for column in range(width):
        x = (column + 0.5 - width / 2) / (height / 2) * tangent
        y = (height / 2 - row - 0.5) / (height / 2) * tangent
        aside = [x * r + y * u for r, u in zip(right, up)]
        if parallel:
            start = [e + distance * a for e, a in zip(eye, aside)]
            ahead = away
        else:
            start = eye
            ahead = [d + a for d, a in zip(away, aside)]
        end = [s + 20 * d for s, d in zip(start, ahead)]
        meets, local = [0.0] * 3, [0.0] * 3
        is_hit = locator.IntersectWithLine(start, end, 1e-9, t, meets, local, sub, number, cell)
        drawn = pixels[row, column]
        is_drawn = any(drawn != 255)
        hit += is_drawn
        if bool(is_hit) != is_drawn:
            outline += 1
        elif is_hit:
            points = mesh.GetCell(number.get()).GetPointIds()
            a, b, c = (values.GetValue(points.GetId(corner)) for corner in range(3))
            value = (1 - local[0] - local[1]) * a + local[0] * b + local[1] * c
            grey = 26 + 216 * min(max((value + 1) / 3, 0), 1)
            color += abs(int(drawn[0]) - grey) > 1.5
print(json.dumps({"hit": int(hit), "outline": outline, "color": color}))
