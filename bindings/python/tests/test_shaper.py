"""Shapes without a run, against the program `tombolo` and against closed forms."""

import json
import subprocess
import sys
import threading

import numpy as np
import pytest
import tombolo
from conftest import PROJECT, SQUEEZE, box, ends, features_of, features_of_program, program

meshio = pytest.importorskip("meshio")
POINTS, TETS = box(4)
FACES = ends(POINTS, TETS)


def shaper_of(points=POINTS, tets=TETS, faces=FACES):
    return tombolo.Shaper(points, {"tetra": tets}, faces)


def at(shaper, height):
    """The name of the feature that lies at a height."""
    (name,) = (it["name"] for it in shaper.features if all(corner[2] == height for corner in it["bounds"]))
    return name


def bend(shaper):
    parts = {"features": [at(shaper, 1)], "fixed": [at(shaper, 0)]}
    return [
        {"translate": {**parts, "by": [0.1, 0, -0.2], "harmonic_order": 2}},
        {"rotate": {**parts, "axis": [0, 0, 1], "degrees": 10}},
    ]


def edits_of(tmp_path, edits):
    file = tmp_path / "edits.json"
    file.write_text(json.dumps(edits))
    return file


def mesh_file(tmp_path):
    file = tmp_path / "box.vtu"
    meshio.Mesh(POINTS, [("tetra", TETS)]).write(file, binary=True)
    return file


def test_shapes_are_those_of_the_program_to_the_bit(tmp_path):
    shaper = shaper_of(faces=None)
    edits = bend(shaper)
    file = edits_of(tmp_path, edits)
    done = program(
        "edit",
        "--mesh",
        mesh_file(tmp_path),
        "--edits",
        file,
        "--out",
        tmp_path / "out.vtu",
        "--displacement",
        tmp_path / "moved.txt",
        "--json",
    )
    assert done.returncode == 0, done.stderr
    outcome = json.loads(done.stdout)
    shape = shaper.shape(edits)
    assert np.array_equal(shape.points, meshio.read(tmp_path / "out.vtu").points)
    assert shape.quality == outcome["after"] and shaper.quality() == outcome["before"]
    assert (shape.fraction, shape.details["iterations"]) == (outcome["fraction"], outcome["iterations"])
    assert np.array_equal(shaper.shape(file).points, shape.points)
    forecast = json.loads(
        program("edit", "--mesh", mesh_file(tmp_path), "--edits", file, "--forecast", "--json").stdout
    )
    forecast.pop("seconds")
    assert {**shaper.forecast(edits), "seconds": 0} == {**forecast, "seconds": 0}
    # The displacement is taken again.
    moved = shaper.displacement(edits)
    again = [{"displacement": {"vertices": shaper.surface.vertices, "values": moved}}]
    assert np.array_equal(shaper.shape(again).points, shape.points)
    assert np.array_equal(shaper.shape([{"displacement": {"file": str(tmp_path / "moved.txt")}}]).points, shape.points)


def test_features_and_skeleton_are_those_of_the_program(tmp_path):
    for angle in (None, 30.0):
        told = program("features", "--mesh", mesh_file(tmp_path), "--json", *(["--angle", angle] if angle else []))
        assert tombolo.Shaper(POINTS, {"tetra": TETS}, angle=angle).features == json.loads(told.stdout)["features"]
    points = POINTS * [1, 1, 5]
    meshio.Mesh(points, [("tetra", TETS)]).write(tmp_path / "long.vtu")
    done = program("skeleton", "--mesh", tmp_path / "long.vtu", "--out", tmp_path / "bones.vtu", "--json")
    assert done.returncode == 0, done.stderr
    skeleton, summary = tombolo.Shaper(points, {"tetra": TETS}).skeleton(), json.loads(done.stdout)
    assert (len(skeleton.nodes), len(skeleton.curves)) == (summary["nodes"], summary["curves"])
    bones = program("skeleton", "--mesh", tmp_path / "long.vtu", "--out", tmp_path / "bones.vtp")
    assert bones.returncode == 0
    pyvista = pytest.importorskip("pyvista")
    read = pyvista.read(tmp_path / "bones.vtp")
    assert np.array_equal(np.asarray(read.points, float), skeleton.nodes)
    assert np.array_equal(read.point_data["radius"], skeleton.radii)


