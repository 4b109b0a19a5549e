#!/usr/bin/env python3
"""Reads mesh files with meshio and prints all that is in them, numbers as their bits; or has meshio write files for us to read.

    read_back.py FILE...                 what read_back.py of tests/vtk prints of a file, as far as meshio reads it
    read_back.py --rewrite FILE.vtu DIR  writes FILE anew in the formats that we read as well, and prints the names

Needs meshio (scripts/setup puts it into .venv).
"""

import json
import os
import sys

import meshio
import numpy

# meshio's wedges have Gmsh's order.
WEDGE = [0, 2, 1, 3, 5, 4]


def bits(values):
    return "".join(f" {word:016x}" for word in numpy.ascontiguousarray(values, dtype="<f8").reshape(-1).view("<u8"))


def array(place, name, values):
    components = 1 if values.ndim == 1 else values.shape[1]
    print(f"{place} {json.dumps(name, ensure_ascii=False)} {components}{bits(values)}")


def describe(mesh):
    print(f"points{bits(mesh.points)}")
    for block in mesh.cells:
        kind = meshio._vtk_common.meshio_to_vtk_type["polyhedron" if block.type.startswith("polyhedron") else block.type]
        for cell in block.data:
            if kind == 42:
                vertices = sorted({int(vertex) for face in cell for vertex in face})
            else:
                vertices = [int(vertex) for vertex in (cell[WEDGE] if kind == 13 else cell)]
            print(f"cell {kind}{''.join(f' {vertex}' for vertex in vertices)}")
    for name, values in mesh.point_data.items():
        array("point", name, values)
    for name, blocks in mesh.cell_data.items():
        array("cell", name, numpy.concatenate(blocks))
    for name, values in mesh.field_data.items():
        array("field", name, values)


def rewrite(mesh, directory):
    # Its legacy files take no names with spaces.
    mesh.cell_data = {name.replace(" ", "_"): values for name, values in mesh.cell_data.items()}
    for name, settings in (
        ("zlib.vtu", {}),
        ("plain.vtu", {"compression": None}),
        ("text.vtu", {"binary": False}),
        ("binary.vtk", {"file_format": "vtk"}),
        ("version-42.vtk", {"file_format": "vtk42"}),
        ("text.vtk", {"file_format": "vtk", "binary": False}),
    ):
        mesh.write(os.path.join(directory, name), **settings)
        print(name)
    # Features are physical groups there; the names are in the field data already.
    tags = [values.astype(int) for values in mesh.cell_data.pop("features")]
    mesh.cell_data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    mesh.point_data = {}
    for name, settings in (("version-22.msh", {"file_format": "gmsh22"}), ("text.msh", {"file_format": "gmsh22", "binary": False})):
        mesh.write(os.path.join(directory, name), **settings)
        print(name)


if __name__ == "__main__":
    if sys.argv[1] == "--rewrite":
        rewrite(meshio.read(sys.argv[2]), sys.argv[3])
    else:
        for argument in sys.argv[1:]:
            describe(meshio.read(argument))
