"""A plug-in of ParaView 5.11 and newer: follows a run of Tombolo, and gives it orders of a new shape.

Load it by Tools > Manage Plugins > Load New, or in pvpython by `LoadPlugin(file, ns=globals())`. It needs the package
`tombolo` where ParaView's Python finds it. docs/paraview.md is its manual.

It cannot be called `tombolo.py`: ParaView puts a plug-in into `sys.modules` under the name of its file, where it would
hide the package.

Filters of edits are chained. Each adds its edit to the list that comes with the surface (the field data `edits`) and
the array `displacement`, which the same kernel computes that moves the solver's mesh. Behind a displacement that no
list of edits stands for, as that of two chains combined or of a Calculator, the list begins with it.
"""

import hashlib
import json
import time

import numpy as np
import tombolo
from paraview.util.vtkAlgorithm import VTKPythonAlgorithmBase, smhint, smproperty, smproxy
from tombolo import vtk
from tombolo.background import Requests, connection
from vtkmodules.vtkCommonCore import vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkPolyData, vtkTable

# ---- Properties, as ParaView's XML has them.


def _documented(element, name, attributes, documentation, domain=""):
    listed = " ".join(f'{key}="{value}"' for key, value in attributes.items())
    return (
        f'<{element} name="{name}" command="Set{name}" {listed}>{domain}'
        f"<Documentation>{documentation}</Documentation></{element}>"
    )


def _text(name, documentation, default="", domain=""):
    attributes = {"number_of_elements": 1, "default_values": default}
    return _documented("StringVectorProperty", name, attributes, documentation, domain)


def _number(name, documentation, *default, domain=""):
    values = " ".join(map(str, default))
    attributes = {"number_of_elements": len(default), "default_values": values}
    return _documented("DoubleVectorProperty", name, attributes, documentation, domain)


def _point(name, documentation):
    """A point that begins in the middle of the input, where a person finds it."""
    domain = (
        '<BoundsDomain name="range" mode="normal" default_mode="mid"><RequiredProperties>'
        '<Property name="Input" function="Input"/></RequiredProperties></BoundsDomain>'
    )
    return _number(name, documentation, 0.0, 0.0, 0.0, domain=domain)


def _count(name, documentation, default, least, most):
    domain = f'<IntRangeDomain name="range" min="{least}" max="{most}"/>'
    return _documented(
        "IntVectorProperty", name, {"number_of_elements": 1, "default_values": default}, documentation, domain
    )


def _button(name, documentation):
    return (
        f'<Property name="{name}" command="{name}" panel_widget="command_button">'
        f"<Documentation>{documentation}</Documentation></Property>"
    )


def _point_widget(label, name):
    return (
        f'<PropertyGroup label="{label}" panel_widget="InteractiveHandle">'
        f'<Property function="WorldPosition" name="{name}"/></PropertyGroup>'
    )


def _input(name="Input", port=0):
    return (
        f'<InputProperty name="{name}" command="SetInputConnection" port_index="{port}">'
        '<DataTypeDomain name="type"><DataType value="vtkPolyData"/></DataTypeDomain></InputProperty>'
    )


_NAMED = (
    _input()
    + _text("Features", "The features that are moved, separated by commas.")
    + _text("Fixed", "The features that are held, separated by commas.")
)
_FEATURES = _NAMED + _count(
    "HarmonicOrder", "How smoothly the rest follows: 1 with a kink, 2 with a slope, 3 with a curvature.", 2, 1, 3
)
_EXPECTED = "the run's file tombolo-PORT.link, or a link out of it"
_MENU = '<ShowInMenu category="Tombolo"/>'
_LINK = _text("Link", f"What the run is reached by: {_EXPECTED}.")


def _names(text):
    return [name.strip() for name in text.split(",") if name.strip()]


# ---- What all of them have.


def _breathe():
    """Lets the threads run that read what the runs tell: ParaView's interface holds Python's lock while it is idle."""
    time.sleep(0.002)


def _displacement(data, name):
    moved = vtk.array(data.GetPointData(), name)
    if moved is None or moved.shape[1:] != (3,):
        raise tombolo.MeshError(
            f"the input: found no point array '{name}' of three components, expected a displacement"
        )
    return moved.astype(np.float64)


