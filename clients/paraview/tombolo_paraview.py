"""A plug-in of ParaView 5.11 and newer: follows a run of Tombolo, and gives it orders of a new shape.

Load it by Tools > Manage Plugins > Load New, or in pvpython by `LoadPlugin(file, ns=globals())`. It needs the package
`tombolo` where ParaView's Python finds it. docs/paraview.md is its manual.

It cannot be called `tombolo.py`: ParaView puts a plug-in into `sys.modules` under the name of its file, where it would
hide the package.

Filters of edits are chained. Each adds its edit to the list that comes with the surface (the field data `edits`) and
the array `displacement`, which the same kernel computes that moves the solver's mesh.
"""

import json
import threading
import time

import numpy as np
import tombolo
from paraview.util.vtkAlgorithm import VTKPythonAlgorithmBase, smhint, smproperty, smproxy
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData, vtkTable

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


def _number(name, documentation, *default):
    values = " ".join(map(str, default))
    attributes = {"number_of_elements": len(default), "default_values": values}
    return _documented("DoubleVectorProperty", name, attributes, documentation)


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


_FEATURES = (
    _input()
    + _text("Features", "The features that are moved, parted by commas.")
    + _text("Fixed", "The features that are held, parted by commas.")
    + _count(
        "HarmonicOrder", "How smoothly the rest follows: 1 with a kink, 2 with a slope, 3 with a curvature.", 2, 1, 3
    )
)
_LINK = _text("Link", "The link that the run has printed, or its file tombolo-PORT.link.")


def _names(text):
    return [name.strip() for name in text.split(",") if name.strip()]


# ---- Runs: connected by threads, so that nothing here waits for a network.


class _Connection:
    """A run, once it is connected; before that, or where it cannot be, None and the reason."""

    def __init__(self, link):
        self.link, self.run, self.surface, self.trouble = link, None, None, "connecting"
        threading.Thread(target=self._connect, name="tombolo-paraview", daemon=True).start()

    def _connect(self):
        try:
            run = tombolo.connect(self.link)
            self.run, self.trouble = run, ""
            # Before the first step there is no mesh.
            run.wait_for(lambda: run.features, None)
            self.surface = run.surface
        except tombolo.TomboloError as error:
            self.trouble = str(error)


_connections: dict = {}


def connection(link):
    """The connection of a link; it is made when it is first asked for, and again where it was lost."""
    link = link.strip()
    if not link:
        return None
    known = _connections.get(link)
    ended = known is not None and known.run is None and known.trouble != "connecting"
    if known is None or ended:
        known = _connections[link] = _Connection(link)
    return known


def _breathe():
    """Lets the threads run that read what the runs tell: ParaView's interface holds Python's lock while it is idle."""
    time.sleep(0.002)


# ---- Data of VTK.


def _field_text(data, name, values=None):
    """A list of texts beside the data, or None; with values it is set."""
    if values is None:
        array = data.GetFieldData().GetAbstractArray(name)
        return None if array is None else [array.GetValue(index) for index in range(array.GetNumberOfValues())]
    array = vtkStringArray()
    array.SetName(name)
    for value in values:
        array.InsertNextValue(value)
    data.GetFieldData().AddArray(array)
    return values


def _add(attributes, name, values):
    array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
    array.SetName(name)
    attributes.AddArray(array)


def _cells(connectivity, offsets):
    cells = vtkCellArray()
    cells.SetData(
        numpy_to_vtk(np.ascontiguousarray(offsets, np.int64), deep=True),
        numpy_to_vtk(np.ascontiguousarray(connectivity, np.int64).ravel(), deep=True),
    )
    return cells


def _rows(cells):
    return _cells(cells, np.arange(len(cells) + 1) * cells.shape[1])


def _set_points(output, points):
    from vtkmodules.vtkCommonCore import vtkPoints

    held = vtkPoints()
    held.SetData(numpy_to_vtk(np.ascontiguousarray(points, np.float64), deep=True))
    output.SetPoints(held)