def test_a_named_part_that_is_no_face_of_the_mesh_is_refused():
    with pytest.raises(tombolo.MeshError, match=r"lid.* no face of any cell"):
        shaper_of(faces={**FACES, "lid": np.array([[0, 1, len(POINTS) - 1]])})


def test_meshes_of_others_are_taken(tmp_path):
    shaper = shaper_of(faces=None)
    edits = bend(shaper)
    expected = shaper.shape(edits).points
    surface = np.array([[0, 1, 2]])
    of_meshio = meshio.Mesh(POINTS, [("tetra", TETS[:50]), ("triangle", surface), ("tetra", TETS[50:])])
    assert np.array_equal(tombolo.Shaper(of_meshio).shape(edits).points, expected)
    pyvista = pytest.importorskip("pyvista")
    grid = pyvista.UnstructuredGrid({pyvista.CellType.TETRA: TETS}, POINTS)
    shaper = tombolo.Shaper(grid)
    assert np.array_equal(shaper.shape(edits).points, expected)
    assert shaper.surface.to_pyvista().area == pytest.approx(6)
    sphere = pyvista.Sphere()
    turned = tombolo.Shaper(sphere, angle=170).shape([{"displacement": {"vertices": [0], "values": [[0, 0, 0.05]]}}])
    assert turned.points.shape == (sphere.n_points, 3)


@pytest.mark.parametrize("version", ["2.2", "2.2-ascii", "4.1", "4.1-ascii"])
def test_physical_surfaces_of_gmsh_are_features_by_name(version, tmp_path):
    pytest.importorskip("gmsh")
    command = [sys.executable, PROJECT / "scripts/meshes", "channel-5k", "--out", tmp_path, "--format", version]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    file = tmp_path / "channel-5k.msh"
    mesh = meshio.read(file)
    found = features_of(mesh)
    assert [name for name, *_ in found] == ["inlet", "upstream", "throat", "downstream", "outlet"]
    assert found == features_of_program(file)
    # The numbers alone, and then not even those.
    mesh.field_data = {}
    assert [name for name, *_ in features_of(mesh)] == [f"feature-{number}" for number in range(1, 6)]
    assert len(tombolo.Shaper(mesh).scaled_jacobians()) == sum(len(it.data) for it in mesh.cells if it.type == "tetra")
    mesh.cell_data = mesh.cell_sets = {}
    assert features_of(mesh) == features_of(meshio.Mesh(mesh.points, [("tetra", mesh.get_cells_type("tetra"))]))


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("dimension", [2, 3])
def test_groups_of_gmsh_of_every_kind_are_those_of_the_program(version, dimension, tmp_path):
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
        # Triangles and quadrangles: the sides of an extruded square.
        square = gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.extrude([(2, square)], 0, 0, 1, numElements=[3], recombine=True)
        gmsh.model.occ.synchronize()
        surfaces = [tag for _, tag in gmsh.model.getEntities(2)]
        # In no order, one without a name, a curve's name too, a face in two groups, and a face in a group of no name.
        gmsh.model.addPhysicalGroup(2, surfaces[:1], 7, "foot")
        gmsh.model.addPhysicalGroup(2, surfaces[1:3], 3, "two sides")
        gmsh.model.addPhysicalGroup(2, surfaces[2:4], 2, "again")
        gmsh.model.addPhysicalGroup(2, surfaces[4:], 9)
        gmsh.model.addPhysicalGroup(1, [gmsh.model.getEntities(1)[0][1]], 4, "edge")
        if dimension == 3:
            gmsh.model.addPhysicalGroup(3, [gmsh.model.getEntities(3)[0][1]], 7, "inside")
        gmsh.model.mesh.generate(dimension)
        gmsh.write(str(tmp_path / "groups.msh"))
    finally:
        gmsh.finalize()
    mesh = meshio.read(tmp_path / "groups.msh")
    assert {"triangle", "quad"} <= {block.type for block in mesh.cells}
    found = features_of(mesh)
    assert found == features_of_program(tmp_path / "groups.msh")
    assert {"foot", "two sides", "feature-9"} <= {name for name, *_ in found}


