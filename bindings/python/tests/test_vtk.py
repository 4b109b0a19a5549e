"""Data objects of VTK: what is made of views, surfaces and skeletons, and meshes that are made of them."""

import numpy as np
import pytest
import tombolo
from conftest import box, ends, features_of, features_of_program, program

pytest.importorskip("vtkmodules")
from tombolo import vtk
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkMultiBlockDataSet, vtkPolyData, vtkUnstructuredGrid
from vtkmodules.vtkIOXML import vtkXMLPolyDataReader, vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter

POINTS, TETS = box(3)
FACES = ends(POINTS, TETS)


def read(file):
    reader = vtkXMLPolyDataReader() if file.suffix == ".vtp" else vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(file))
    reader.Update()
    return reader.GetOutput()


def view(lines=((0, 3),)):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    lines = np.array(lines, np.uint32).reshape(-1, 2)
    fields = {
        "pressure": np.arange(4.0),
        "velocity": np.arange(12.0).reshape(4, 3),
        "material": np.arange(2.0 + len(lines)),
    }
    associations = {"pressure": "vertex", "velocity": "vertex", "material": "element"}
    return tombolo.View("a", 7, 0.5, points, triangles, lines, np.array([1, 0], np.uint32), fields, associations)


def test_a_view_has_its_lines_before_its_triangles():
    shown = view()
    made = vtk.of_view(shown)
    assert (made.GetNumberOfLines(), made.GetNumberOfPolys()) == (1, 2)
    assert np.array_equal(vtk.points(made), shown.points)
    for name in ("pressure", "velocity"):
        assert np.array_equal(vtk.array(made.GetPointData(), name), shown.fields[name])
    assert vtk.array(made.GetCellData(), "material").tolist() == [2, 0, 1]
    assert [made.GetCell(0).GetPointId(corner) for corner in (0, 1)] == [0, 3]
    assert [made.GetCell(2).GetPointId(corner) for corner in (0, 1, 2)] == [0, 2, 3]
    # The number of a feature is that of a triangle.
    assert vtk.array(made.GetCellData(), "features") is None
    assert vtk.array(vtk.of_view(view(())).GetCellData(), "features").tolist() == [1, 0]
    assert vtk.array(made.GetFieldData(), "cycle").tolist() == [7]
    assert vtk.array(made.GetFieldData(), "TimeValue").tolist() == [0.5]


def test_pyvista_has_the_same():
    pyvista = pytest.importorskip("pyvista")
    poly = view().to_pyvista()
    assert isinstance(poly, pyvista.PolyData)
    assert poly.cell_data["material"].tolist() == [2, 0, 1]
    assert poly.faces.tolist() == [3, 0, 1, 2, 3, 0, 2, 3]
    surface = tombolo.Shaper(POINTS, {"tetra": TETS}, FACES).surface
    assert features_of(surface.to_pyvista()) == features_of(vtk.of_surface(surface))