def _poly(view, output):
    """A view as polygons: lines before triangles, as VTK keeps them."""
    _set_points(output, view.points)
    if len(view.lines):
        output.SetLines(_rows(view.lines))
    if len(view.triangles):
        output.SetPolys(_rows(view.triangles))
    triangles = len(view.triangles)
    for name, values in view.fields.items():
        if view.associations[name] == "vertex":
            _add(output.GetPointData(), name, values)
        else:
            _add(output.GetCellData(), name, np.concatenate([values[triangles:], values[:triangles]]))
    if view.features is not None and not len(view.lines):
        _add(output.GetCellData(), "features", view.features.astype(np.int32))
    _add(output.GetFieldData(), "cycle", np.array([view.cycle], np.int64))
    _add(output.GetFieldData(), "TimeValue", np.array([view.time]))


def _points(data):
    return vtk_to_numpy(data.GetPoints().GetData()).astype(np.float64)


def _faces(data):
    """Faces of polygons: the vertices of each one after the other, where each begins, and the feature of each."""
    polys = data.GetPolys()
    features = data.GetCellData().GetArray("features")
    if features is None:
        raise tombolo.MeshError("the input: found no cell array 'features', expected that of a Tombolo surface")
    return (
        vtk_to_numpy(polys.GetConnectivityArray()),
        vtk_to_numpy(polys.GetOffsetsArray()),
        vtk_to_numpy(features)[-polys.GetNumberOfCells() :],
    )


def _shaper(data, angle=None):
    """What gives the surface other shapes: made once for each surface."""
    points, names = _points(data), _field_text(data, "feature_names") or []
    connectivity, offsets, features = (
        _faces(data)
        if angle is None
        else (
            vtk_to_numpy(data.GetPolys().GetConnectivityArray()),
            vtk_to_numpy(data.GetPolys().GetOffsetsArray()),
            None,
        )
    )
    key = (
        points.tobytes(),
        connectivity.tobytes(),
        tuple(names),
        None if features is None else features.tobytes(),
        angle,
    )
    if key not in _shapers:
        sizes = np.diff(offsets)
        kinds = {"triangle": 3, "quad": 4}

        def chosen(which):
            found = {kind: np.flatnonzero(which & (sizes == size)) for kind, size in kinds.items()}
            return {
                kind: connectivity[offsets[rows][:, None] + np.arange(kinds[kind])]
                for kind, rows in found.items()
                if len(rows)
            }

        every = np.ones(len(sizes), bool)
        faces = None if features is None else {name: chosen(features == index) for index, name in enumerate(names)}
        if faces is not None:
            faces = {name: parts for name, parts in faces.items() if parts}
        while len(_shapers) >= 4:
            _shapers.pop(next(iter(_shapers)))
        _shapers[key] = tombolo.Shaper(points, chosen(every), faces, angle=angle)
    return _shapers[key]


_shapers: dict = {}


class _Algorithm(VTKPythonAlgorithmBase):
    """What all of them have: values of properties, and errors that are told once, where ParaView tells them."""

    inputs = 1
    output = "vtkPolyData"

    def __init__(self):
        super().__init__(nInputPorts=self.inputs, nOutputPorts=1, outputType=self.output)
        self._told = None

    def FillInputPortInformation(self, port, info):
        info.Set(self.INPUT_REQUIRED_DATA_TYPE(), "vtkPolyData")
        return 1

    def _set(self, name, value):
        # ParaView has None for an empty text.
        value = "" if value is None else value
        if getattr(self, name) != value:
            setattr(self, name, value)
            self.Modified()

    def RequestData(self, request, inputs, outputs):
        kind = vtkTable if self.output == "vtkTable" else vtkPolyData
        given = [vtkPolyData.GetData(vector, 0) for vector in inputs or []]
        try:
            self.run(kind.GetData(outputs, 0), *given)
        except tombolo.TomboloError as error:
            self.tell(str(error))
            return 0
        self._told = None
        return 1

    def tell(self, text):
        """Tells what is wrong, once."""
        if text != self._told:
            from paraview import print_error

            self._told = text
            print_error(f"Tombolo: {text}")