def test_what_would_break_the_mesh_is_rejected_and_forecast():
    shaper = shaper_of()
    fold = [{"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, -1.5]}}]
    with pytest.raises(tombolo.RejectedError) as refused:
        shaper.shape(fold, guard={"otherwise": "reject"})
    assert "fraction" in refused.value.report
    assert shaper.forecast(fold, guard={"otherwise": "reject"}).outcome == "rejected"
    clamped = shaper.shape(fold, guard={"otherwise": "clamp"})
    assert 0 < clamped.fraction < 1 and clamped.quality["inverted"] == 0
    with pytest.raises(tombolo.ConfigurationError, match=r"order:1:\d+: .*did you mean `translate`"):
        shaper.shape([{"translat": {}}])
    with pytest.raises(tombolo.ConfigurationError, match="undo"):
        shaper.shape({"undo": 1})
    for nothing in ([], {"edits": []}):
        with pytest.raises(tombolo.ConfigurationError, match="expected at least one edit"):
            shaper.shape(nothing)
    with pytest.raises(tombolo.TomboloError, match="top"):
        shaper.displacement([{"translate": {"features": ["tpo"], "by": [0, 0, 1]}}])


def test_what_is_no_mesh_is_told():
    for given, text in (
        ((POINTS, {"tetra": TETS + 1}), "125"),
        ((POINTS, {"line": TETS[:, :2]}), None),
        ((np.full_like(POINTS, np.inf), {"tetra": TETS}), "inf"),
        ((3,), "expected a tombolo.Mesh"),
    ):
        with pytest.raises(tombolo.MeshError, match=text):
            tombolo.Shaper(*given)
    for given in (tombolo.Mesh(POINTS, {"tetra": TETS}), meshio.Mesh(POINTS, [("tetra", TETS)])):
        with pytest.raises(tombolo.MeshError, match="faces: found them without cells"):
            tombolo.Shaper(given, faces=FACES)
    shaper = tombolo.Shaper(POINTS, {"tetra": TETS})
    with pytest.raises(tombolo.MeshError, match="one for each vertex"):
        shaper.quality(POINTS[:-1])
    with pytest.raises(tombolo.MeshError, match="points"):
        shaper.quality("nonsense")


def test_long_work_tells_what_it_is_at():
    points, tets = box(36)
    told = []
    faces = ends(points, tets)
    shaper = tombolo.Shaper(points, {"tetra": tets}, faces, progress=lambda *now: told.append(now))
    assert told and {phase for phase, _ in told} == {"mesh"}
    turn = [{"rotate": {"features": ["top"], "fixed": ["bottom"], "axis": [0, 0, 1], "degrees": 30}}]
    told.clear()
    shape = shaper.shape(turn, progress=lambda *now: told.append(now))
    phases, seconds = zip(*told)
    assert phases[0] == "surface" and {"volume"} <= set(phases) <= {"surface", "volume", "guard"}
    assert list(seconds) == sorted(seconds) and sum(shape.details["seconds"].values()) > 0.1 * (len(told) - 2)
    told.clear()
    shaper.skeleton(progress=lambda *now: told.append(now))
    assert told and {phase for phase, _ in told} == {"skeleton"}


def test_long_work_tells_how_long_and_is_given_up():
    points, tets = box(14)
    shaper, seconds = shaper_of(points, tets, ends(points, tets)), []
    turn = [{"rotate": {"features": ["top"], "fixed": ["bottom"], "axis": [0, 0, 1], "degrees": 45}}]

    def progress(phase, elapsed):
        seconds.append(elapsed)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        shaper.shape(turn, progress=progress)
    assert len(seconds) == 1 and seconds[0] >= 0
    done = threading.Event()

    def cancel():
        while not done.wait(0.001):
            shaper.cancel()

    thread = threading.Thread(target=cancel)
    thread.start()
    try:
        with pytest.raises(tombolo.RejectedError, match=r"(?i)cancel|given up"):
            shaper.shape(turn)
    finally:
        done.set()
        thread.join()
    # It can be used again.
    assert shaper.displacement(SQUEEZE).shape == shaper.surface.points.shape


def test_a_refused_call_of_another_thread_takes_no_cancellation_back():
    points, tets = box(28)
    shaper, refused = shaper_of(points, tets, ends(points, tets)), []
    turn = [{"rotate": {"features": ["top"], "fixed": ["bottom"], "axis": [0, 0, 1], "degrees": 45}}]

    def progress(phase, elapsed):
        if elapsed > 0.05 and not refused:
            shaper.cancel()
            with pytest.raises(tombolo.CallError, match="in another call"):
                shaper.displacement(SQUEEZE)
            refused.append(elapsed)

    with pytest.raises(tombolo.RejectedError, match=r"(?i)cancel|given up"):
        shaper.shape(turn, progress=progress)
    assert refused


def plate():
    """The unit square as quadrangles, in two coordinates, and its two halves."""
    axis = np.linspace(0, 1, 5)
    points = np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    numbers = np.arange(25).reshape(5, 5)
    quads = np.stack([numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]], -1).reshape(-1, 4)
    is_left = points[quads, 0].mean(1) < 0.5
    return points, {"quad": quads}, {"left": quads[is_left], "right": quads[~is_left]}


def test_a_mesh_of_two_coordinates_stays_in_its_plane():
    shaper = tombolo.Shaper(*plate())
    inside = [{"translate": {"features": ["left"], "by": [0.1, 0, 0]}}]
    shape = shaper.shape(inside)
    assert shape.points.shape == (25, 2)
    moved = shaper.displacement(inside)
    assert moved.shape == shaper.surface.points.shape
    again = [{"displacement": {"vertices": shaper.surface.vertices, "values": moved}}]
    assert np.array_equal(shaper.displacement(again), moved)
    assert np.array_equal(shaper.shape(again).points, shape.points)
    outside = [{"translate": {"features": ["left"], "by": [0.1, 0, 0.3]}}]
    with pytest.raises(tombolo.RejectedError, match="along z, expected 0"):
        shaper.shape(outside)
    assert "along z" in shaper.forecast(outside).reason
    # A motion out of the plane would be lost on the way to the solver.
    points, cells, faces = plate()
    orders = [{"at": {"cycle": 1}, "order": {"edits": edits}} for edits in (outside, inside)]
    with tombolo.Adaptor({"version": 1}, orders=orders) as adaptor:
        for cycle in range(6):
            steering = adaptor.execute(cycle, 0.1 * cycle, 0.1, tombolo.Mesh(points, cells, faces=faces))
            if steering.motion is not None:
                points[:] = steering.motion.coordinates
    assert [order["status"] for order in adaptor.report["orders"]] == ["rejected", "applied"]
    assert "along z" in adaptor.report["orders"][0]["reason"]


@pytest.mark.parametrize("work", ["skeleton", "displacement", "shape"])
def test_work_of_each_kind_is_given_up(work):
    points, tets = box(12)
    shaper = shaper_of(points * [1, 1, 5], tets, ends(points, tets))
    edits = [{"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, 0.1], "harmonic_order": 3}}]
    calls = {
        "skeleton": lambda progress: shaper.skeleton(progress=progress),
        "displacement": lambda progress: shaper.displacement(edits, progress=progress),
        "shape": lambda progress: shaper.shape(edits, progress=progress),
    }
    # Whatever it is at: the first look finds it cancelled.
    renew = shaper._shaper.renew

    class Cancelled:
        def __getattr__(self, name):
            return getattr(native, name)

        def renew(self):
            renew()
            native.cancel()

    native, shaper._shaper = shaper._shaper, Cancelled()
    with pytest.raises(tombolo.RejectedError, match="given up"):
        calls[work](None)
    shaper._shaper = native
    assert calls[work](None) is not None


def test_features_are_named_under_either_name():
    named = {"faces": FACES}, {"features": FACES}
    of_faces, of_features = (tombolo.Shaper(POINTS, {"tetra": TETS}, **given) for given in named)
    assert of_faces.features == of_features.features == shaper_of().features
    with pytest.raises(tombolo.MeshError, match="found faces beside them"):
        tombolo.Shaper(POINTS, {"tetra": TETS}, FACES, features=FACES)


def test_named_sets_of_faces_are_features(tmp_path):
    blocks = [("triangle", FACES["top"]), ("tetra", TETS), ("triangle", FACES["bottom"])]
    counts = [len(rows) for _, rows in blocks]
    nothing = np.array([], int)
    sets = {
        "top": [np.arange(counts[0]), nothing, nothing],
        "bottom": [nothing, nothing, np.arange(counts[2])],
        "steel": [nothing, np.arange(counts[1]), nothing],
    }
    mesh = meshio.Mesh(POINTS, blocks, cell_sets=sets)
    assert features_of(mesh) == [(it["name"], it["faces"], it["vertices"]) for it in shaper_of().features]
    mesh.write(tmp_path / "box.inp")
    assert {it["name"] for it in tombolo.Shaper(meshio.read(tmp_path / "box.inp")).features} >= {"top", "bottom"}


#: One cell of each type, in the order of VTK's code: its manual turns wedges round.
CELLS = {
    "tetra": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    "hexahedron": [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))],
    "wedge": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)],
    "pyramid": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 0.7)],
}


