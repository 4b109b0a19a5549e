#!/usr/bin/python3
"""Times VTK's own filters, for `benchmarks -- extract`.

    extract.py MESH.vtu RUNS

Reads from standard input a JSON list of [name, stage, settings] as pipelines have them, and prints for each name the seconds of a run on
a mesh that has changed and of one with another field on the same mesh, each the median, and how many points and cells came out. Where VTK
has several filters for one thing, the quickest is taken. Needs Debian's python3-vtk9; no numpy.
"""

import json
import statistics
import sys
import time

import vtk

POINTS = vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS


def plane(settings):
    function = vtk.vtkPlane()
    function.SetOrigin(settings["origin"])
    function.SetNormal(settings["normal"])
    return function


def sphere(settings):
    function = vtk.vtkSphere()
    function.SetCenter(settings["center"])
    function.SetRadius(settings["radius"])
    return function


def surface(settings):
    return vtk.vtkGeometryFilter()


def slice_(settings):
    cutter = vtk.vtkCutter()
    cutter.SetCutFunction(sphere(settings["sphere"]) if "sphere" in settings else plane(settings))
    return cutter


def contour(settings):
    filter = vtk.vtkContour3DLinearGrid()
    filter.MergePointsOn()
    filter.InterpolateAttributesOn()
    filter.ComputeScalarsOn()
    filter.SetInputArrayToProcess(0, 0, 0, POINTS, settings["field"])
    for index, value in enumerate(settings["values"]):
        filter.SetValue(index, value)
    return filter


def threshold(settings):
    filter = vtk.vtkThreshold()
    filter.SetInputArrayToProcess(0, 0, 0, POINTS, settings["field"])
    filter.SetLowerThreshold(settings["min"])
    filter.SetUpperThreshold(settings["max"])
    filter.SetThresholdFunction(vtk.vtkThreshold.THRESHOLD_BETWEEN)
    return filter


def clip(settings):
    filter = vtk.vtkTableBasedClipDataSet()
    if "plane" in settings:
        filter.SetClipFunction(plane(settings["plane"]))
    else:
        filter.SetInputArrayToProcess(0, 0, 0, POINTS, settings["field"]["name"])
        filter.SetValue(settings["field"]["value"])
    return filter


def probe(settings):
    lower, upper, counts = (settings["grid"][key] for key in ("lower", "upper", "counts"))
    image = vtk.vtkImageData()
    image.SetDimensions(counts)
    image.SetOrigin(lower)
    image.SetSpacing([(b - a) / (count - 1) for a, b, count in zip(lower, upper, counts)])
    filter = vtk.vtkProbeFilter()
    filter.SetInputData(image)
    return filter


def derived(setting):
    def filter(settings):
        gradient = vtk.vtkGradientFilter()
        gradient.SetInputArrayToProcess(0, 0, 0, POINTS, settings["field"])
        gradient.SetComputeGradient(setting == "gradient")
        gradient.SetComputeVorticity(setting == "vorticity")
        gradient.SetComputeQCriterion(setting == "q_criterion")
        return gradient

    return filter


def integrate(settings):
    return vtk.vtkIntegrateAttributes()


FILTERS = {
    "surface": surface,
    "slice": slice_,
    "contour": contour,
    "threshold": threshold,
    "clip": clip,
    "probe": probe,
    "integrate": integrate,
    **{name: derived(name) for name in ("gradient", "vorticity", "q_criterion")},
}

reader = vtk.vtkXMLUnstructuredGridReader()
reader.SetFileName(sys.argv[1])
reader.Update()
grid = vtk.vtkUnstructuredGrid()
grid.DeepCopy(reader.GetOutput())
del reader
results = {}
for name, stage, settings in json.load(sys.stdin):
    filter = FILTERS[stage](settings)
    if stage == "probe":
        filter.SetSourceData(grid)
    else:
        filter.SetInputData(grid)
    seconds = {"changed": [], "again": []}
    for run in range(2 * int(sys.argv[2]) + 1):
        kind = "changed" if run % 2 == 0 else "again"
        if kind == "changed":
            grid.GetPoints().Modified()
            grid.GetCells().Modified()
        for index in range(grid.GetPointData().GetNumberOfArrays()):
            grid.GetPointData().GetArray(index).Modified()
        grid.Modified()
        start = time.perf_counter()
        filter.Update()
        taken = time.perf_counter() - start
        # The first is not counted.
        if run > 0:
            seconds[kind].append(taken)
    output = filter.GetOutput()
    counts = [output.GetNumberOfPoints(), output.GetNumberOfCells()]
    results[name] = {**{kind: statistics.median(times) for kind, times in seconds.items()}, "counts": counts}
json.dump(results, sys.stdout)
