#!/usr/bin/python3
"""Makes of a mesh what pipelines of Tombolo make of it, by VTK's own filters, and compares, as JSON.

    extracts.py PIPELINES.json MESH.vtu NAME=FILE.vtu ...

The files hold what the pipelines of these names have written. Prints for each name how far off the file is: `sizes` (lengths, areas
or volumes, and integrals of the fields over them, ours and VTK's), and `points` (the largest distance of a point from the nearest of
the other, and the largest difference of a value there). Needs Debian's python3-vtk9; no numpy.
"""

import json
import math
import sys

import vtk


def read(file):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(file)
    reader.Update()
    grid = reader.GetOutput()
    assert grid.GetNumberOfPoints() > 0, file
    return grid


def updated(filter, data):
    filter.SetInputData(data)
    filter.Update()
    return filter.GetOutput()


def arrays(data):
    return [data.GetArray(index) for index in range(data.GetNumberOfArrays())]


def plane(settings):
    plane = vtk.vtkPlane()
    plane.SetOrigin(settings["origin"])
    plane.SetNormal(settings["normal"])
    return plane


def sphere(settings):
    sphere = vtk.vtkSphere()
    sphere.SetCenter(settings["center"])
    sphere.SetRadius(settings["radius"])
    return sphere


def cylinder(settings):
    cylinder = vtk.vtkCylinder()
    cylinder.SetCenter(settings["origin"])
    cylinder.SetAxis(settings["axis"])
    cylinder.SetRadius(settings["radius"])
    return cylinder


def appended(parts):
    append = vtk.vtkAppendFilter()
    append.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION)
    for part in parts:
        append.AddInputData(part)
    append.Update()
    return append.GetOutput()


def slice_(grid, settings):
    if "planes" in settings:
        return appended([slice_(grid, settings) for settings in settings["planes"]])
    kind = next((kind for kind in ("sphere", "cylinder") if kind in settings), None)
    function = {"sphere": sphere, "cylinder": cylinder}[kind](settings[kind]) if kind else plane(settings)
    # Inside another function, since VTK cuts linear cells with a bare plane by a faster way that works in single precision.
    whole = vtk.vtkImplicitBoolean()
    whole.AddFunction(function)
    cutter = vtk.vtkCutter()
    cutter.SetCutFunction(whole)
    cutter.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION)
    return updated(cutter, grid)


def contour(grid, settings):
    filter = vtk.vtkContourGrid()
    filter.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION)
    filter.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS, settings["field"])
    for index, value in enumerate(settings["values"]):
        filter.SetValue(index, value)
    return updated(filter, grid)


def threshold(grid, settings):
    association = vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS
    if grid.GetPointData().GetArray(settings["field"]) is None:
        association = vtk.vtkDataObject.FIELD_ASSOCIATION_CELLS
    filter = vtk.vtkThreshold()
    filter.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION)
    filter.SetInputArrayToProcess(0, 0, 0, association, settings["field"])
    filter.SetLowerThreshold(settings.get("min", -math.inf))
    filter.SetUpperThreshold(settings.get("max", math.inf))
    filter.SetThresholdFunction(vtk.vtkThreshold.THRESHOLD_BETWEEN)
    filter.SetAllScalars(settings.get("vertices", "all") == "all")
    return updated(filter, grid)


def tetrahedra(grid):
    """Each cell as tetrahedra between its vertex of the lowest number and its other faces, fanned from their lowest."""
    tets, owners = vtk.vtkUnstructuredGrid(), vtk.vtkIdList()
    tets.SetPoints(grid.GetPoints())
    tets.GetPointData().ShallowCopy(grid.GetPointData())
    tets.Allocate(grid.GetNumberOfCells())
    for number in range(grid.GetNumberOfCells()):
        cell = grid.GetCell(number)
        lowest = min(cell.GetPointId(corner) for corner in range(cell.GetNumberOfPoints()))
        for face in (cell.GetFace(index) for index in range(cell.GetNumberOfFaces())):
            corners = [face.GetPointId(corner) for corner in range(face.GetNumberOfPoints())]
            if face.GetCellType() == vtk.VTK_PIXEL:
                corners = [corners[0], corners[1], corners[3], corners[2]]
            if lowest in corners:
                continue
            start = corners.index(min(corners))
            corners = corners[start:] + corners[:start]
            for b, c in zip(corners[1:], corners[2:]):
                tets.InsertNextCell(vtk.VTK_TETRA, 4, [corners[0], c, b, lowest])
                owners.InsertNextId(number)
    data = tets.GetCellData()
    data.CopyAllocate(grid.GetCellData())
    data.SetNumberOfTuples(owners.GetNumberOfIds())
    for index in range(owners.GetNumberOfIds()):
        data.CopyData(grid.GetCellData(), owners.GetId(index), index)
    return tets