# ---- Sources.


@smproxy.source(name="TomboloRun", label="Tombolo Run", support_reload=False)
@smhint.xml('<LiveSource interval="100"/>')
@smproperty.xml(
    _LINK
    + _text("View", "The name of a live view of the run; empty: its first.")
    + _button("Refresh", "Takes the newest frame. The interface does so by itself, ten times a second.")
)
class TomboloRun(_Algorithm):
    """A live view of a run: the newest frame that has come. It never waits for one."""

    inputs = 0
    link = view = ""
    _shown = None

    def SetLink(self, link):
        self._set("link", link)

    def SetView(self, view):
        self._set("view", view)

    def _frame(self):
        connected = connection(self.link)
        if connected is None or connected.run is None:
            return None
        run = connected.run
        name = self.view or next(iter(run.view_names), "")
        return run.views.get(name)

    def GetNeedsUpdate(self):
        """Whether there is a newer frame; ParaView's interface asks."""
        _breathe()
        frame = self._frame()
        needed = frame is not None and frame is not self._shown
        if needed:
            self.Modified()
        return needed

    def Refresh(self):
        _breathe()
        self.Modified()

    def run(self, output):
        frame = self._frame()
        if frame is not None:
            _poly(frame, output)
            self._shown = frame
            return
        connected = connection(self.link)
        if connected is not None and connected.run is None and connected.trouble != "connecting":
            raise tombolo.LinkError(connected.trouble)
        if connected is not None and connected.run is not None and self.view:
            known = connected.run.view_names
            if known and self.view not in known:
                raise tombolo.ConfigurationError(f"no view '{self.view}'; there are: {', '.join(known)}")


@smproxy.source(name="TomboloSurface", label="Tombolo Surface", support_reload=False)
@smhint.xml('<LiveSource interval="500"/>')
@smproperty.xml(_LINK + _button("Refresh", "Asks for it again, where the run has only begun."))
class TomboloSurface(_Algorithm):
    """The reference surface of a run with its features: what edits are measured from."""

    inputs = 0
    link = ""
    _shown = None

    def SetLink(self, link):
        self._set("link", link)

    def GetNeedsUpdate(self):
        """Whether it has come."""
        _breathe()
        connected = connection(self.link)
        needed = connected is not None and connected.surface is not None and connected.surface is not self._shown
        if needed:
            self.Modified()
        return needed

    def Refresh(self):
        _breathe()
        self.Modified()

    def run(self, output):
        connected = connection(self.link)
        if connected is None or connected.surface is None:
            if connected is not None and connected.run is None and connected.trouble != "connecting":
                raise tombolo.LinkError(connected.trouble)
            return
        self._shown = surface = connected.surface
        _set_points(output, surface.points)
        output.SetPolys(_cells(surface.connectivity, surface.offsets))
        _add(output.GetPointData(), "vertices", surface.vertices.astype(np.int64))
        _add(output.GetCellData(), "features", surface.features.astype(np.int32))
        _field_text(output, "feature_names", surface.names)
        _field_text(output, "edits", ["[]"])


# ---- Features and edits.


@smproxy.filter(name="TomboloFeaturesByAngle", label="Tombolo Features By Angle", support_reload=False)
@smproperty.xml(_input() + _number("Angle", "Degrees from which an edge parts two features.", 30.0))
class TomboloFeaturesByAngle(_Algorithm):
    """Names the parts of a surface between sharp edges, in place of those that the run has.

    The run does not know these names: an order of edits with them is sent as the displacement that they make.
    """

    angle = 30.0

    def SetAngle(self, angle):
        self._set("angle", angle)

    def run(self, output, surface):
        output.ShallowCopy(surface)
        found = _shaper(surface, self.angle).surface
        _add(output.GetCellData(), "features", found.features.astype(np.int32))
        _field_text(output, "feature_names", found.names)
        _field_text(output, "edits", ["[]"])
        _field_text(output, "own_features", ["by angle"])