def test_a_surface_keeps_its_features():
    shaper = tombolo.Shaper(POINTS, {"tetra": TETS}, FACES)
    made = vtk.of_surface(shaper.surface)
    assert np.array_equal(vtk.array(made.GetPointData(), "vertices"), shaper.surface.vertices)
    assert vtk.texts(made, "feature_names") == ["top", "bottom", "untagged"]
    assert features_of(made) == [(it["name"], it["faces"], it["vertices"]) for it in shaper.features]
    # A shape of the surface is the shape of the mesh's surface.
    edits = [{"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0.1, 0, 0]}}]
    assert np.array_equal(vtk.shaper(made).displacement(edits), shaper.displacement(edits))


def test_a_skeleton_is_polylines_with_radii():
    skeleton = tombolo.Shaper(POINTS * [1, 1, 5], {"tetra": TETS}).skeleton()
    made = vtk.of_skeleton(skeleton)
    assert np.array_equal(vtk.points(made), skeleton.nodes)
    assert np.array_equal(vtk.array(made.GetPointData(), "radius"), skeleton.radii)
    assert made.GetNumberOfLines() == len(skeleton.curves)
    curve = [made.GetCell(0).GetPointId(at) for at in range(made.GetCell(0).GetNumberOfPoints())]
    assert curve == skeleton.curves[0].tolist()
    nothing = tombolo.Skeleton(np.empty((0, 3)), np.empty(0), [], np.empty(0, np.uint32))
    assert vtk.of_skeleton(nothing).GetNumberOfCells() == 0


def grid():
    """A tetrahedron on a quadrilateral's half, a pentagon beside them; and the numbers of features."""
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [3, 0, 0], [4, 1, 0], [3, 2, 0]]
    made = vtkUnstructuredGrid()
    made.SetPoints(vtk._points(np.array(points, np.float32)))
    for kind, corners in ((5, (0, 1, 2)), (9, (0, 1, 2, 3)), (7, (1, 5, 6, 7, 2)), (5, (0, 1, 4))):
        made.InsertNextCell(kind, len(corners), corners)
    return made


def test_features_are_those_of_the_program(tmp_path):
    meshio = pytest.importorskip("meshio")
    faces = [("triangle", FACES["top"]), ("triangle", FACES["bottom"])]
    numbers = [np.full(len(TETS), -1), np.full(len(FACES["top"]), 8), np.full(len(FACES["bottom"]), 3)]
    # As meshio keeps the groups of Gmsh: in the field data, with the dimension behind the number.
    names = {"high": np.array([8, 2]), "inside": np.array([3, 3])}
    file = tmp_path / "named.vtu"
    mesh = meshio.Mesh(POINTS, [("tetra", TETS), *faces], cell_data={"features": numbers}, field_data=names)
    expected = [("feature-3", 18, 16), ("high", 18, 16), ("untagged", 72, 48)]
    assert features_of(mesh) == expected
    mesh.write(file)
    # It does not write them into a file of VTK.
    named = read(file)
    for name, pair in names.items():
        vtk.add(named.GetFieldData(), name, pair)
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(file))
    writer.SetInputData(named)
    writer.Write()
    parts = tmp_path / "parts.vtp"
    assert program("features", "--mesh", file, "--out", parts).returncode == 0
    for written in (file, parts):
        assert features_of(read(written)) == features_of_program(written)
    assert features_of(read(parts)) == expected
    # Numbers at points.
    levels = np.round(POINTS[:, 2] * 3).astype(np.int64)
    meshio.Mesh(POINTS, [("tetra", TETS)], point_data={"features": levels}).write(tmp_path / "points.vtu")
    told = features_of_program(tmp_path / "points.vtu")
    assert len(told) > 2
    assert features_of(read(tmp_path / "points.vtu")) == told
    assert features_of(meshio.read(tmp_path / "points.vtu")) == told


def test_polygons_of_every_size_have_features():
    made = grid()
    vtk.add(made.GetCellData(), "features", np.array([4, 1, 1, -1]))
    mesh = vtk.to_mesh(made)
    assert list(mesh.faces) == ["feature-1", "feature-4"]
    assert mesh.faces["feature-4"][5].tolist() == [[0, 1, 2]]
    assert mesh.faces["feature-1"][9].tolist() == [[0, 1, 2, 3]]
    assert mesh.faces["feature-1"][5].tolist() == [[1, 5, 6], [1, 6, 7], [1, 7, 2]]
    vtk.set_texts(made, "feature_names", ["wall", "lid"])
    vtk.add(made.GetFieldData(), "feature_numbers", np.array([4, 1]))
    assert list(vtk.to_mesh(made).faces) == ["lid", "wall"]
    # Two numbers of one name are one feature.
    vtk.set_texts(made, "feature_names", ["wall", "wall"])
    assert {kind: len(rows) for kind, rows in vtk.to_mesh(made).faces["wall"].items()} == {9: 1, 5: 4}
    pentagons = vtkPolyData()
    pentagons.SetPoints(
        vtk._points(np.array([[0, 0, 0], [2, 0, 0], [3, 1, 0], [1, 2, 0], [0, 1, 0], [1, 1, 3]], float))
    )
    pentagons.SetPolys(vtk._cells([0, 1, 2, 3, 4, 0, 1, 5], [0, 5, 8]))
    vtk.add(pentagons.GetCellData(), "features", np.array([2, 6]))
    assert features_of(pentagons) == [("feature-2", 1, 5), ("feature-6", 1, 3)]


def test_what_is_no_mesh_is_told():
    with pytest.raises(tombolo.MeshError, match="no cells"):
        vtk.to_mesh(vtkPolyData())
    for wrong, found in ((None, "a NoneType"), (vtkMultiBlockDataSet(), "a vtkMultiBlockDataSet of no block")):
        with pytest.raises(tombolo.MeshError, match=f"found {found}.*, expected a vtkDataSet"):
            vtk.to_mesh(wrong)
    made = grid()
    for wrong in (np.array([0.5, 1, 1, 1]), np.ones((4, 2))):
        vtk.add(made.GetCellData(), "features", wrong)
        with pytest.raises(tombolo.MeshError, match="whole number"):
            vtk.to_mesh(made)
    vtk.add(made.GetCellData(), "features", np.full(4, -1))
    assert vtk.to_mesh(made).faces is None
    assert vtk.texts(made, "features") is None
    vtk.set_texts(made, "names", ["a", ""])
    assert vtk.texts(made, "names") == ["a", ""]
    assert vtk.array(made.GetFieldData(), "names") is None


