"""Compares streamlines with those of vtkStreamTracer.

    streamlines.py MESH LINES SEEDS

MESH holds the field `u`, LINES the streamlines in both directions from SEEDS, a list of points as JSON. Prints the largest distance of a
point from VTK's line, the largest distance between the ends, and the largest difference of the times there.
"""

import json
import sys

import vtk


def read(name):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(name)
    reader.Update()
    return reader.GetOutput()


mesh, lines, seeds = read(sys.argv[1]), read(sys.argv[2]), json.loads(sys.argv[3])
mesh.GetPointData().SetActiveVectors("u")

# Our lines, one after the other: a point that no line leads to begins one.
follows = set()
for cell in range(lines.GetNumberOfCells()):
    follows.add(lines.GetCell(cell).GetPointId(1))
chains = []
for point in range(lines.GetNumberOfPoints()):
    if point not in follows:
        chains.append([])
    chains[-1].append(point)
assert len(chains) == len(seeds), (len(chains), len(seeds))
times = lines.GetPointData().GetArray("integration_time")

result = {"distance": 0.0, "end": 0.0, "time": 0.0}
for seed, chain in zip(seeds, chains):
    for direction in (0, 1):
        tracer = vtk.vtkStreamTracer()
        tracer.SetInputData(mesh)
        tracer.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS, "u")
        tracer.SetStartPosition(*seed)
        tracer.SetIntegratorTypeToRungeKutta45()
        tracer.SetIntegrationStepUnit(vtk.vtkStreamTracer.CELL_LENGTH_UNIT)
        tracer.SetInitialIntegrationStep(0.001)
        tracer.SetMinimumIntegrationStep(0.0005)
        tracer.SetMaximumIntegrationStep(0.002)
        tracer.SetMaximumError(1e-9)
        tracer.SetMaximumPropagation(100)
        tracer.SetMaximumNumberOfSteps(100000)
        tracer.SetIntegrationDirection(direction)
        tracer.Update()
        theirs = tracer.GetOutput()
        locator = vtk.vtkCellLocator()
        locator.SetDataSet(theirs)
        locator.BuildLocator()
        near, cell, sub, square = [0.0] * 3, vtk.mutable(0), vtk.mutable(0), vtk.mutable(0.0)
        sign = 1 if direction == 0 else -1
        own = [point for point in chain if sign * times.GetValue(point) > 0]
        last = theirs.GetNumberOfPoints() - 1
        their_time = abs(theirs.GetPointData().GetArray("IntegrationTime").GetValue(last))
        for point in own:
            # Theirs ends up to a step before the boundary.
            if abs(times.GetValue(point)) < their_time:
                locator.FindClosestPoint(lines.GetPoint(point), near, cell, sub, square)
                result["distance"] = max(result["distance"], float(square) ** 0.5)
        end = own[-1] if direction == 0 else own[0]
        a, b = lines.GetPoint(end), theirs.GetPoint(last)
        apart = sum((x - y) ** 2 for x, y in zip(a, b)) ** 0.5
        result["end"] = max(result["end"], apart)
        result["time"] = max(result["time"], abs(their_time - abs(times.GetValue(end))))
print(json.dumps(result))