class _Edit(_Algorithm):
    """A filter that adds an edit to those of its input."""

    features = fixed = ""
    order = 2

    def SetFeatures(self, names):
        self._set("features", names)

    def SetFixed(self, names):
        self._set("fixed", names)

    def SetHarmonicOrder(self, order):
        self._set("order", order)

    def edit(self):
        """The edit in JSON's terms."""
        raise NotImplementedError

    def handle(self):
        """The keys that edits have in common."""
        return {"features": _names(self.features), "fixed": _names(self.fixed), "harmonic_order": self.order}

    def run(self, output, surface):
        output.ShallowCopy(surface)
        edits = [*json.loads((_field_text(surface, "edits") or ["[]"])[0]), self.edit()]
        moved = _shaper(surface).displacement(edits)
        _add(output.GetPointData(), "displacement", moved)
        _field_text(output, "edits", [json.dumps(edits)])


@smproxy.filter(name="TomboloTranslate", label="Tombolo Translate", support_reload=False)
@smproperty.xml(_FEATURES + _number("By", "How far, in units of the mesh.", 0.0, 0.0, 0.0))
class TomboloTranslate(_Edit):
    """Moves features by a vector."""

    by = (0.0, 0.0, 0.0)

    def SetBy(self, x, y, z):
        self._set("by", (x, y, z))

    def edit(self):
        return {"translate": {**self.handle(), "by": list(self.by)}}


@smproxy.filter(name="TomboloScaleDirection", label="Tombolo Scale Direction", support_reload=False)
@smproperty.xml(_FEATURES + _number("Factors", "Factors along x, y and z.", 1.0, 1.0, 1.0))
class TomboloScaleDirection(_Edit):
    """Scales features along the axes."""

    factors = (1.0, 1.0, 1.0)

    def SetFactors(self, x, y, z):
        self._set("factors", (x, y, z))

    def edit(self):
        return {"scale_direction": {**self.handle(), "factors": list(self.factors)}}


@smproxy.filter(name="TomboloScaleNormals", label="Tombolo Scale Normals", support_reload=False)
@smproperty.xml(_FEATURES + _number("Distance", "How far each vertex moves outwards along its normal.", 0.0))
class TomboloScaleNormals(_Edit):
    """Moves features along their normals."""

    distance = 0.0

    def SetDistance(self, distance):
        self._set("distance", distance)

    def edit(self):
        return {"scale_normals": {**self.handle(), "distance": self.distance}}


@smproxy.filter(name="TomboloRotate", label="Tombolo Rotate", support_reload=False)
@smproperty.xml(
    _FEATURES
    + _number("Axis", "The direction of the axis, through the middle of the features.", 0.0, 0.0, 1.0)
    + _number("Degrees", "The angle, counter-clockwise seen against the axis.", 0.0)
)
class TomboloRotate(_Edit):
    """Turns features about an axis."""

    axis, degrees = (0.0, 0.0, 1.0), 0.0

    def SetAxis(self, x, y, z):
        self._set("axis", (x, y, z))

    def SetDegrees(self, degrees):
        self._set("degrees", degrees)

    def edit(self):
        return {"rotate": {**self.handle(), "axis": list(self.axis), "degrees": self.degrees}}


@smproxy.filter(name="TomboloSkeleton", label="Tombolo Skeleton", support_reload=False)
@smproperty.xml(_input())
class TomboloSkeleton(_Algorithm):
    """The curve skeleton of a surface, with the radius at each node."""

    def run(self, output, surface):
        skeleton = _shaper(surface).skeleton()
        _set_points(output, skeleton.nodes)
        if skeleton.curves:
            offsets = np.concatenate([[0], np.cumsum([len(curve) for curve in skeleton.curves])])
            output.SetLines(_cells(np.concatenate(skeleton.curves), offsets))
        _add(output.GetPointData(), "radius", skeleton.radii)


