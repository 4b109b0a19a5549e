#!/usr/bin/env python3
"""What the benchmark `surface` needs from Python: its tori, made by gmsh, and libigl's answers.

    surface.py torus VERTICES OUT.msh         a torus of radii 2 and 0.7 with about that many vertices
    surface.py harmonic FOLDER ORDER RUNS     seconds of `igl.harmonic`, one a line; its displacement goes to FOLDER/libigl

FOLDER holds `points` (f64), `triangles` (u32), `prescribed` (u32, the vertices) and `motion` (f64, theirs), little-endian.
"""

import math
import sys
import time


def torus(count, out):
    import gmsh

    size = 1.011 * math.sqrt(4 * math.pi**2 * 2 * 0.7 / (count * math.sqrt(3) / 2))
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addTorus(0, 0, 0, 2, 0.7)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], name="torus")
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(2)
    gmsh.write(out)


def harmonic(folder, order, runs):
    import igl
    import numpy as np

    points = np.fromfile(f"{folder}/points", "<f8").reshape(-1, 3)
    triangles = np.fromfile(f"{folder}/triangles", "<u4").reshape(-1, 3).astype(np.int64)
    prescribed = np.fromfile(f"{folder}/prescribed", "<u4").astype(np.int64)
    motion = np.fromfile(f"{folder}/motion", "<f8").reshape(-1, 3)
    for _ in range(runs):
        start = time.perf_counter()
        displacement = igl.harmonic(points, triangles, prescribed, motion, order)
        print(time.perf_counter() - start)
    np.asarray(displacement, "<f8").tofile(f"{folder}/libigl")


if sys.argv[1] == "torus":
    torus(int(sys.argv[2]), sys.argv[3])
else:
    harmonic(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
