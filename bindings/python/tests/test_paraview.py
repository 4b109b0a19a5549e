"""The plug-in of ParaView: in plain VTK, and in ParaView's own Python where that is installed."""

import ast
import gc
import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
import tombolo
from conftest import FLOW, TARGET, ends, study, wait

CLIENT = Path(__file__).parents[3] / "clients/paraview"
SURFACE = {
    "name": "surface",
    "every": {"steps": 10},
    "stages": [
        {"surface": {}},
        {"select": {"fields": ["velocity", "pressure"]}},
        {"write": {"file": "surface-{cycle}.vtp"}},
        {"stream": {"error": {"relative": 1e-3}}},
    ],
}


class Plugin:
    """The plug-in's classes in plain VTK, which has the same base class; what ParaView is told of them is kept."""

    def __init__(self, monkeypatch):
        algorithm = pytest.importorskip("vtkmodules.util.vtkAlgorithm")
        self.errors, self.names, self.properties = [], {}, {}

        def proxy(*, name, label, support_reload):
            return lambda kind: self.names.setdefault(name, kind)

        def properties(text):
            def keep(kind):
                self.properties[kind.__name__] = ElementTree.fromstring(f"<all>{text}</all>")
                return kind

            return keep

        def hint(text):
            assert ElementTree.fromstring(text).tag in {"LiveSource", "ShowInMenu"}
            return lambda kind: kind

        stand_ins = {
            "paraview": {"print_error": self.errors.append},
            "paraview.util": {},
            "paraview.util.vtkAlgorithm": {
                "VTKPythonAlgorithmBase": algorithm.VTKPythonAlgorithmBase,
                "smproxy": SimpleNamespace(source=proxy, filter=proxy),
                "smproperty": SimpleNamespace(xml=properties),
                "smhint": SimpleNamespace(xml=hint),
            },
        }
        for name, members in stand_ins.items():
            module = ModuleType(name)
            vars(module).update(members)
            monkeypatch.setitem(sys.modules, name, module)
        file = CLIENT / "tombolo_paraview.py"
        specification = importlib.util.spec_from_file_location(file.stem, file)
        specification.loader.exec_module(importlib.util.module_from_spec(specification))

    def make(self, name, *inputs, **properties):
        """A source or filter with its properties, as ParaView would set them: by the commands in the XML."""
        made = self.names[name]()
        for port, given in enumerate(inputs):
            made.SetInputConnection(port, given.GetOutputPort())
        for element in self.properties[name]:
            if element.get("name") in properties:
                value = properties[element.get("name")]
                values = value if isinstance(value, (list, tuple)) else [value]
                assert len(values) == int(element.get("number_of_elements"))
                getattr(made, element.get("command"))(*values)
        return made


@pytest.fixture
def plugin(monkeypatch, connections):
    """The plug-in in plain VTK."""
    return Plugin(monkeypatch)


def shown(source):
    """What a source or filter shows now."""
    source.Update()
    return source.GetOutputDataObject(0)


def newest(source):
    """What a live source shows once there is something new, as ParaView's interface asks for it."""
    wait(source.GetNeedsUpdate)
    return shown(source)


def expected_of(solver):
    """The displacements that the filters of the tests are to make of a solver's mesh."""
    shaper = tombolo.Shaper(solver.reference, {"tetra": solver.cells}, ends(solver.reference, solver.cells))
    handle = {"features": ["top"], "fixed": ["bottom"]}
    turned = {"rotate": {**handle, "axis": [0, 0, 1], "degrees": 20, "harmonic_order": 1}}
    expected = {
        "translate": shaper.displacement([{"translate": {**handle, "by": [0.1, 0, 0.2]}}]),
        "rotate": shaper.displacement([turned]),
        "scale_direction": shaper.displacement([{"scale_direction": {**handle, "factors": [0.5, 1, 1]}}]),
        "scale_normals": shaper.displacement([{"scale_normals": {**handle, "distance": 0.1}}]),
        "two": shaper.displacement([turned, {"translate": {**handle, "by": [0, 0, 0.1]}}]),
    }
    expected["sum"] = expected["translate"] + 0.5 * expected["rotate"]
    return shaper, expected


