#!/usr/bin/python3
"""Prints what VTK draws of a grid of two levels (a vtkHyperTreeGrid), as JSON: the number of faces of its surface, and their area.

    levels.py NX NY NZ DESCRIPTOR

The descriptor has a letter for each coarse cell of size 1, x first: R for one that eight fine cells cover, else a point. Needs
Debian's python3-vtk9; no numpy.
"""

import json
import sys

import vtk

counts = [int(number) for number in sys.argv[1:4]]
refined = sys.argv[4].count("R")
source = vtk.vtkHyperTreeGridSource()
source.SetDimensions(*[count + 1 for count in counts])
source.SetGridScale(1.0, 1.0, 1.0)
source.SetBranchFactor(2)
source.SetMaxDepth(2)
source.SetDescriptor(sys.argv[4] + ("|" + "." * 8 * refined if refined else ""))
geometry, triangles, mass = vtk.vtkHyperTreeGridGeometry(), vtk.vtkTriangleFilter(), vtk.vtkMassProperties()
geometry.SetInputConnection(source.GetOutputPort())
geometry.Update()
triangles.SetInputConnection(geometry.GetOutputPort())
mass.SetInputConnection(triangles.GetOutputPort())
print(json.dumps({"faces": geometry.GetOutput().GetNumberOfCells(), "area": mass.GetSurfaceArea()}))