def _vertices(data):
    vertices = vtk.array(data.GetPointData(), "vertices")
    if vertices is None:
        raise tombolo.MeshError(
            "the input: found no point array 'vertices', expected a Tombolo surface: take Tombolo Surface as the input,"
            " or a filter behind it that keeps its point arrays"
        )
    return vertices


def _each_once(vertices, values, what):
    """Vertices rising, each once, and their values; an error where a vertex comes with two values."""
    if np.all(vertices[1:] > vertices[:-1]):
        return vertices, values
    # Filters that split faces have a vertex more than once.
    once, first, at = np.unique(vertices, return_index=True, return_inverse=True)
    differs = np.any((values != values[first][at]) & ~np.isnan(values), axis=1)
    if differs.any():
        raise tombolo.MeshError(
            f"the input: found vertex {vertices[np.argmax(differs)]} with two {what}, expected one: an order is of one"
            " chain. Tombolo Combine Displacements adds two chains"
        )
    return once, values[first]


def _fingerprint(vertices, moved):
    """A text that tells a displacement of vertices from others, in whatever order and however often each comes."""
    vertices, moved = _each_once(vertices, moved, "displacements")
    made = hashlib.blake2b(vertices.astype(np.int64), digest_size=16)
    made.update(np.ascontiguousarray(moved))
    return made.hexdigest()


def _set_edits(data, edits, moved=None):
    """Has edits come with the output, and the fingerprint of the displacement that they make."""
    texts = [json.dumps(edits)]
    vtk.set_texts(data, "edits", texts if moved is None else [*texts, _fingerprint(_vertices(data), moved)])


def _edits(data):
    """The edits that come with the input; none where its displacement is another than they make."""
    text, *fingerprints = vtk.texts(data, "edits") or ["[]"]
    edits = json.loads(text)
    if not edits or not data.GetPointData().HasArray("displacement"):
        return []
    # A filter of ParaView may have put another array in its place, or left points out.
    own = _fingerprint(_vertices(data), _displacement(data, "displacement"))
    return edits if fingerprints == [own] else []


def _as_edits(vertices, moved):
    """A displacement as an edit of the vertices that move; none where nothing does."""
    vertices, moved = _each_once(vertices, moved, "displacements")
    kept = np.flatnonzero(np.any(moved != 0, axis=1))
    if len(kept) == 0:
        return []
    return [{"displacement": {"vertices": vertices[kept].tolist(), "values": moved[kept].tolist()}}]


def _edits_or_displacement(data):
    """The edits that come with the input; where none stand for the displacement that it has, that one as an edit."""
    edits = _edits(data)
    if edits or not data.GetPointData().HasArray("displacement"):
        return edits
    return _as_edits(_vertices(data), _displacement(data, "displacement"))


def _moved(data, surface):
    """How far the points of the input are from a surface; None where they are of another one."""
    vertices = _vertices(data)
    at = np.searchsorted(surface.vertices, vertices).clip(max=len(surface.vertices) - 1)
    return vtk.points(data) - surface.points[at] if np.array_equal(surface.vertices[at], vertices) else None


def _is_reference(data, surface):
    """Whether the input is a reference surface that nothing has been done to."""
    if surface is None or data.GetPointData().HasArray("displacement"):
        return False
    text, *_ = vtk.texts(data, "edits") or ["[]"]
    is_whole = np.array_equal(_vertices(data), surface.vertices)
    return json.loads(text) == [] and is_whole and np.array_equal(vtk.points(data), surface.points)


def _check_points(data, surface, moved):
    """Points that something other than the displacement has moved show another shape than is ordered."""
    by = None if surface is None or len(moved) == 0 else _moved(data, surface)
    # An order for another run than that of its input is of edits alone.
    if by is None:
        return
    size = np.linalg.norm(np.ptp(surface.points, axis=0))
    if min(np.abs(by - expected).max() for expected in (0, moved)) > 1e-6 * size:
        raise tombolo.MeshError(
            "the input: found points that were moved, and not by the array of the order, expected the array to be what"
            " moved them. An order with an empty Array is of how far the points were moved"
        )