def test_each_command_of_the_interface_is_a_method_that_keeps_the_default(plugin):
    assert len(plugin.names) == 12
    for name, properties in plugin.properties.items():
        made = plugin.names[name]()
        before = made.GetMTime()
        for element in properties:
            if element.tag == "PropertyGroup":
                assert element[0].get("name") in {other.get("name") for other in properties}
            elif element.tag == "Property":
                assert callable(getattr(made, element.get("command")))
            elif element.tag != "InputProperty":
                words = element.get("default_values").split()
                values = words or [None] if element.tag == "StringVectorProperty" else [*map(float, words)]
                assert len(values) == int(element.get("number_of_elements"))
                getattr(made, element.get("command"))(*values)
        assert made.GetMTime() == before, name


def test_each_filter_moves_the_surface_in_plain_vtk(plugin, solver, tmp_path):
    from tombolo import vtk

    source = plugin.make("TomboloSurface", Link=solver.link)
    assert newest(source).GetNumberOfPoints() > 0
    assert not source.GetNeedsUpdate()
    ends = {"Features": "top", "Fixed": " bottom, "}
    made = {
        "translate": plugin.make("TomboloTranslate", source, By=[0.1, 0, 0.2], **ends),
        "rotate": plugin.make("TomboloRotate", source, Axis=[0, 0, 1], Degrees=20, HarmonicOrder=1, **ends),
        "scale_direction": plugin.make("TomboloScaleDirection", source, Factors=[0.5, 1, 1], **ends),
        "scale_normals": plugin.make("TomboloScaleNormals", source, Distance=0.1, **ends),
    }
    made["two"] = plugin.make("TomboloTranslate", made["rotate"], By=[0, 0, 0.1], **ends)
    made["sum"] = plugin.make("TomboloCombine", made["translate"], made["rotate"], Weights=[1, 0.5])
    shaper, expected = expected_of(solver)
    for name, moved in expected.items():
        assert np.array_equal(vtk.array(shown(made[name]).GetPointData(), "displacement"), moved), name
    written = plugin.make("TomboloExport", made["two"], FileName=str(tmp_path / "two.txt"))
    written.Write()
    assert np.array_equal(shaper.displacement([{"displacement": {"file": str(tmp_path / "two.txt")}}]), expected["two"])
    by_angle = plugin.make("TomboloFeaturesByAngle", source, Angle=40)
    assert len(vtk.texts(shown(by_angle), "feature_names")) == 6
    assert vtk.array(shown(plugin.make("TomboloSkeleton", source)).GetPointData(), "radius").min() > 0
    assert plugin.errors == []

    wrong = plugin.make("TomboloTranslate", source, Features="top", By=[0, 0, 1])
    behind = plugin.make("TomboloTranslate", wrong, By=[0, 0, 0.1], **ends)
    assert shown(behind).GetNumberOfPoints() > 0
    wrong.SetFeatures("tpo")
    for _ in range(2):
        wrong.Modified()
        # Nothing is shown, rather than the shape of before, and by those behind it as well.
        assert shown(behind).GetNumberOfPoints() == shown(wrong).GetNumberOfPoints() == 0
    assert len(plugin.errors) == 1 and "tpo" in plugin.errors[0]
    plugin.make("TomboloDragSkeleton", source, Fixed="bottom", At=[0.5, 0.5, 0.5], To=[0.6, 0.5, 0.5]).Update()
    # A cube has no curve in its middle.
    assert "no node that can be dragged" in plugin.errors[-1]