@pytest.mark.parametrize("kind", CELLS)
def test_scaled_jacobians_are_those_that_vtk_measures(kind):
    pyvista = pytest.importorskip("pyvista")
    corners = np.array(CELLS[kind], float)
    # Cells beside each other, each with its corners moved by up to a fifth, and one that is turned inside out.
    points = corners[None] + np.random.default_rng(1).uniform(-0.2, 0.2, (50, *corners.shape))
    points[-1] *= [1, 1, -1]
    points = (points + 3 * np.arange(50)[:, None, None] * [1, 0, 0]).reshape(-1, 3)
    mesh = meshio.Mesh(points, [(kind, np.arange(len(points)).reshape(50, -1))])
    measured = pyvista.from_meshio(mesh).cell_quality("scaled_jacobian").cell_data["scaled_jacobian"]
    shaper = tombolo.Shaper(mesh)
    np.testing.assert_allclose(shaper.scaled_jacobians(), measured, atol=1e-12)
    assert shaper.quality()["inverted"] == np.count_nonzero(measured <= 0) > 0


def test_cells_of_meshio_that_are_not_linear_are_told():
    curved = meshio.Mesh(np.eye(10, 3), [("tetra10", np.arange(10)[None])])
    with pytest.raises(tombolo.MeshError, match=r"'tetra10'.*\{'tetra': mesh.cells_dict\['tetra10'\]\[:, :4\]\}"):
        tombolo.Shaper(curved)
    with pytest.raises(tombolo.MeshError, match="found polyhedra"):
        tombolo.Shaper(meshio.Mesh(POINTS, [("polyhedron4", [[[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]])]))
    # What the first of them advises.
    points, tets = box(1)
    middles = [(a, b) for a in range(4) for b in range(a)]
    beside = np.concatenate([points, *((points[tets[:, a]] + points[tets[:, b]]) / 2 for a, b in middles)])
    numbers = np.concatenate([tets, len(points) + np.arange(6 * len(tets)).reshape(6, -1).T], axis=1)
    mesh = meshio.Mesh(beside, [("tetra10", numbers)])
    shaper = tombolo.Shaper(mesh.points, {"tetra": mesh.cells_dict["tetra10"][:, :4]}, ends(points, tets))
    assert shaper.shape(SQUEEZE).quality["inverted"] == 0


def prism(corners):
    """A prism on a regular polygon: points and cells."""
    angles = 2 * np.pi * np.arange(corners) / corners
    points = [[np.cos(angle), np.sin(angle), height] for height in (0.0, 1.0) for angle in angles]
    return np.array(points), {{5: "pentagonal prism", 6: "hexagonal prism"}[corners]: np.arange(2 * corners)[None]}


@pytest.mark.parametrize("corners", [5, 6])
def test_the_surface_of_a_prism_is_taken_back_from_meshio(corners):
    points, cells = prism(corners)
    sides = [[at, (at + 1) % corners, (at + 1) % corners + corners, at + corners] for at in range(corners)]
    shaper = tombolo.Shaper(points, cells, {"sides": sides})
    again = shaper.surface.to_meshio()
    assert {block.type for block in again.cells} == {"quad", "polygon"}
    assert features_of(again) == [(it["name"], it["faces"], it["vertices"]) for it in shaper.features]
    edits = [{"scale_direction": {"features": ["untagged"], "factors": [2, 1, 1]}}]
    assert np.array_equal(tombolo.Shaper(again).displacement(edits), shaper.displacement(edits))


def test_polygons_of_meshio_are_those_of_the_program(tmp_path):
    pyvista = pytest.importorskip("pyvista")
    tube = pyvista.Cylinder(resolution=7).cast_to_unstructured_grid()
    for numbers in (None, [0] * 7 + [1, 2]):
        if numbers is not None:
            tube.cell_data["features"] = np.array(numbers)
        tube.save(tmp_path / "tube.vtu")
        mesh = meshio.read(tmp_path / "tube.vtu")
        assert "polygon" in {block.type for block in mesh.cells}
        assert features_of(mesh) == features_of_program(tmp_path / "tube.vtu")
    # Of several sizes, triangles and quadrangles among them, in named sets.
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [3, 1, 0], [2, 2, 0], [0, 2, 0]], float)
    rows = [[0, 1, 2, 3]], [[1, 4, 5, 6, 2]], [[3, 2, 7]]
    sets = {"square": [[0], [], []], "rest": [None, np.array([0]), [0]]}
    mesh = meshio.Mesh(points, [("polygon", np.array(it)) for it in rows], cell_sets=sets)
    assert features_of(mesh) == [("square", 1, 4), ("rest", 2, 7)]
    assert len(tombolo.Shaper(mesh).scaled_jacobians()) == 3
    # Beside volume cells they are of the boundary.
    points, _ = prism(5)
    tets = [[0, 1, 2, 5], [0, 2, 3, 5]]
    mesh = meshio.Mesh(points, [("tetra", np.array(tets)), ("polygon", np.arange(5)[None])])
    assert len(tombolo.Shaper(mesh).scaled_jacobians()) == 2
    curved = meshio.Mesh(points, [("polygon", np.arange(5)[None]), ("VTK_LAGRANGE_TRIANGLE", np.arange(6)[None])])
    with pytest.raises(tombolo.MeshError, match="found cells of type 'VTK_LAGRANGE_TRIANGLE'"):
        tombolo.Shaper(curved)
    with pytest.raises(tombolo.MeshError, match=r"found polygons of shape \(0,\), expected a row for each"):
        tombolo.Shaper(meshio.Mesh(points, [("polygon", np.array([]))]))