@smproxy.filter(name="TomboloDragSkeleton", label="Tombolo Drag Skeleton", support_reload=False)
@smproperty.xml(
    _FEATURES
    + _number("At", "Where the node is: the nearest one is dragged.", 0.0, 0.0, 0.0)
    + _number("To", "Where it is dragged to.", 0.0, 0.0, 0.0)
    + _point_widget("Node", "At")
    + _point_widget("Dragged to", "To")
)
class TomboloDragSkeleton(_Edit):
    """Drags a node of the skeleton, and what it carries."""

    at = to = (0.0, 0.0, 0.0)

    def SetAt(self, x, y, z):
        self._set("at", (x, y, z))

    def SetTo(self, x, y, z):
        self._set("to", (x, y, z))

    def edit(self):
        by = [end - begin for begin, end in zip(self.at, self.to)]
        edit = {"at": list(self.at), "by": by, "fixed": _names(self.fixed)}
        return {"skeleton": {**edit, "features": _names(self.features)} if _names(self.features) else edit}


@smproxy.filter(name="TomboloCombine", label="Tombolo Combine Displacements", support_reload=False)
@smproperty.xml(_input("First", 0) + _input("Second", 1) + _number("Weights", "What each is multiplied by.", 1.0, 1.0))
class TomboloCombine(_Algorithm):
    """Adds the displacements of two chains of edits of one surface."""

    inputs = 2
    weights = (1.0, 1.0)

    def SetWeights(self, first, second):
        self._set("weights", (first, second))

    def run(self, output, first, second):
        moved = [_displacement(each, "displacement") for each in (first, second)]
        if moved[0].shape != moved[1].shape:
            raise tombolo.MeshError(
                f"the inputs: found {len(moved[0])} and {len(moved[1])} points, expected edits of one surface"
            )
        output.ShallowCopy(first)
        _add(output.GetPointData(), "displacement", self.weights[0] * moved[0] + self.weights[1] * moved[1])
        # It is a sum, which no list of edits is.
        output.GetFieldData().RemoveArray("edits")


def _displacement(data, name):
    array = data.GetPointData().GetArray(name)
    if array is None or array.GetNumberOfComponents() != 3:
        raise tombolo.MeshError(
            f"the input: found no point array '{name}' of three components, expected a displacement"
        )
    return vtk_to_numpy(array).astype(np.float64)


def _vertices(data):
    array = data.GetPointData().GetArray("vertices")
    if array is None:
        raise tombolo.MeshError("the input: found no point array 'vertices', expected that of a Tombolo surface")
    return vtk_to_numpy(array)


@smproxy.filter(name="TomboloExport", label="Tombolo Export Displacement", support_reload=False)
@smproperty.xml(
    _input()
    + _text("FileName", "The file, which ends in .txt.")
    + _button("Write", "Writes the displacement of the input.")
)
class TomboloExport(_Algorithm):
    """Writes a displacement as text: a line `vertex dx dy dz` for each vertex that moves, with every bit."""

    file = ""

    def SetFileName(self, file):
        self._set("file", file)

    def run(self, output, surface):
        output.ShallowCopy(surface)

    def Write(self):
        self.GetInputAlgorithm(0, 0).Update()
        data = self.GetInputDataObject(0, 0)
        try:
            rows = zip(_vertices(data).tolist(), _displacement(data, "displacement").tolist())
            with open(self.file, "w", encoding="utf-8") as file:
                file.write("# vertex dx dy dz\n")
                file.writelines(f"{vertex} {x!r} {y!r} {z!r}\n" for vertex, (x, y, z) in rows if x or y or z)
        except (tombolo.TomboloError, OSError) as error:
            self.tell(str(error))


# ---- Orders.