def test_an_edit_adds_to_what_no_list_of_edits_stands_for_in_plain_vtk(plugin, solver):
    from tombolo import vtk

    source = plugin.make("TomboloSurface", Link=solver.link)
    newest(source)
    ends = {"Features": "top", "Fixed": "bottom"}
    first = plugin.make("TomboloTranslate", source, By=[0.1, 0, 0], **ends)
    second = plugin.make("TomboloTranslate", source, By=[0, 0.2, 0], **ends)
    both = plugin.make("TomboloCombine", first, second)
    by_angle = plugin.make("TomboloFeaturesByAngle", first, Angle=40)
    connected = tombolo.background.connection(solver.link)
    reference = connected.surface
    on_top = reference.points[:, 2] == 1
    last = plugin.make("TomboloTranslate", both, By=[0, 0, 0.3], **ends)
    data = shown(last)
    moved = vtk.array(data.GetPointData(), "displacement")
    np.testing.assert_allclose(moved[on_top], np.tile([0.1, 0.2, 0.3], (on_top.sum(), 1)), atol=1e-12)
    # The run makes the same of the order.
    order = plugin.make("TomboloOrder", last)
    order.Update()
    edits = order.edits(connected)
    assert [next(iter(edit)) for edit in edits] == ["displacement", "translate"]
    shaper, _ = expected_of(solver)
    assert np.array_equal(shaper.displacement(edits), moved)

    # What moves nothing is no edit.
    nothing = plugin.make("TomboloCombine", first, first, Weights=[1, -1])
    alone = plugin.make("TomboloTranslate", nothing, By=[0, 0, 0.3], **ends)
    moved = vtk.array(shown(alone).GetPointData(), "displacement")
    np.testing.assert_allclose(moved[on_top], np.tile([0, 0, 0.3], (on_top.sum(), 1)), atol=1e-12)

    before = vtk.array(shown(by_angle).GetPointData(), "displacement")
    numbers = vtk.array(shown(by_angle).GetCellData(), "features")
    names = vtk.texts(shown(by_angle), "feature_names")
    triangles = reference.points[reference.connectivity.reshape(-1, 3)]
    top, bottom = (names[numbers[np.all(triangles[:, :, 2] == z, axis=1)][0]] for z in (1, 0))
    last = plugin.make("TomboloTranslate", by_angle, Features=top, Fixed=bottom, By=[0, 0, 0.3])
    moved = vtk.array(shown(last).GetPointData(), "displacement")
    np.testing.assert_allclose(moved[on_top], before[on_top] + [0, 0, 0.3], atol=1e-12)
    assert plugin.errors == []


def test_a_run_is_followed_and_steered_in_plain_vtk(plugin, solver):
    from tombolo import vtk

    source = plugin.make("TomboloRun", Link=solver.link)
    first = vtk.array(newest(source).GetFieldData(), "cycle")[0]
    frame = newest(source)
    assert vtk.array(frame.GetFieldData(), "cycle")[0] > first
    assert frame.GetPointData().HasArray("temperature") and frame.GetCellData().HasArray("material")
    source.SetView("nothing")
    newest(source)
    assert "no view 'nothing'; there are: midplane" in plugin.errors[-1]
    assert not source.GetNeedsUpdate()

    surface = plugin.make("TomboloSurface", Link=solver.link)
    newest(surface)
    edits = plugin.make("TomboloTranslate", surface, Features="top", Fixed="bottom", By=[0, 0, -0.2])
    order = plugin.make("TomboloOrder", edits, Link=solver.link, Steps=2, Every=1)
    begin = solver.points.copy()

    def rows():
        order.Refresh()
        table = shown(order)
        texts = (
            [table.GetValue(row, column).ToString() for column in (0, 1)] for row in range(table.GetNumberOfRows())
        )
        return dict(texts)

    order.Forecast()
    wait(lambda: rows()["forecast"].startswith("applied"))
    assert rows()["stack"] == "0 edits"
    order.Give()
    wait(lambda: rows().get("status", "").startswith("applied"))
    wait(lambda: rows()["stack"] == "1 edit")
    # It is told before the solver has taken the coordinates.
    wait(lambda: solver.points[:, 2].max() == pytest.approx(0.8))
    order.Undo()
    wait(lambda: rows()["stack"] == "0 edits" and rows()["status"].startswith("applied"))
    wait(lambda: np.array_equal(solver.points, begin))
    # As how far points lie from the reference: none of them has moved.
    order.SetArray(None)
    order.SetInputConnection(surface.GetOutputPort())
    reference = tombolo.background.connection(solver.link).surface
    assert order.edits(SimpleNamespace(surface=reference)) == []
    other = reference._replace(vertices=reference.vertices + 1)
    with pytest.raises(tombolo.MeshError, match="found other vertices"):
        order.edits(SimpleNamespace(surface=other))