def _of_points(edits, data):
    """The same edits with displacements of the points of the input, in place of the vertices of the solver's mesh."""
    made = []
    for edit in edits:
        if "displacement" in edit:
            known, vertices = _vertices(data), edit["displacement"]["vertices"]
            if not np.isin(vertices, known).all():
                raise tombolo.MeshError("the input: found points left out, expected all that its edits move")
            sorter = np.argsort(known)
            points = sorter[np.searchsorted(known, vertices, sorter=sorter)]
            made.append({"displacement": {**edit["displacement"], "vertices": points.tolist()}})
        else:
            made.append(edit)
    return made


def _setter(name):
    """What ParaView calls with the values of a property: several of them are a tuple."""

    def put(self, *values):
        value = values if len(values) > 1 else values[0]
        # ParaView has None for an empty text.
        value = "" if value is None else value
        if getattr(self, name) != value:
            setattr(self, name, value)
            self.Modified()

    return put


class _Algorithm(VTKPythonAlgorithmBase):
    """A source or filter. What is wrong is told once, where ParaView tells it; it shows nothing then."""

    inputs = 1
    output = "vtkPolyData"

    def __init__(self):
        super().__init__(nInputPorts=self.inputs, nOutputPorts=1, outputType=self.output)
        self._told = None

    def FillInputPortInformation(self, port, info):
        info.Set(self.INPUT_REQUIRED_DATA_TYPE(), "vtkPolyData")
        return 1

    def RequestData(self, request, inputs, outputs):
        kind = vtkTable if self.output == "vtkTable" else vtkPolyData
        output, given = kind.GetData(outputs, 0), [vtkPolyData.GetData(vector, 0) for vector in inputs or []]
        if kind is vtkPolyData and any(data.GetNumberOfPoints() == 0 for data in given):
            # It has not come yet, or was told where it is wrong.
            return 1
        try:
            self.run(output, *given)
            self._told = None
        except tombolo.TomboloError as error:
            output.Initialize()
            self.tell(str(error))
        # Of a failure VTK itself would tell too, in words about its executives and at each refresh.
        return 1

    def tell(self, text):
        """Tells what is wrong, once."""
        if text != self._told:
            from paraview import print_error

            self._told = text
            print_error(f"Tombolo: {text}")

    def Refresh(self):
        _breathe()
        self.Modified()


# ---- Sources.


class _Linked(_Algorithm):
    """What has a link to a run."""

    link = ""

    def __init__(self):
        super().__init__()
        # What holds the run, and has its view come. VTK keeps the attributes of what ParaView has deleted, until
        # others take their place.
        self._held = held = []
        self.AddObserver("DeleteEvent", lambda *_: held.clear())

    SetLink = _setter("link")

    def connected(self):
        """The connection of the link, which lasts as long as a source or filter holds it; None for an empty link."""
        connected = connection(self.link)
        if self._held[:1] != [connected]:
            self._held[:] = [connected]
        return connected


class _Source(_Linked):
    """What shows the newest of a run, and never waits for it."""

    inputs = 0
    _shown = None

    def found(self, connected):
        """What there is to show, or a text of why there can be nothing; None where it has not come yet."""
        raise NotImplementedError

    def convert(self, found):
        """The data object of VTK that shows what there is."""
        raise NotImplementedError

    def newest(self):
        """What there is to show, or a text of why there is nothing."""
        connected = self.connected()
        if connected is None:
            return None
        found = self.found(connected)
        return connected.failure if found is None else found

    def GetNeedsUpdate(self):
        """Whether there is anything new; ParaView's interface asks."""
        _breathe()
        newest = self.newest()
        is_told = isinstance(newest, str) and newest == self._shown
        needed = newest is not None and newest is not self._shown and not is_told
        if needed:
            self.Modified()
        return needed

    def run(self, output):
        self._shown = newest = self.newest()
        if isinstance(newest, str):
            raise tombolo.TomboloError(newest)
        if newest is not None:
            output.ShallowCopy(self.convert(newest))


@smproxy.source(name="TomboloRun", label="Tombolo Run", support_reload=False)
@smhint.xml(_MENU)
@smhint.xml('<LiveSource interval="100"/>')
@smproperty.xml(
    _LINK
    + _text("View", "The name of a live view of the run; empty: its first.")
    + _button("Refresh", "Takes the newest frame. The interface does so by itself, ten times a second.")
)
class TomboloRun(_Source):
    """A live view of a run: the newest frame that has come."""

    view = ""
    convert = staticmethod(vtk.of_view)

    SetView = _setter("view")

    def found(self, connected):
        run = connected.run
        if run is None:
            return None
        names = run.view_names
        if self.view and names and self.view not in names:
            del self._held[1:]
            return f"no view '{self.view}'; there are: {', '.join(names)}"
        name = self.view or next(iter(names), "")
        if [look.view for look in self._held[1:]] != [name]:
            # No other view comes, and what nobody shows costs the solver nothing.
            del self._held[1:]
            self._held.append(connected.look(name))
        return run.views.get(name)