def test_features_of_meshio_that_make_no_sense_are_told():
    blocks = [("tetra", TETS), ("triangle", FACES["top"])]
    texts = {"features": [np.full(len(rows), "wall") for _, rows in blocks]}
    with pytest.raises(tombolo.MeshError, match="'features': found other values, expected a whole number"):
        tombolo.Shaper(meshio.Mesh(POINTS, blocks, cell_data=texts))
    for wrong, found in (
        ([0, 99], "cell 99"),
        ([-1], "cell -1"),
        (["a"], "an array of <U1"),
        ([True], "an array of bool"),
    ):
        mesh = meshio.Mesh(POINTS, blocks, cell_sets={"lid": [[], np.array(wrong)]})
        with pytest.raises(tombolo.MeshError, match=f"the set of cells 'lid': found {found}.* expected the numbers"):
            tombolo.Shaper(mesh)


@pytest.mark.parametrize("angle", ["30", 181, -1.0, float("nan"), [30], True])
def test_what_is_no_angle_is_told(angle):
    with pytest.raises(tombolo.MeshError, match=r"angle: found .*, expected degrees from 0 to 180"):
        tombolo.Shaper(POINTS, {"tetra": TETS}, angle=angle)


def test_a_feature_whose_faces_are_all_in_others_is_told():
    top, bottom = FACES["top"], FACES["bottom"]
    for faces, text in (
        ({"wall": np.concatenate([top, bottom]), "top": top}, "the feature 'top': found all of its faces in 'wall'"),
        (
            {"top": top, "bottom": bottom, "all": {"triangle": np.concatenate([bottom, top[:, ::-1]])}},
            "'top' and 'bottom'",
        ),
    ):
        mesh = tombolo.Mesh(POINTS, {"tetra": TETS}, faces=faces)
        for given in ((POINTS, {"tetra": TETS}, faces), (mesh,), ({"solid": mesh},)):
            with pytest.raises(tombolo.MeshError, match=text):
                tombolo.Shaper(*given)
        assert len(tombolo.Shaper(mesh, angle=30).features) == 6
    # A face of its own is enough, and faces inside are of no feature of the surface.
    some = {"wall": top[1:], "top": top}
    inside = np.sort(TETS[:, [[0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1]]].reshape(-1, 3), axis=1)
    rows, counts = np.unique(inside, axis=0, return_counts=True)
    shaper = shaper_of(faces={**some, "inside": rows[counts == 2]})
    assert [(it["name"], it["faces"]) for it in shaper.features[:2]] == [("wall", len(top) - 1), ("top", 1)]