@smproxy.filter(name="TomboloOrder", label="Tombolo Order", support_reload=False)
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
    + _button("Forecast", "Asks what the order would come to; nothing changes.")
    + _button("Give", "Gives the order.")
    + _button("Undo", "Takes the last order back.")
    + _button("Refresh", "Takes the newest status. The interface does so by itself.")
)
class TomboloOrder(_Algorithm):
    """Forecasts, gives and undoes an order. Its output is a table of what became of them."""

    output = "vtkTable"
    link, array, steps, every = "", "displacement", 10, 2

    def __init__(self):
        super().__init__()
        self._rows, self._shown, self._given = {}, None, None

    def SetLink(self, link):
        self._set("link", link)

    def SetArray(self, array):
        self._set("array", array)

    def SetSteps(self, steps):
        self._set("steps", steps)

    def SetEvery(self, every):
        self._set("every", every)

    def edits(self, connected):
        """The edits of the input, or the displacement that it holds."""
        data = self.GetInputDataObject(0, 0)
        edits = _field_text(data, "edits")
        own = _field_text(data, "own_features")
        if self.array == "displacement" and edits and json.loads(edits[0]) and not own:
            return json.loads(edits[0])
        vertices = _vertices(data)
        if self.array:
            moved = _displacement(data, self.array)
        else:
            surface = connected.surface
            moved = _points(data) - surface.points[np.searchsorted(surface.vertices, vertices)]
        kept = np.flatnonzero(np.any(moved != 0, axis=1))
        return [{"displacement": {"vertices": vertices[kept].tolist(), "values": moved[kept].tolist()}}]

    def _work(self, title, work):
        """Does it on a thread of its own: a forecast may take seconds."""
        connected = connection(self.link)
        if connected is None or connected.run is None:
            self.tell("no run is connected" if connected is None else connected.trouble)
            return
        self.GetInputAlgorithm(0, 0).Update()
        try:
            task = work(connected)
        except tombolo.TomboloError as error:
            self.tell(str(error))
            return
        self._rows[title] = "asked"

        def call():
            try:
                self._rows[title] = task()
            except tombolo.TomboloError as error:
                self._rows[title] = f"refused: {error}"

        threading.Thread(target=call, name="tombolo-order", daemon=True).start()

    def _schedule(self):
        return {"steps": self.steps, "every": {"steps": self.every}}

    def Forecast(self):
        def work(connected):
            edits, schedule = self.edits(connected), self._schedule()

            def task():
                forecast = connected.run.forecast(edits, schedule=schedule)
                reason = "" if forecast.reason is None else f", {forecast.reason}"
                return f"{forecast.outcome}, least scaled Jacobian {forecast.min_scaled_jacobian}{reason}"

            return task

        self._work("forecast", work)

    def Give(self):
        def work(connected):
            edits, schedule = self.edits(connected), self._schedule()
            return lambda: self._follow(connected.run.order(edits, schedule=schedule))

        self._work("order", work)

    def Undo(self):
        self._work("undo", lambda connected: lambda: self._follow(connected.run.undo()))

    def _follow(self, order):
        self._given = order
        return f"given as {order.id}"

    def _table(self):
        rows = dict(self._rows)
        order = self._given
        if order is not None:
            shape, shapes = order.shape
            rows["status"] = f"{order.status}, shape {shape} of {shapes}"
            if order.reason:
                rows["reason"] = order.reason
        connected = connection(self.link)
        if connected is not None and connected.run is not None:
            rows["stack"] = f"{len(connected.run.stack)} edits"
        return rows

    def GetNeedsUpdate(self):
        """Whether anything has become of an order."""
        _breathe()
        needed = self._table() != self._shown
        if needed:
            self.Modified()
        return needed

    def Refresh(self):
        _breathe()
        self.Modified()

    def run(self, output, surface):
        self._shown = self._table()
        for name, values in (("what", self._shown), ("is", self._shown.values())):
            column = vtkStringArray()
            column.SetName(name)
            for value in values:
                column.InsertNextValue(str(value))
            output.AddColumn(column)