@smproxy.source(name="TomboloSurface", label="Tombolo Surface", support_reload=False)
@smhint.xml(_MENU)
@smhint.xml('<LiveSource interval="500"/>')
@smproperty.xml(_LINK + _button("Refresh", "Asks for it again, where the run has only begun."))
class TomboloSurface(_Source):
    """The reference surface of a run with its features: what edits are measured from."""

    def found(self, connected):
        return connected.surface

    def convert(self, found):
        made = vtk.of_surface(found)
        _set_edits(made, [])
        return made


# ---- Features and edits.


@smproxy.filter(name="TomboloFeaturesByAngle", label="Tombolo Features By Angle", support_reload=False)
@smhint.xml(_MENU)
@smproperty.xml(_input() + _number("Angle", "Degrees from which an edge parts two features.", 30.0))
class TomboloFeaturesByAngle(_Algorithm):
    """Names the parts of a surface between sharp edges, in place of those that the run has.

    The run does not know these names: an order of edits with them is sent as the displacement that they make. What
    edits before it have moved stays moved.
    """

    angle = 30.0

    SetAngle = _setter("angle")

    def run(self, output, surface):
        output.ShallowCopy(surface)
        found = vtk.shaper(surface, angle=self.angle).surface
        vtk.add(output.GetCellData(), "features", found.features.astype(np.int32))
        vtk.set_texts(output, "feature_names", found.names)
        _set_edits(output, [])
        vtk.set_texts(output, "own_features", ["by angle"])


class _Edit(_Algorithm):
    """A filter that adds an edit to those of its input."""

    features = fixed = ""
    order = 2

    SetFeatures = _setter("features")
    SetFixed = _setter("fixed")
    SetHarmonicOrder = _setter("order")

    def edit(self):
        """The edit in JSON's terms."""
        raise NotImplementedError

    def handle(self):
        """The keys that edits have in common."""
        return {"features": _names(self.features), "fixed": _names(self.fixed), "harmonic_order": self.order}

    def run(self, output, surface):
        output.ShallowCopy(surface)
        _each_once(_vertices(surface), vtk.points(surface), "positions")
        edits = [*_edits_or_displacement(surface), self.edit()]
        moved = vtk.shaper(surface).displacement(_of_points(edits, surface))
        vtk.add(output.GetPointData(), "displacement", moved)
        _set_edits(output, edits, moved)


@smproxy.filter(name="TomboloTranslate", label="Tombolo Translate", support_reload=False)
@smhint.xml(_MENU)
@smproperty.xml(_FEATURES + _number("By", "How far, in units of the mesh.", 0.0, 0.0, 0.0))
class TomboloTranslate(_Edit):
    """Moves features by a vector."""

    by = (0.0, 0.0, 0.0)

    SetBy = _setter("by")

    def edit(self):
        return {"translate": {**self.handle(), "by": list(self.by)}}


@smproxy.filter(name="TomboloScaleDirection", label="Tombolo Scale Direction", support_reload=False)
@smhint.xml(_MENU)
@smproperty.xml(_FEATURES + _number("Factors", "Factors along x, y and z.", 1.0, 1.0, 1.0))
class TomboloScaleDirection(_Edit):
    """Scales features along the axes."""

    factors = (1.0, 1.0, 1.0)

    SetFactors = _setter("factors")

    def edit(self):
        return {"scale_direction": {**self.handle(), "factors": list(self.factors)}}


@smproxy.filter(name="TomboloScaleNormals", label="Tombolo Scale Normals", support_reload=False)
@smhint.xml(_MENU)
@smproperty.xml(_FEATURES + _number("Distance", "How far each vertex moves outwards along its normal.", 0.0))
class TomboloScaleNormals(_Edit):
    """Moves features along their normals."""

    distance = 0.0

    SetDistance = _setter("distance")

    def edit(self):
        return {"scale_normals": {**self.handle(), "distance": self.distance}}