def test_regular_grids_are_meshes_too():
    image = vtkImageData()
    image.SetDimensions(3, 3, 3)
    assert vtk.to_mesh(image).cells["types"].tolist() == [11] * 8


def test_a_shaper_is_made_once_for_each_mesh(monkeypatch):
    monkeypatch.setattr(vtk, "_SHAPERS", type(vtk._SHAPERS)())
    shaper = tombolo.Shaper(POINTS, {"tetra": TETS}, FACES)
    first = vtk.shaper(vtk.of_surface(shaper.surface))
    assert vtk.shaper(vtk.of_surface(shaper.surface)) is first
    by_angle = vtk.shaper(vtk.of_surface(shaper.surface), angle=40)
    assert by_angle is not first and len(by_angle.features) == 6
    for height in (2, 3, 4):
        vtk.shaper(vtk.of_surface(shaper.surface._replace(points=POINTS[shaper.surface.vertices] * [1, 1, height])))
    # The oldest made way.
    assert vtk.shaper(vtk.of_surface(shaper.surface)) is not first
    renamed = shaper.surface._replace(names=["a", "b", "c"])
    assert [it["name"] for it in vtk.shaper(vtk.of_surface(renamed)).features] == ["a", "b", "c"]


def test_features_of_pixels_and_strips_are_kept():
    points = np.array([[x, y, 0] for y in range(3) for x in range(4)], float)

    def features(*cells):
        made = vtkUnstructuredGrid()
        made.SetPoints(vtk._points(points))
        for kind, corners, _ in cells:
            made.InsertNextCell(kind, len(corners), corners)
        vtk.add(made.GetCellData(), "features", np.array([number for *_, number in cells], np.int32))
        return features_of(made)

    pixels = features((8, (0, 1, 4, 5), 3), (8, (1, 2, 5, 6), 3), (8, (4, 5, 8, 9), 1))
    assert pixels == features((9, (0, 1, 5, 4), 3), (9, (1, 2, 6, 5), 3), (9, (4, 5, 9, 8), 1))
    assert [name for name, *_ in pixels] == ["feature-1", "feature-3"]
    strips = features((6, (0, 4, 1, 5, 2, 6), 3), (6, (4, 8, 5, 9), 1))
    triangles = [(0, 4, 1), (1, 4, 5), (1, 5, 2), (2, 5, 6)]
    assert strips == features(*((5, it, 3) for it in triangles), (5, (4, 8, 5), 1), (5, (5, 8, 9), 1))
    assert [name for name, *_ in strips] == ["feature-1", "feature-3"]


def test_polyhedra_and_quadratic_cells_are_refused_by_name():
    pyvista = pytest.importorskip("pyvista")
    corners = [(x, y, z) for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)]
    sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    faces = [len(sides), *(number for side in sides for number in (len(side), *side))]
    polyhedron = pyvista.UnstructuredGrid([len(faces), *faces], [pyvista.CellType.POLYHEDRON], np.array(corners))
    quadratic = pyvista.UnstructuredGrid({24: np.arange(10)[None]}, np.eye(10, 3))
    for given, text in (
        (polyhedron, "found 1 polyhedra, expected cells of other types"),
        (quadratic, r"found 1 quadratic cells \(VTK's type 24\), expected linear cells: .* mesh\.linear_copy\(\)"),
        (pyvista.MultiBlock({"wing": pyvista.Cube(), "tail": pyvista.Cube()}), r"'wing', 'tail' .* mesh\.combine\(\)"),
        (vtkMultiBlockDataSet(), "a vtkMultiBlockDataSet of no block"),
    ):
        with pytest.raises(tombolo.MeshError, match=text):
            tombolo.Shaper(given)


def test_a_mesh_of_pyvista_is_not_asked_for_all_its_cells():
    pyvista = pytest.importorskip("pyvista")

    class Grid(pyvista.UnstructuredGrid):
        @property
        def cells_dict(self):
            raise AssertionError("it would be made of all cells")

    assert len(tombolo.Shaper(Grid({10: TETS}, POINTS)).scaled_jacobians()) == len(TETS)