def test_volume_cells_have_three_coordinates():
    for points in (POINTS[:, :2], (POINTS[:, 0].copy(), POINTS[:, 1].copy())):
        for cells in ({"tetra": TETS}, {10: TETS}):
            with pytest.raises(tombolo.MeshError, match="found two coordinates, expected three: cells of type 'tetra'"):
                tombolo.Shaper(points, cells)
    of_vtk = {"connectivity": TETS.ravel(), "offsets": 4 * np.arange(len(TETS) + 1), "types": np.full(len(TETS), 10)}
    with pytest.raises(tombolo.MeshError, match="found two coordinates"):
        tombolo.Shaper(POINTS[:, :2], of_vtk)


def test_truth_values_number_no_vertices():
    truth = FACES["top"] > 0
    for given, what in (
        ((POINTS, {"tetra": TETS > 0}), r"cells\['tetra'\]"),
        ((POINTS, {"tetra": TETS}, {"top": truth}), r"faces\['top'\]"),
        ((POINTS, {"tetra": TETS}, {"top": {"triangle": truth}}), r"faces\['top'\]\['triangle'\]"),
    ):
        with pytest.raises(tombolo.MeshError, match=f"{what}: found an array of bool; expected vertex numbers"):
            tombolo.Shaper(*given)


def test_polyhedra_of_meshio_are_refused_by_what_they_are():
    faces = [[np.array([0, 1, 2]), np.array([0, 1, 3]), np.array([1, 2, 3, 0])]]
    with pytest.raises(tombolo.MeshError, match="found polyhedra"):
        tombolo.Shaper(meshio.Mesh(np.eye(4, 3), [("polyhedron4", faces)]))