def clipped(grid, function, keep_above):
    clip = vtk.vtkTableBasedClipDataSet()
    clip.SetOutputPointsPrecision(vtk.vtkAlgorithm.DOUBLE_PRECISION)
    clip.SetInsideOut(not keep_above)
    if isinstance(function, dict):
        clip.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS, function["name"])
        clip.SetValue(function["value"])
    else:
        clip.SetClipFunction(function)
    return updated(clip, grid)


def clip(grid, settings):
    invert = settings.get("invert", False)
    grid = tetrahedra(grid)
    if "plane" in settings:
        return clipped(grid, plane(settings["plane"]), not invert)
    if "sphere" in settings:
        return clipped(grid, sphere(settings["sphere"]), invert)
    if "field" in settings:
        return clipped(grid, settings["field"], not invert)
    outside = []
    for axis in range(3):
        for bound, sign in (("lower", 1), ("upper", -1)):
            normal = [sign if other == axis else 0 for other in range(3)]
            side = plane({"origin": settings["box"][bound], "normal": normal})
            outside.append(clipped(grid, side, False))
            grid = clipped(grid, side, True)
    return appended([part for part in outside if part.GetNumberOfCells()]) if invert else grid


def probe(grid, settings):
    between = lambda a, b, fraction: [p * (1 - fraction) + q * fraction for p, q in zip(a, b)]
    if "points" in settings:
        places = settings["points"]
    elif "line" in settings:
        line = settings["line"]
        places = [between(line["from"], line["to"], index / (line["count"] - 1)) for index in range(line["count"])]
    else:
        lower, upper, counts = (settings["grid"][key] for key in ("lower", "upper", "counts"))
        along = lambda axis, index: lower[axis] + (upper[axis] - lower[axis]) * index / max(counts[axis] - 1, 1)
        places = [
            [along(0, i), along(1, j), along(2, k)]
            for k in range(counts[2]) for j in range(counts[1]) for i in range(counts[0])
        ]
    # Not vtkProbeFilter: its cells take in what lies a thousandth beside them.
    locator = vtk.vtkStaticCellLocator()
    locator.SetDataSet(grid)
    locator.BuildLocator()
    points, found = vtk.vtkPoints(), vtk.vtkPolyData()
    points.SetDataTypeToDouble()
    found.SetPoints(points)
    values = {}
    for place in places:
        near, best = vtk.vtkIdList(), (-1e-9, None, None)
        locator.FindCellsWithinBounds([end for axis in place for end in (axis - 1e-9, axis + 1e-9)], near)
        for number in (near.GetId(index) for index in range(near.GetNumberOfIds())):
            cell, part, distance = grid.GetCell(number), vtk.reference(0), vtk.reference(0.0)
            parametric, closest, weights = [0.0] * 3, [0.0] * 3, [0.0] * cell.GetNumberOfPoints()
            if cell.EvaluatePosition(place, closest, part, parametric, distance, weights) != 1:
                continue
            # Not the weights, which are those of the closest point where the place is outside.
            r, s, t = parametric
            beyond = {vtk.VTK_TETRA: [1 - r - s - t], vtk.VTK_WEDGE: [1 - r - s]}.get(cell.GetCellType(), [])
            margin = min([*parametric, *(1 - x for x in parametric), *beyond])
            best = max(best, (margin, number, weights), key=lambda candidate: candidate[0])
        _, number, weights = best
        if number is None:
            continue
        cell = grid.GetCell(number)
        points.InsertNextPoint(place)
        corners = [cell.GetPointId(corner) for corner in range(cell.GetNumberOfPoints())]
        for array in arrays(grid.GetPointData()):
            tuples = [[weight * part for part in array.GetTuple(corner)] for weight, corner in zip(weights, corners)]
            values.setdefault(array.GetName(), []).append([sum(parts) for parts in zip(*tuples)])
        for array in arrays(grid.GetCellData()):
            values.setdefault(array.GetName(), []).append(array.GetTuple(number))
    for name, tuples in values.items():
        array = vtk.vtkDoubleArray()
        array.SetName(name)
        array.SetNumberOfComponents(len(tuples[0]))
        for values in tuples:
            array.InsertNextTuple(values)
        found.GetPointData().AddArray(array)
    return found


DERIVED = {"gradient": "Gradient", "vorticity": "Vorticity", "divergence": "Divergence", "q_criterion": "QCriterion"}


def derived(grid, stage, settings):
    copy = vtk.vtkUnstructuredGrid()
    copy.ShallowCopy(grid)
    association = vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS
    data = copy.GetPointData()
    if data.GetArray(settings["field"]) is None:
        association, data = vtk.vtkDataObject.FIELD_ASSOCIATION_CELLS, copy.GetCellData()
    name = settings.get("name", stage)
    if stage == "magnitude":
        norm, source = vtk.vtkDoubleArray(), data.GetArray(settings["field"])
        norm.SetName(name)
        for index in range(source.GetNumberOfTuples()):
            norm.InsertNextValue(math.sqrt(sum(part * part for part in source.GetTuple(index))))
        data.AddArray(norm)
        return copy
    filter = vtk.vtkGradientFilter()
    filter.SetInputArrayToProcess(0, 0, 0, association, settings["field"])
    filter.SetContributingCellOption(vtk.vtkGradientFilter.DataSetMax)
    filter.SetComputeGradient(stage == "gradient")
    filter.SetComputeVorticity(stage == "vorticity")
    filter.SetComputeDivergence(stage == "divergence")
    filter.SetComputeQCriterion(stage == "q_criterion")
    getattr(filter, {"gradient": "SetResultArrayName"}.get(stage, f"Set{DERIVED[stage]}ArrayName"))(name)
    return updated(filter, copy)