@smproxy.filter(name="TomboloRotate", label="Tombolo Rotate", support_reload=False)
@smhint.xml(_MENU)
@smproperty.xml(
    _FEATURES
    + _number("Axis", "The direction of the axis, through the middle of the features.", 0.0, 0.0, 1.0)
    + _number("Degrees", "The angle, counter-clockwise seen against the axis.", 0.0)
)
class TomboloRotate(_Edit):
    """Turns features about an axis."""

    axis, degrees = (0.0, 0.0, 1.0), 0.0

    SetAxis = _setter("axis")
    SetDegrees = _setter("degrees")

    def edit(self):
        return {"rotate": {**self.handle(), "axis": list(self.axis), "degrees": self.degrees}}


@smproxy.filter(name="TomboloSkeleton", label="Tombolo Skeleton", support_reload=False)
@smhint.xml(_MENU)
@smproperty.xml(_input())
class TomboloSkeleton(_Algorithm):
    """The curve skeleton of a surface, with the radius at each node."""

    def run(self, output, surface):
        output.ShallowCopy(vtk.of_skeleton(vtk.shaper(surface).skeleton()))


@smproxy.filter(name="TomboloDragSkeleton", label="Tombolo Drag Skeleton", support_reload=False)
@smhint.xml(_MENU)
@smproperty.xml(
    _NAMED
    + _point("At", "A point at the node: the nearest one is dragged.")
    + _point("To", "Where that point is dragged to, and the node by the same way.")
    + _point_widget("Node", "At")
    + _point_widget("Dragged to", "To")
)
class TomboloDragSkeleton(_Edit):
    """Drags a node of the skeleton, and what it carries."""

    at = to = (0.0, 0.0, 0.0)

    SetAt = _setter("at")
    SetTo = _setter("to")

    def edit(self):
        by = [end - begin for begin, end in zip(self.at, self.to)]
        edit = {"at": list(self.at), "by": by, "fixed": _names(self.fixed)}
        return {"skeleton": {**edit, "features": _names(self.features)} if _names(self.features) else edit}


@smproxy.filter(name="TomboloCombine", label="Tombolo Combine Displacements", support_reload=False)
@smhint.xml(_MENU)
@smproperty.xml(_input("First", 0) + _input("Second", 1) + _number("Weights", "What each is multiplied by.", 1.0, 1.0))
class TomboloCombine(_Algorithm):
    """Adds the displacements of two chains of edits of one surface."""

    inputs = 2
    weights = (1.0, 1.0)

    SetWeights = _setter("weights")

    def run(self, output, first, second):
        moved = [_displacement(each, "displacement") for each in (first, second)]
        vertices = [_vertices(each) for each in (first, second)]
        if not np.array_equal(*vertices):
            counts = [len(each) for each in vertices]
            found = "points of other vertices" if counts[0] == counts[1] else f"{counts[0]} and {counts[1]} points"
            raise tombolo.MeshError(f"the inputs: found {found}, expected edits of one surface")
        output.ShallowCopy(first)
        sum_of_both = self.weights[0] * moved[0] + self.weights[1] * moved[1]
        vtk.add(output.GetPointData(), "displacement", sum_of_both)
        # It is a sum, which no list of edits is: one behind it begins with the displacement itself.
        output.GetFieldData().RemoveArray("edits")


@smproxy.filter(name="TomboloExport", label="Tombolo Export Displacement", support_reload=False)
@smhint.xml(_MENU)
@smproperty.xml(
    _input()
    + _text("FileName", "The file, which ends in .txt.")
    + _button("Write", "Writes the displacement of the input.")
)
class TomboloExport(_Algorithm):
    """Writes a displacement as text: a line `vertex dx dy dz` for each vertex that moves, with every bit."""

    file = ""

    SetFileName = _setter("file")

    def run(self, output, surface):
        output.ShallowCopy(surface)

    def Write(self):
        self.GetInputAlgorithm(0, 0).Update()
        data = self.GetInputDataObject(0, 0)
        # What is wrong is told each time.
        self._told = None
        try:
            if not self.file:
                raise tombolo.ConfigurationError("FileName: found an empty text, expected the name of a file")
            vertices, moved = _each_once(_vertices(data), _displacement(data, "displacement"), "displacements")
            rows = zip(vertices.tolist(), moved.tolist())
            with open(self.file, "w", encoding="utf-8") as file:
                file.write("# vertex dx dy dz\n")
                file.writelines(f"{vertex} {x!r} {y!r} {z!r}\n" for vertex, (x, y, z) in rows if x or y or z)
        except (tombolo.TomboloError, OSError) as error:
            self.tell(str(error))