def test_an_order_makes_the_shape_that_its_chain_shows_whatever_was_before_in_plain_vtk(plugin, solver):
    from tombolo import vtk

    surface = plugin.make("TomboloSurface", Link=solver.link)
    newest(surface)
    run = tombolo.background.connection(solver.link).run
    ends = {"Features": "top", "Fixed": "bottom"}
    before = [{"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, 0.1]}}]
    run.order(before).wait(60)
    edits = plugin.make("TomboloTranslate", surface, By=[0, 0, -0.2], **ends)
    order = plugin.make("TomboloOrder", edits, Link=solver.link, Steps=2, Every=1)

    def ordered():
        count = len(run.orders)
        order.Give()
        wait(lambda: len(run.orders) > count)
        run.orders[-1].wait(60)
        return [edit["translate"]["by"] for edit in run.stack]

    assert ordered() == ordered() == [[0, 0, -0.2]]
    moved = vtk.array(shown(edits).GetPointData(), "displacement")
    reference = tombolo.background.connection(solver.link).surface
    expected = reference.points + moved
    wait(lambda: np.allclose(solver.points[reference.vertices], expected, rtol=0, atol=1e-12))
    # A displacement that no list of edits stands for is given in the same way.
    half = plugin.make("TomboloCombine", edits, edits, Weights=[0.25, 0.25])
    order.SetInputConnection(half.GetOutputPort())
    order.Give()
    wait(lambda: len(run.orders) == 4 and run.orders[-1].wait(60))
    wait(lambda: solver.points[:, 2].max() == pytest.approx(0.9))
    for expected in ([[0, 0, -0.2]], [[0, 0, -0.2]], [[0, 0, 0.1]]):
        count = len(run.orders)
        order.Undo()
        wait(lambda count=count: len(run.orders) > count)
        run.orders[-1].wait(60)
        assert [edit["translate"]["by"] for edit in run.stack] == expected
    wait(lambda: solver.points[:, 2].max() == pytest.approx(1.1))
    assert plugin.errors == []


def test_what_filters_of_vtk_make_of_a_chain_is_what_is_ordered(plugin, solver):
    from tombolo import vtk
    from vtkmodules.vtkCommonTransforms import vtkTransform
    from vtkmodules.vtkFiltersCore import vtkArrayCalculator
    from vtkmodules.vtkFiltersGeneral import vtkTransformFilter, vtkWarpVector

    surface = plugin.make("TomboloSurface", Link=solver.link)
    newest(surface)
    connected = tombolo.background.connection(solver.link)
    ends = {"Features": "top", "Fixed": "bottom"}
    edits = plugin.make("TomboloTranslate", surface, By=[0, 0, -0.2], **ends)
    order = plugin.make("TomboloOrder", edits, Link=solver.link)

    def ordered(source, array):
        """The displacement of the surface that an order behind a source makes."""
        order.SetInputConnection(source.GetOutputPort())
        order.SetArray(array)
        order.Update()
        given = order.edits(connected)
        return expected_of(solver)[0].displacement(given), [next(iter(edit)) for edit in given]

    def warped(factor):
        warp = vtkWarpVector()
        warp.SetInputConnection(edits.GetOutputPort())
        warp.SetInputArrayToProcess(0, 0, 0, 0, "displacement")
        warp.SetScaleFactor(factor)
        return warp

    def calculated(source, name):
        calculator = vtkArrayCalculator()
        calculator.SetInputConnection(source.GetOutputPort())
        calculator.SetAttributeTypeToPointData()
        calculator.AddCoordinateScalarVariable("coordsZ", 2)
        calculator.SetFunction("coordsZ*0.15*kHat")
        calculator.SetResultArrayName(name)
        return calculator

    chain = vtk.array(shown(edits).GetPointData(), "displacement")
    reference = connected.surface.points
    # The shape of the chain, as it is and as it was warped for the eye.
    for source in (edits, warped(1)):
        moved, kinds = ordered(source, "displacement")
        assert np.array_equal(moved, chain) and kinds == ["translate"]
    # Warped by half, it is another shape: which of both is meant is to be said.
    with pytest.raises(tombolo.MeshError, match="found points that were moved, and not by the array of the order"):
        ordered(warped(0.5), "displacement")
    np.testing.assert_allclose(ordered(warped(0.5), None)[0], chain / 2, atol=1e-9)
    # A displacement that a Calculator has made, also in the place of the chain's.
    raised = np.column_stack([0 * reference[:, :2], 0.15 * reference[:, 2]])
    for source in (surface, edits):
        for name in ("Result", "displacement"):
            moved, kinds = ordered(calculated(source, name), name)
            np.testing.assert_allclose(moved, raised, atol=1e-12)
            assert kinds == ["displacement"]
    more = plugin.make("TomboloTranslate", calculated(edits, "displacement"), By=[0.1, 0, 0], **ends)
    moved, kinds = ordered(more, "displacement")
    on_top = reference[:, 2] == 1
    np.testing.assert_allclose(moved[on_top], raised[on_top] + [0.1, 0, 0], atol=1e-9)
    assert kinds == ["displacement", "translate"]
    # Points that any other filter has moved.
    transform = vtkTransform()
    transform.Scale(1, 1, 0.7)
    filter = vtkTransformFilter()
    filter.SetTransform(transform)
    filter.SetInputConnection(surface.GetOutputPort())
    np.testing.assert_allclose(ordered(filter, None)[0][:, 2], -0.3 * reference[:, 2], atol=1e-9)
    assert plugin.errors == []


def test_an_input_with_two_displacements_of_a_vertex_is_refused_in_plain_vtk(plugin, solver, tmp_path):
    from tombolo import vtk
    from vtkmodules.vtkFiltersCore import vtkAppendPolyData, vtkPolyDataNormals
    from vtkmodules.vtkFiltersGeneral import vtkWarpVector

    surface = plugin.make("TomboloSurface", Link=solver.link)
    newest(surface)
    connected = tombolo.background.connection(solver.link)
    ends = {"Features": "top", "Fixed": "bottom"}
    first = plugin.make("TomboloTranslate", surface, By=[0, 0, -0.2], **ends)
    second = plugin.make("TomboloTranslate", surface, By=[0.1, 0, 0], **ends)

    def appended(*chains):
        made = vtkAppendPolyData()
        for chain in chains:
            made.AddInputConnection(chain.GetOutputPort())
        return made

    both = appended(first, second)
    order = plugin.make("TomboloOrder", both)
    order.Update()
    with pytest.raises(tombolo.MeshError, match=r"vertex \d+ with two displacements.* Tombolo Combine Displacements"):
        order.edits(connected)
    plugin.make("TomboloTranslate", both, By=[0, 0, 0.1], **ends).Update()
    plugin.make("TomboloExport", both, FileName=str(tmp_path / "both.txt")).Write()
    assert ["with two displacements" in error for error in plugin.errors] == [True, True]
    assert not (tmp_path / "both.txt").exists()
    plugin.errors.clear()
    # The same displacement, but shown here and there.
    warp = vtkWarpVector()
    warp.SetInputConnection(first.GetOutputPort())
    warp.SetInputArrayToProcess(0, 0, 0, 0, "displacement")
    here_and_there = appended(first, warp)
    order.SetInputConnection(here_and_there.GetOutputPort())
    order.Update()
    for array in ("displacement", None):
        order.SetArray(array)
        with pytest.raises(tombolo.MeshError, match=r"vertex \d+ with two positions"):
            order.edits(connected)
    # A filter that splits faces has a vertex more than once, each time with one displacement.
    normals = vtkPolyDataNormals()
    normals.SetFeatureAngle(30)
    normals.SetInputConnection(first.GetOutputPort())
    normals.Update()
    assert normals.GetOutput().GetNumberOfPoints() > shown(surface).GetNumberOfPoints()
    order.SetInputConnection(normals.GetOutputPort())
    order.SetArray("displacement")
    order.Update()
    assert [next(iter(edit)) for edit in order.edits(connected)] == ["translate"]
    # As many points, of other vertices.
    other = shown(second).NewInstance()
    other.ShallowCopy(shown(second))
    vtk.add(other.GetPointData(), "vertices", vtk.array(other.GetPointData(), "vertices") + 1)
    combined = plugin.make("TomboloCombine", first, second)
    assert shown(combined).GetNumberOfPoints() > 0
    combined.SetInputDataObject(1, other)
    assert shown(combined).GetNumberOfPoints() == 0
    assert "found points of other vertices, expected edits of one surface" in plugin.errors.pop()
    assert plugin.errors == []


def test_a_surface_without_any_edit_orders_the_reference_shape_in_plain_vtk(plugin, solver):
    from vtkmodules.vtkCommonTransforms import vtkTransform
    from vtkmodules.vtkFiltersGeneral import vtkTransformFilter

    surface = plugin.make("TomboloSurface", Link=solver.link)
    newest(surface)
    connected = tombolo.background.connection(solver.link)
    run, begin = connected.run, solver.points.copy()
    run.order([{"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, 0.1]}}]).wait(60)
    wait(lambda: solver.points[:, 2].max() == pytest.approx(1.1))
    order = plugin.make("TomboloOrder", surface, Link=solver.link, Steps=2, Every=1)
    order.Give()
    assert plugin.errors == []
    wait(lambda: len(run.orders) == 2)
    run.orders[-1].wait(60)
    assert run.stack == []
    wait(lambda: np.array_equal(solver.points, begin))
    # Points that were moved are no reference shape.
    moved = vtkTransformFilter()
    moved.SetTransform(vtkTransform())
    moved.GetTransform().Scale(1, 1, 0.7)
    moved.SetInputConnection(surface.GetOutputPort())
    order.SetInputConnection(moved.GetOutputPort())
    order.Give()
    assert "found no point array 'displacement'" in plugin.errors.pop()
    assert len(run.orders) == 2


def test_an_edit_of_what_is_no_tombolo_surface_says_what_to_do_in_plain_vtk(plugin, solver):
    source = plugin.make("TomboloRun", Link=solver.link)
    assert newest(source).GetNumberOfPoints() > 0
    for name in ("TomboloTranslate", "TomboloDragSkeleton"):
        made = plugin.make(name, source, Features="top", Fixed="bottom")
        assert shown(made).GetNumberOfPoints() == 0
        assert "expected a Tombolo surface: take Tombolo Surface as the input" in plugin.errors.pop()
    assert plugin.errors == []


def test_a_connection_ends_with_the_last_source_in_plain_vtk(plugin, solver, connections):
    source = plugin.make("TomboloSurface", Link=solver.link)
    newest(source)
    order = plugin.make("TomboloOrder", source, Link=solver.link)
    order.Update()
    with tombolo.connect(solver.link, watch=True) as other:
        other.wait_for(lambda: other.status.viewers == 2, 30)
        del source
        gc.collect()
        assert len(connections) == 1
        del order
        gc.collect()
        assert not connections
        other.wait_for(lambda: other.status.viewers == 1, 30)


def test_what_is_missing_is_told_at_each_press_in_plain_vtk(plugin, solver):
    source = plugin.make("TomboloSurface", Link=solver.link)
    newest(source)
    written, order = plugin.make("TomboloExport", source), plugin.make("TomboloOrder", source)
    for button, text in (
        (written.Write, "FileName: found an empty text, expected the name of a file"),
        (order.Give, "Link: found an empty text, expected the run's file"),
        (order.Forecast, "Link: found an empty text, expected the run's file"),
    ):
        for _ in range(2):
            button()
            assert text in plugin.errors.pop() and plugin.errors == []


def test_why_there_is_no_run_is_told_once_in_plain_vtk(plugin, tmp_path):
    (tmp_path / "run.link").write_text("nothing")
    source = plugin.make("TomboloRun", Link=str(tmp_path / "run.link"))
    newest(source)
    assert len(plugin.errors) == 1 and "expected http://" in plugin.errors[0]
    assert not source.GetNeedsUpdate()
    order = plugin.make("TomboloOrder", source, Link=str(tmp_path / "run.link"))
    order.Give()
    assert "expected http://" in plugin.errors[-1]


def paraview(name):
    """A program of ParaView, and the environment in which it finds the plug-in and the package."""
    fetched = shutil.which(TARGET / "third-party/paraview" / name)
    program = os.environ.get(f"TOMBOLO_{name.upper()}") or fetched or shutil.which(name)
    if program is None:
        pytest.skip(f"there is no {name}: scripts/fetch-paraview --program")
    package = Path(tombolo.__file__).parents[1]
    return program, os.environ | {"PYTHONPATH": f"{package}:{CLIENT}:{CLIENT / 'debian'}"}


def pvpython(*arguments):
    """What ParaView's Python says to a script."""
    program, environment = paraview("pvpython")
    command = [program, *map(str, arguments)]
    said = subprocess.run(command, check=False, env=environment, capture_output=True, text=True, timeout=120)
    text = said.stdout + said.stderr
    assert said.returncode == 0, text
    # What is wrong is told in the plug-in's words alone.
    assert "returned failure" not in text, text
    return text


EACH = """
import sys
from nozzle import *
link, out = sys.argv[1:]
surface = TomboloSurface(Link=link)
wait(surface, lambda data: data.GetNumberOfPoints() > 0)
ends = {"Features": "top", "Fixed": "bottom"}
shown = {
    "translate": TomboloTranslate(Input=surface, By=[0.1, 0, 0.2], **ends),
    "rotate": TomboloRotate(Input=surface, Axis=[0, 0, 1], Degrees=20, HarmonicOrder=1, **ends),
    "scale_direction": TomboloScaleDirection(Input=surface, Factors=[0.5, 1, 1], **ends),
    "scale_normals": TomboloScaleNormals(Input=surface, Distance=0.1, **ends),
}
shown["two"] = TomboloTranslate(Input=shown["rotate"], By=[0, 0, 0.1], **ends)
shown["sum"] = TomboloCombineDisplacements(First=shown["translate"], Second=shown["rotate"], Weights=[1, 0.5])
shown["angle"] = TomboloFeaturesByAngle(Input=surface, Angle=40)
shown["curve"] = TomboloSkeleton(Input=surface)
for name, proxy in shown.items():
    proxy.UpdatePipeline()
    simple.SaveData(f"{out}/{name}.vtp", proxy=proxy)
written = TomboloExportDisplacement(Input=shown["two"], FileName=f"{out}/two.txt")
written.UpdatePipeline()
written.SMProxy.InvokeCommand("Write")
TomboloTranslate(Input=surface, Features="tpo", By=[0, 0, 1]).UpdatePipeline()
TomboloDragSkeleton(Input=surface, Fixed="bottom", At=[0.5, 0.5, 0.5], To=[0.6, 0.5, 0.5]).UpdatePipeline()
"""


def test_each_filter_moves_the_surface_as_the_kernel_does(solver, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    (tmp_path / "each.py").write_text(EACH)
    said = pvpython(tmp_path / "each.py", solver.link, tmp_path)
    assert "tpo" in said, said
    # A cube has no curve in its middle.
    assert "no node that can be dragged" in said, said

    shaper, expected = expected_of(solver)
    for name, moved in expected.items():
        assert np.array_equal(pyvista.read(tmp_path / f"{name}.vtp").point_data["displacement"], moved), name
    written = shaper.displacement([{"displacement": {"file": str(tmp_path / "two.txt")}}])
    assert np.array_equal(written, expected["two"])
    assert len(set(pyvista.read(tmp_path / "angle.vtp").cell_data["features"])) == 6
    assert pyvista.read(tmp_path / "curve.vtp").point_data["radius"].min() > 0


DELETED = """
import sys
from nozzle import *
from tombolo import background
sources = [TomboloSurface(Link=sys.argv[1]), TomboloRun(Link=sys.argv[1])]
for source in sources:
    wait(source, lambda data: data.GetNumberOfPoints() > 0)
sources.append(TomboloTranslate(Input=sources[0], Features="top", Fixed="bottom", By=[0, 0, 0.01]))
sources.append(TomboloOrder(Input=sources[2], Link=sys.argv[1], Steps=1))
sources[3].SMProxy.InvokeCommand("Give")
wait(sources[3], lambda table: rows(table).get("status", "").startswith("applied"))
del source
while sources:
    print("connections:", len(background._CONNECTIONS))
    simple.Delete(sources.pop())
print("connections:", len(background._CONNECTIONS))
"""


def test_a_connection_ends_when_paraview_deletes_its_last_source(solver, tmp_path):
    (tmp_path / "deleted.py").write_text(DELETED)
    said = pvpython(tmp_path / "deleted.py", solver.link)
    assert re.findall(r"connections: (\d)", said) == ["1", "1", "1", "1", "0"], said


def triangles(rows):
    """Each triangle from its least vertex on."""
    return {tuple(np.roll(row, -np.argmin(row)).tolist()) for row in rows}


def written_as_shown(file):
    """What the run has written at the cycle at which ParaView has shown this file; both are the same."""
    pyvista, spatial = pytest.importorskip("pyvista"), pytest.importorskip("scipy.spatial")
    frame, written = pyvista.read(file), pyvista.read(file.with_name(f"surface-{cycle_of(file):06}.vtp"))
    # The codec has an order of its own: points and triangles are found by where they are.
    size = np.linalg.norm(np.ptp(written.points, axis=0))
    _, found = spatial.cKDTree(written.points).query(frame.points)
    # The bound of positions where the view states none, in each coordinate.
    assert np.abs(frame.points - written.points[found]).max() < 1.001e-5 * size
    assert len(set(found)) == written.n_points == frame.n_points
    assert triangles(found[frame.regular_faces]) == triangles(written.regular_faces)
    for name in ("velocity", "pressure"):
        values = written.point_data[name][found]
        assert np.abs(frame.point_data[name] - values).max() <= 1.001e-3 * np.ptp(values)
    return written


def cycle_of(file):
    return int(file.stem.removeprefix("shown-"))


def check_shown(folder):
    """What was shown is what the run wrote: the nozzle pinched three times, each time taken back."""
    heights = []
    for file in sorted(folder.glob("shown-*.vtp"), key=cycle_of):
        points = written_as_shown(file).points
        heights.append(np.ptp(points[np.abs(points[:, 1]) < 0.05, 2]))
    assert heights == pytest.approx([0.05, 0.1, 0.05, 0.1, 0.05, 0.1], rel=0.02)


def test_a_running_nozzle_is_followed_and_steered_by_the_plug_in(small_nozzle, tmp_path):
    pipelines = study.configuration(SURFACE, study.SHAPE)
    with study.begun(FLOW, small_nozzle, pipelines, [], tmp_path) as link:
        said = pvpython(CLIENT / "nozzle.py", link, "--out", tmp_path)
    assert said.count("forecast: applied") == 3, said
    assert said.count("order: applied") == 3, said
    assert said.count("undo: applied") == 3, said
    check_shown(tmp_path)


DRAG = """
import sys
from nozzle import *
from paraview.modules.vtkRemotingServerManager import vtkSMPropertyLink
link, out = sys.argv[1:]
run, surface = TomboloRun(Link=link), TomboloSurface(Link=link)
wait(surface, lambda data: data.GetNumberOfPoints() > 0)
skeleton = TomboloSkeleton(Input=surface)
skeleton.UpdatePipeline()
nodes = servermanager.Fetch(skeleton)
at = nodes.GetPoint(nodes.GetNumberOfPoints() // 2)
dragged = TomboloDragSkeleton(Input=surface, Fixed="inlet, outlet")
middle = list(dragged.At)
for name, point in (("At", at), ("To", (at[0], at[1], at[2] + 0.02))):
    # The handle that the interface has in the view, tied to the property as the interface ties it.
    handle = servermanager.ProxyManager().NewProxy("representations", "HandleWidgetRepresentation")
    tie = vtkSMPropertyLink()
    tie.AddLinkedProperty(handle, "WorldPosition", tie.INPUT)
    tie.AddLinkedProperty(dragged.SMProxy, name, tie.OUTPUT)
    for axis, value in enumerate(point):
        handle.GetProperty("WorldPosition").SetElement(axis, value)
    handle.UpdateVTKObjects()
dragged.UpdatePipeline()
simple.SaveData(f"{out}/dragged.vtp", proxy=dragged)
order = TomboloOrder(Input=dragged, Link=link, Steps=4, Every=2)


def keep():
    shown = newest(run)
    simple.SaveData(f"{out}/shown-{cycle(shown)}.vtp", proxy=run)


order.SMProxy.InvokeCommand("Give")
print(rows(wait(order, lambda table: rows(table).get("status", "").startswith(("applied", "rejected")))))
keep()
order.SMProxy.InvokeCommand("Undo")
wait(order, lambda table: rows(table).get("stack") == "0 edits" and rows(table)["status"].startswith("applied"))
keep()
print(repr({"middle": middle, "at": list(dragged.At), "to": list(dragged.To)}), file=open(f"{out}/points.txt", "w"))
"""


def test_a_node_of_the_skeleton_is_dragged_by_the_handles_of_paraview(small_nozzle, tmp_path):
    pyvista, meshio = pytest.importorskip("pyvista"), pytest.importorskip("meshio")
    (tmp_path / "drag.py").write_text(DRAG)
    pipelines = study.configuration(SURFACE, study.SHAPE)
    with study.begun(FLOW, small_nozzle, pipelines, [], tmp_path) as link:
        said = pvpython(tmp_path / "drag.py", link, tmp_path)
    assert "'status': 'applied, shape 4 of 4'" in said, said

    points = ast.literal_eval((tmp_path / "points.txt").read_text())
    shaper = tombolo.Shaper(meshio.read(tmp_path / "channel-5k.msh"))
    surface = shaper.surface
    begin, end = surface.points.min(axis=0), surface.points.max(axis=0)
    # A handle begins where a person finds it.
    assert points["middle"] == pytest.approx((begin + end) / 2)
    at, by = points["at"], np.subtract(points["to"], points["at"])
    assert by == pytest.approx([0, 0, 0.02])
    moved = shaper.displacement([{"skeleton": {"at": at, "by": by, "fixed": ["inlet", "outlet"]}}])
    assert np.abs(moved).max() > 0.01
    dragged = pyvista.read(tmp_path / "dragged.vtp")
    assert np.array_equal(dragged.point_data["vertices"], surface.vertices)
    assert np.array_equal(dragged.point_data["displacement"], moved)

    changed, undone = map(written_as_shown, sorted(tmp_path.glob("shown-*.vtp"), key=cycle_of))
    assert np.abs(changed.points - (surface.points + moved)).max() < 1e-12
    assert np.array_equal(undone.points, surface.points)