def measured(data):
    """The size of all cells, and the integrals of the fields: of a vertex field over the simplices of each cell."""
    sizes = {"size": 0.0}
    for number in range(data.GetNumberOfCells()):
        cell = data.GetCell(number)
        if cell.GetCellDimension() == 0:
            continue
        corners, points = vtk.vtkIdList(), vtk.vtkPoints()
        points.SetDataTypeToDouble()
        cell.Triangulate(0, corners, points)
        count = cell.GetCellDimension() + 1
        for first in range(0, corners.GetNumberOfIds(), count):
            at = [points.GetPoint(first + corner) for corner in range(count)]
            edges = [[q - p for p, q in zip(at[0], other)] for other in at[1:]]
            normal = [0.0] * 3
            if count > 2:
                vtk.vtkMath.Cross(edges[0], edges[1], normal)
            size = {
                2: lambda: vtk.vtkMath.Norm(edges[0]),
                3: lambda: vtk.vtkMath.Norm(normal) / 2,
                4: lambda: abs(vtk.vtkMath.Dot(normal, edges[2])) / 6,
            }[count]()
            sizes["size"] += size
            for array in arrays(data.GetCellData()):
                key = f"element {array.GetName()}"
                sizes[key] = sizes.get(key, 0.0) + size * sum(array.GetTuple(number))
            for array in arrays(data.GetPointData()):
                key = f"vertex {array.GetName()}"
                values = [sum(array.GetTuple(corners.GetId(first + corner))) for corner in range(count)]
                sizes[key] = sizes.get(key, 0.0) + size * sum(values) / count
    return sizes


def off(one, other):
    """How far the points of one are from those of the other, and the values there."""
    locator = vtk.vtkPointLocator()
    locator.SetDataSet(other)
    locator.BuildLocator()
    furthest = widest = 0.0
    names = {array.GetName() for array in arrays(other.GetPointData())}
    for index in range(one.GetNumberOfPoints()):
        nearest = locator.FindClosestPoint(one.GetPoint(index))
        furthest = max(furthest, math.dist(one.GetPoint(index), other.GetPoint(nearest)))
        for array in arrays(one.GetPointData()):
            if array.GetName() not in names:
                continue
            theirs = other.GetPointData().GetArray(array.GetName()).GetTuple(nearest)
            ours = array.GetTuple(index)
            assert len(ours) == len(theirs), array.GetName()
            widest = max(widest, *(abs(p - q) for p, q in zip(ours, theirs)))
    return [furthest, widest]


def centers(data):
    """The centres of the cells, with their fields."""
    filter = vtk.vtkCellCenters()
    filter.VertexCellsOn()
    return updated(filter, data)


stages = {"slice": slice_, "contour": contour, "threshold": threshold, "clip": clip, "probe": probe}
pipelines = {pipeline["name"]: pipeline["stages"] for pipeline in json.load(open(sys.argv[1]))["pipelines"]}
grid = read(sys.argv[2])
results = {}
for argument in sys.argv[3:]:
    name, file = argument.split("=", 1)
    ours, theirs = read(file), grid
    for stage in pipelines[name.split("@")[0]]:
        (key, settings), = stage.items()
        if key in stages:
            theirs = stages[key](theirs, settings)
        elif key in DERIVED or key == "magnitude":
            theirs = derived(theirs, key, settings)
    if "probe" in json.dumps(pipelines[name.split("@")[0]]):
        sizes = [{}, {}]
    else:
        sizes = [measured(ours), measured(theirs)]
    result = {"sizes": sizes, "points": [off(ours, theirs), off(theirs, ours)]}
    result["counts"] = [[data.GetNumberOfPoints(), data.GetNumberOfCells()] for data in (ours, theirs)]
    ours_of_vertices = {array.GetName() for array in arrays(ours.GetPointData())}
    theirs_of_vertices = {array.GetName() for array in arrays(theirs.GetPointData())}
    result["names"] = [sorted(ours_of_vertices), sorted(theirs_of_vertices)]
    if key == "write" and not any(stage_key in stages for stage in pipelines[name.split("@")[0]] for stage_key in stage):
        result["elements"] = [off(centers(ours), centers(theirs)), off(centers(theirs), centers(ours))]
    results[name] = result
json.dump(results, sys.stdout)