# ---- Orders.


@smproxy.filter(name="TomboloOrder", label="Tombolo Order", support_reload=False)
@smhint.xml(_MENU)
@smhint.xml('<LiveSource interval="200"/>')
@smproperty.xml(
    _input()
    + _LINK
    + _text(
        "Array",
        "The displacement: 'displacement' of edits, another point array, or empty for how far points were moved.",
        "displacement",
    )
    + _count("Steps", "In how many shapes the new one is reached.", 10, 1, 1000)
    + _count("Every", "How many solver steps each shape takes.", 2, 1, 100000)
    + _button("Forecast", "Asks what Give would come to; nothing changes.")
    + _button("Give", "Orders the shape that the input shows, in place of whatever shape the run has.")
    + _button("Undo", "Takes the last order back: the run gets the shape that it had before.")
    + _button("Refresh", "Takes the newest status. The interface does so by itself.")
)
class TomboloOrder(_Linked):
    """Forecasts, gives and undoes an order. Its output is a table of what became of them."""

    output = "vtkTable"
    array, steps, every = "displacement", 10, 2

    def __init__(self):
        super().__init__()
        self._requests = requests = Requests()
        self._shown = None
        # An order that was given holds the run, too.
        self.AddObserver("DeleteEvent", lambda *_: requests.forget())

    SetArray = _setter("array")
    SetSteps = _setter("steps")
    SetEvery = _setter("every")

    def edits(self, connected):
        """The edits of the input, or the displacement that it holds."""
        data = self.GetInputDataObject(0, 0)
        surface = connected.surface
        _each_once(_vertices(data), vtk.points(data), "positions")
        if not self.array:
            if surface is None:
                raise tombolo.MeshError("the run: found no surface yet, expected that which points were moved from")
            moved = _moved(data, surface)
            if moved is None:
                raise tombolo.MeshError("the input: found other vertices, expected those of the surface of this run")
            return _as_edits(_vertices(data), moved)
        if self.array == "displacement" and _is_reference(data, surface):
            return []
        moved = _displacement(data, self.array)
        _check_points(data, surface, moved)
        edits = _edits(data)
        if self.array == "displacement" and edits and not vtk.texts(data, "own_features"):
            return edits
        return _as_edits(_vertices(data), moved)

    def order(self, connected):
        """The order of the shape that the input shows.

        That is measured from the reference, so the order replaces the edits that the run has.
        """
        return {"stack": self.edits(connected), "schedule": {"steps": self.steps, "every": {"steps": self.every}}}

    def _ask(self, request):
        """Asks for something, and tells what is wrong each time."""
        self.GetInputAlgorithm(0, 0).Update()
        self._told = None
        connected = self.connected()
        try:
            if connected is None:
                raise tombolo.LinkError(f"Link: found an empty text, expected {_EXPECTED}")
            if connected.run is None:
                raise tombolo.LinkError(connected.failure or "no run is connected yet")
            request(connected)
        except tombolo.TomboloError as error:
            self.tell(str(error))

    def Forecast(self):
        self._ask(lambda to: self._requests.forecast(to.run, self.order(to)))

    def Give(self):
        self._ask(lambda to: self._requests.order(to.run, self.order(to)))

    def Undo(self):
        self._ask(lambda to: self._requests.undo(to.run))

    def _table(self):
        rows, connected = self._requests.outcomes, self.connected()
        if connected is not None and connected.run is not None:
            count = connected.run.edit_count
            rows["stack"] = f"{count} edit{'' if count == 1 else 's'}"
        return rows

    def GetNeedsUpdate(self):
        """Whether anything has become of an order."""
        _breathe()
        needed = self._table() != self._shown
        if needed:
            self.Modified()
        return needed

    def run(self, output, surface):
        self._shown = self._table()
        for name, values in (("what", self._shown), ("is", self._shown.values())):
            column = vtkStringArray()
            column.SetName(name)
            for value in values:
                column.InsertNextValue(str(value))
            output.AddColumn(column)
