"""A solver's side, as clumsy callers use it."""

import gc
import json
import os
import signal
import subprocess
import sys
import threading
import time
import weakref
from collections import UserDict

import numpy as np
import pytest
import tombolo
from conftest import SQUEEZE, box, ends
from tombolo import _native

POINTS, TETS = box(2)


FACES = ends(POINTS, TETS)


def mesh(points=POINTS, cells=None, faces=None, **rest):
    return tombolo.Mesh(points, {"tetra": TETS} if cells is None else cells, faces=faces or FACES, **rest)


def arrays(shown, name):
    """Address, count, and whether it is borrowed, of each array of this name, as Rust sees it."""
    return [rest for found, *rest in _native.lent(shown) if found == name]


def layouts(values):
    """The same numbers in many layouts."""
    wide = np.zeros((len(values), 2 * values.shape[1] + 1), values.dtype)
    wide[:, 1::2] = values
    frozen = values.copy()
    frozen.flags.writeable = False
    return {
        "rows": values.copy(),
        "columns": np.asfortranarray(values),
        "strided": wide[:, 1::2],
        "read only": frozen,
        "transposed": np.ascontiguousarray(values.T).T,
        "reversed": values[::-1].copy()[::-1],
        "one for all": np.broadcast_to(values[:1], values.shape),
    }


def where_they_lie(values):
    """What `arrays` says of each column that is borrowed as it lies."""
    return [[values[:, column].ctypes.data, len(values), True] for column in range(values.shape[1])]


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32, np.int64])
def test_points_of_any_layout_are_borrowed_where_they_lie(dtype):
    for name, points in layouts(POINTS.astype(dtype)).items():
        assert arrays(mesh(points), "points") == where_they_lie(points), name


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32, np.int64, np.uint8])
def test_fields_of_any_layout_are_borrowed_where_they_lie(dtype):
    for name, values in layouts(np.arange(3 * len(POINTS)).reshape(-1, 3).astype(dtype)).items():
        assert arrays(mesh(fields={"values": values}), "values") == where_they_lie(values), name
        assert arrays(mesh(fields={"values": values[:, 1]}), "values") == where_they_lie(values[:, 1:2]), name


@pytest.mark.parametrize("dtype", [np.int32, np.int64, np.uint32, np.uint64])
def test_cells_of_any_layout_are_borrowed_where_they_lie(dtype):
    quads = np.array([[0, 1, 3, 2]], dtype)
    for name, cells in layouts(TETS.astype(dtype)).items():
        lies = [cells.ctypes.data, cells.size, True]
        assert arrays(mesh(cells={"tetra": cells}), "cells") == [lies], name
        of_types = mesh(cells={"quad": quads, "tetra": cells})
        assert arrays(of_types, "cells") == [[quads.ctypes.data, 4, True], lies], name


@pytest.mark.parametrize("dtype", [np.int32, np.int64])
def test_cells_in_vtk_form_are_borrowed_where_they_lie(dtype):
    offsets = np.arange(0, TETS.size + 1, 4, dtype=dtype)
    connectivity, types = TETS.ravel().astype(dtype), np.full(len(TETS), 10, np.uint8)
    cells = {"connectivity": connectivity, "offsets": offsets, "types": types}
    lies = [[array.ctypes.data, array.size, True] for array in (connectivity, offsets, types)]
    assert sorted(arrays(mesh(cells=cells), "cells")) == sorted(lies)


def test_polygons_in_vtk_form_are_the_same_cells_borrowed_and_copied():
    """A solver hands over its cells anew, and in other types: they are no other cells."""
    axis = np.linspace(0, 1, 5)
    points = np.stack([*np.meshgrid(axis, axis, indexing="ij"), np.zeros((5, 5))], -1).reshape(-1, 3)
    numbers = np.arange(25).reshape(5, 5)
    quads = np.stack([numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]], -1).reshape(-1, 4)
    offsets, kept = np.arange(0, quads.size + 1, 4), []
    pipelines = [{"name": "area", "stages": [{"surface": {}}, {"statistics": {"field": "height"}}]}]
    with tombolo.Adaptor({"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": pipelines}) as adaptor:
        for cycle in range(6):
            types = np.full(len(quads), 7, np.uint8 if cycle < 3 else np.int64)
            cells = {"connectivity": quads.ravel().copy(), "offsets": offsets.copy(), "types": types}
            # An array that is gone would leave its place in memory to the next.
            kept.append(cells)
            shown = tombolo.Mesh(points, cells, {"height": points[:, 2].copy()})
            adaptor.execute(cycle, 0.1 * cycle, 0.1, {"plate": shown})


def test_other_cells_are_copied():
    offsets, types = np.arange(0, TETS.size + 1, 4), np.full(len(TETS), 10)
    for cells in (
        {"tetra": TETS.astype(np.int16)},
        {"tetra": TETS.astype(">i4"), "pyramid": np.empty((0, 5), int)},
        {"connectivity": TETS.ravel(), "offsets": offsets, "types": types},
    ):
        lent = arrays(mesh(cells=cells), "cells")
        assert lent and not any(is_borrowed for *_, is_borrowed in lent)


def test_fields_are_borrowed_by_their_length():
    pressure, velocity = np.zeros(len(TETS), np.float32), np.zeros((len(POINTS), 3), order="F")
    shown = mesh(fields={"pressure": pressure, "velocity": velocity, "material": np.zeros(len(TETS), np.int32)})
    assert arrays(shown, "pressure") == [[pressure.ctypes.data, len(TETS), True]]
    assert [it[0] for it in arrays(shown, "velocity")] == [velocity[:, axis].ctypes.data for axis in range(3)]
    separate = tuple(np.ascontiguousarray(velocity[:, axis]) for axis in range(3))
    lent = arrays(mesh(fields={"velocity": separate}), "velocity")
    assert [it[0] for it in lent] == [axis.ctypes.data for axis in separate]
    assert all(it[2] for it in lent)


@pytest.mark.parametrize(
    "strange",
    [
        lambda a: a.astype(a.dtype.newbyteorder(">")),
        lambda a: a[::-1].copy()[::-1],
        lambda a: np.frombuffer(b"\0" + a.tobytes(), a.dtype, offset=1).reshape(a.shape),
        lambda a: a.tolist(),
        lambda a: np.repeat(a, 2, axis=0)[::2],
        np.asfortranarray,
        lambda a: a[:, ::-1].copy()[:, ::-1] if a.ndim > 1 else a,
    ],
)
def test_arrays_in_strange_forms_are_read_right(strange):
    """What is found of a mesh in a strange form, borrowed or copied, is what is found of the plain one."""
    written = []
    for points, cells in ((POINTS, TETS), (strange(POINTS), strange(TETS))):
        pipeline = {
            "name": "all",
            "stages": [{"surface": {}}, {"statistics": {"field": "height"}}],
        }
        shown = mesh(points, {"tetra": cells}, fields={"height": strange(POINTS[:, 2].copy())})
        with tombolo.Adaptor({"version": 1, "pipelines": [pipeline]}) as adaptor:
            adaptor.execute(0, 0.0, 0.1, {"solid": shown})
        written.append(adaptor.report["pipelines"][0]["monitors"])
    assert written[0] == written[1] and written[0]


def orders():
    return [{"at": {"cycle": 1}, "order": {"edits": SQUEEZE}}, {"at": {"cycle": 3}, "order": {"undo": 1}}]


@pytest.mark.parametrize("form", ["array", "columns", "dict", "vtk", "two types", "float32"])
def test_a_mesh_is_squeezed_and_restored_to_the_bit(form):
    points = POINTS.astype(np.float32) if form == "float32" else POINTS.copy()
    cells = {"tetra": TETS}
    if form == "columns":
        points, cells = np.asfortranarray(points), {"tetra": np.asfortranarray(TETS)}
    if form == "vtk":
        offsets = np.arange(0, TETS.size + 1, 4)
        cells = {"connectivity": TETS.ravel(), "offsets": offsets, "types": np.full(len(TETS), 10, np.uint8)}
    if form == "two types":
        cells = {10: TETS, "pyramid": np.empty((0, 5), int)}
    given = {"points": points, "cells": cells, "faces": FACES} if form == "dict" else mesh(points, cells)
    reference, tops = points.copy(), []
    with tombolo.Adaptor({"version": 1}, orders=orders()) as adaptor:
        for cycle in range(5):
            motion = adaptor.execute(cycle, 0.1 * cycle, 0.1, {"solid": given}).motion
            if motion is not None:
                assert motion.shape == (1, 1) and motion.order and not motion.coordinates.flags.writeable
                np.testing.assert_allclose(motion.displacement, motion.coordinates - points, atol=1e-7)
                np.testing.assert_allclose(motion.velocity, motion.displacement / 0.1, atol=1e-12)
                surface = motion.surface
                assert np.array_equal(surface.coordinates, motion.coordinates[surface.vertices])
                points[:] = motion.coordinates
            tops.append(float(points[:, 2].max()))
    np.testing.assert_allclose(tops, [1, 0.8, 0.8, 1, 1], atol=1e-6)
    assert np.array_equal(points, reference)
    assert [order["status"] for order in adaptor.orders] == ["applied", "applied"]


def test_named_faces_are_features():
    points = POINTS.copy()
    floor = {"triangle": FACES["bottom"].astype(np.int32)}
    shown = mesh(points, faces={"lid": np.asfortranarray(FACES["top"]), "floor": floor})
    edits = [{"translate": {"features": ["lid"], "fixed": ["floor"], "by": [0, 0, 0.1]}}]
    with tombolo.Adaptor(None, orders=[{"order": {"edits": edits}}]) as adaptor:
        motion = adaptor.execute(0, 0.0, 0.1, shown).motion
    assert motion is not None and motion.coordinates[:, 2].max() == pytest.approx(1.1)


BAD = {
    "no channel": ({}, tombolo.StepError, "no channel"),
    "no mesh": (3, tombolo.MeshError, "expected a tombolo.Mesh, or a dict"),
    "a misspelt part": ({"solid": {"points": POINTS, "cell": {}}}, tombolo.MeshError, "did you mean 'cells'"),
    "no points": ({"solid": {"cells": {}}}, tombolo.MeshError, "no points"),
    "one coordinate": (mesh(POINTS[:, :1]), tombolo.MeshError, "2 or 3"),
    "text": (mesh(np.array([["a", "b", "c"]])), tombolo.MeshError, "channel 'mesh', points"),
    "objects": (mesh(np.array([[object()] * 3])), tombolo.MeshError, "expected float32"),
    "ragged": (mesh([[1, 2, 3], [4]]), tombolo.MeshError, "channel 'mesh', points"),
    "complex": (mesh(POINTS + 0j), tombolo.MeshError, "values.real"),
    "half": (mesh(POINTS.astype(np.float16)), tombolo.MeshError, "float16"),
    "no rows": (mesh(cells={"tetra": TETS.ravel()}), tombolo.MeshError, r"\(m, 4\), a row for each tetra"),
    "five corners": (mesh(cells={"tetra": np.zeros((2, 5), int)}), tombolo.MeshError, r"shape \(2, 5\)"),
    "real cells": (mesh(cells={"tetra": TETS * 1.0}), tombolo.MeshError, "vertex numbers"),
    "a misspelt type": (mesh(cells={"tetar": TETS}), tombolo.MeshError, "did you mean 'tetra'"),
    "a bare array": (mesh(cells=TETS), tombolo.MeshError, "a dict from cell types"),
    "beyond": (mesh(cells={"tetra": TETS + 1}), tombolo.MeshError, "27"),
    "below": (mesh(cells={"tetra": TETS - 1}), tombolo.MeshError, "-1"),
    "beyond, in columns": (mesh(cells={"tetra": np.asfortranarray(TETS + 1)}), tombolo.MeshError, "27"),
    "not a number": (mesh(POINTS * np.nan), tombolo.TomboloError, "NaN"),
    "no points at all": (mesh(np.empty((0, 3))), tombolo.MeshError, "27|vertex"),
    "a short field": (mesh(fields={"p": np.zeros(5)}), tombolo.MeshError, "field 'p': found 5 values"),
    "ten components": (mesh(fields={"p": np.zeros((len(POINTS), 10))}), tombolo.MeshError, "9 components"),
    "a field's name": (mesh(fields={"": POINTS[:, 0]}), tombolo.MeshError, "a name"),
    "a number as a field": (mesh(fields={"p": 3.0}), tombolo.MeshError, "field 'p'"),
    "an association": (
        mesh(fields={"p": tombolo.Field(POINTS[:, 0], "vertices")}),
        tombolo.MeshError,
        "'vertex' or 'element'",
    ),
    "offsets that fall": (
        mesh(cells={"connectivity": TETS.ravel(), "offsets": [4, 0, 4], "types": [10, 10]}),
        tombolo.MeshError,
        "offsets that do not fall",
    ),
    "too few offsets": (
        mesh(cells={"connectivity": TETS.ravel(), "offsets": [0, 4], "types": [10, 10]}),
        tombolo.MeshError,
        "one more offset",
    ),
    "no types": (mesh(cells={"connectivity": TETS.ravel(), "offsets": [0, 4]}), tombolo.MeshError, "'types'"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_an_exception_with_its_place(name):
    given, kind, text = BAD[name]
    orders = [{"order": {"edits": SQUEEZE}}]
    with tombolo.Adaptor({"version": 1}, orders=orders) as adaptor:
        with pytest.raises(kind, match=text):
            adaptor.execute(0, 0.0, 0.1, given)
        # Nothing was done: the solver may mend it and call again.
        assert adaptor.execute(0, 0.0, 0.1, {"solid": mesh()}).motion is not None


def test_as_many_cells_as_vertices_have_to_be_told_apart():
    points = np.zeros((4, 3))
    points[1:] = np.eye(3)
    cells = {"tetra": np.array([[0, 1, 2, 3]] * 4)}
    with tombolo.Adaptor() as adaptor:
        with pytest.raises(tombolo.MeshError, match=r"tombolo\.Field"):
            adaptor.execute(0, 0, 1, tombolo.Mesh(points, cells, {"p": np.zeros(4)}))
        adaptor.execute(0, 0, 1, tombolo.Mesh(points, cells, {"p": tombolo.Field(np.zeros(4), "element")}))


@pytest.mark.parametrize("time", [np.nan, np.inf, -np.inf])
def test_a_time_that_is_none_is_refused(time):
    with tombolo.Adaptor() as adaptor:
        with pytest.raises(tombolo.StepError):
            adaptor.execute(0, time, 0.1, mesh())
        with pytest.raises(tombolo.StepError):
            adaptor.execute(0, 0.0, -0.1, mesh())
        for cycle in (-1, 1.5, "first", 2**64):
            with pytest.raises(tombolo.StepError, match=f"cycle: found '?{cycle}'?; expected a whole number from 0 on"):
                adaptor.execute(cycle, 0.0, 0.1, mesh())
            with pytest.raises(tombolo.StepError, match="cycle"):
                adaptor.looks_at(cycle, 0.0, 0.1)
        with pytest.raises(tombolo.StepError, match="time_step: found 'long'; expected a number"):
            adaptor.execute(0, 0.0, "long", mesh())


def test_a_configuration_is_a_file_a_dict_or_an_error_with_its_place(tmp_path):
    file = tmp_path / "pipelines.json"
    file.write_text('{"version": 1,\n "pipelnes": []}')
    with pytest.raises(tombolo.ConfigurationError, match=r"pipelines\.json:2:\d+: .*did you mean `pipelines`"):
        tombolo.Adaptor(file)
    with pytest.raises(tombolo.ConfigurationError, match=r"configuration:1:\d+: .*pipelnes"):
        tombolo.Adaptor({"version": 1, "pipelnes": []})
    with pytest.raises(tombolo.ConfigurationError, match=r"nowhere\.json"):
        tombolo.Adaptor(str(tmp_path / "nowhere.json"))
    with pytest.raises(tombolo.ConfigurationError, match="configuration: "):
        tombolo.Adaptor({"version": 1, "description": object()})
    with pytest.raises(tombolo.ConfigurationError, match="inflow"):
        tombolo.Adaptor(parameters={"inflow": (50, 0, 40)})
    for bounds in ((0, float("inf")), (float("-inf"), 40), (40, 0)):
        with pytest.raises(tombolo.ConfigurationError, match="'inflow' has the bounds"):
            tombolo.Adaptor(parameters={"inflow": (10, *bounds)})
    with pytest.raises(tombolo.ConfigurationError, match=r"expected \(value, minimum, maximum\)"):
        tombolo.Adaptor(parameters={"inflow": 10})
    with pytest.raises(tombolo.ConfigurationError, match="'inlet': found 'inflwo', expected 'inflow'"):
        tombolo.Adaptor(conditions={"inlet": "inflwo"})
    with pytest.raises(tombolo.ConfigurationError, match="orders:1:"):
        tombolo.Adaptor(orders=[{"order": {"edits": [{"translat": {}}]}}])
    file.write_text(json.dumps({"version": 1}))
    tombolo.Adaptor(file, orders=orders(), output=tmp_path).finalize()


def test_a_closed_adaptor_says_so():
    with tombolo.Adaptor() as adaptor:
        adaptor.execute(0, 0.0, 0.1, mesh())
    with pytest.raises(tombolo.CallError, match="after finalize"):
        adaptor.execute(1, 0.1, 0.1, mesh())
    assert adaptor.finalize()["cycles"] == 1


def test_an_exception_in_the_block_ends_the_run_and_goes_on():
    with pytest.raises(ZeroDivisionError), tombolo.Adaptor() as adaptor:
        adaptor.execute(0, 0.0, 0.1, mesh())
        _ = 1 / 0
    assert adaptor.report["cycles"] == 1


def test_an_address_in_use_is_a_failure():
    first = tombolo.Adaptor({"version": 1, "stream": {"listen": "127.0.0.1:0"}})
    port = first.link.split(":")[2].split("/")[0]
    with pytest.raises(tombolo.FailedError, match=port):
        tombolo.Adaptor({"version": 1, "stream": {"listen": f"127.0.0.1:{port}"}})
    first.finalize()


def test_another_thread_is_refused_while_one_is_in_a_call():
    """Of many threads that call at once each either has its step or an error; none of them crashes."""
    outcomes = []
    with tombolo.Adaptor({"version": 1, "pipelines": [{"name": "q", "stages": [{"quality": {}}]}]}) as adaptor:

        def work():
            for cycle in range(50):
                try:
                    adaptor.execute(cycle, 0.0, 0.1, {"solid": mesh()})
                    outcomes.append("done")
                except tombolo.CallError as error:
                    outcomes.append(str(error))

        threads = [threading.Thread(target=work) for _ in range(4)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]
    assert len(outcomes) == 200 and "done" in outcomes
    assert {text for text in outcomes if text != "done"} <= {
        "the adaptor is in another call; one thread at a time can use it"
    }


def test_other_threads_run_while_rust_works():
    points, tets = box(16)
    ticks, end = [], threading.Event()

    def tick():
        while not end.wait(0.0005):
            ticks.append(1)

    with tombolo.Adaptor(None, orders=[{"order": {"edits": SQUEEZE}}]) as adaptor:
        thread = threading.Thread(target=tick)
        thread.start()
        try:
            before = len(ticks)
            assert adaptor.execute(0, 0.0, 0.1, mesh(points, {"tetra": tets}, ends(points, tets))).motion
            assert len(ticks) > before + 3
        finally:
            end.set()
            thread.join()


def test_arrays_are_let_go_and_motions_keep_theirs():
    class Tracked(np.ndarray):
        pass

    points = POINTS.copy().view(Tracked)
    alive = weakref.ref(points)
    adaptor = tombolo.Adaptor(None, orders=[{"order": {"edits": SQUEEZE}}])
    coordinates = adaptor.execute(0, 0.0, 0.1, mesh(points)).motion.coordinates
    del points
    gc.collect()
    assert alive() is None
    adaptor.finalize()
    del adaptor
    gc.collect()
    assert coordinates[:, 2].max() == pytest.approx(0.8)
    with pytest.raises(ValueError):
        coordinates[0] = 0


def test_a_fork_is_told_and_ends():
    program = """
import os, sys, numpy as np, tombolo
points = np.eye(4, 3); cells = {"tetra": np.array([[3, 0, 1, 2]])}
adaptor = tombolo.Adaptor({"version": 1, "stream": {"listen": "127.0.0.1:0"}})
adaptor.execute(0, 0.0, 0.1, tombolo.Mesh(points, cells))
child = os.fork()
if child == 0:
    told = []
    for call in (lambda: adaptor.execute(1, 0.0, 0.1, tombolo.Mesh(points, cells)), adaptor.stop):
        try:
            call()
        except tombolo.CallError as error:
            told.append("forked" in str(error))
    del call, adaptor
    sys.exit(7 if told == [True, True] else 1)
status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
adaptor.execute(1, 0.0, 0.1, tombolo.Mesh(points, cells))
adaptor.finalize()
sys.exit(0 if status == 7 else 1)
"""
    if not hasattr(os, "fork"):
        pytest.skip("no fork")
    done = subprocess.run(
        [sys.executable, "-X", "dev", "-W", "error", "-c", program], timeout=60, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr.decode()


def test_a_run_that_has_ended_cannot_be_stopped():
    adaptor = tombolo.Adaptor()
    adaptor.stop()
    assert adaptor.execute(0, 0.0, 0.1, mesh()).stop
    adaptor.stop()
    adaptor.finalize()
    with pytest.raises(tombolo.CallError, match="called after finalize"):
        adaptor.stop()


def test_an_empty_list_is_no_cells_and_no_faces():
    with tombolo.Adaptor() as adaptor:
        adaptor.execute(0, 0.0, 0.1, mesh(cells={"tetra": TETS, "pyramid": []}))
    for nothing in ([], {"triangle": []}, {"quad": [], "triangle": np.empty(0)}):
        # Of a rank by itself the name is that of a feature without faces, which is told by its name.
        told = pytest.raises(tombolo.MeshError, match=r"'lid' has the number .*, which no face has")
        with tombolo.Adaptor() as adaptor, told:
            adaptor.execute(0, 0.0, 0.1, mesh(faces={**FACES, "lid": nothing}))
    told = pytest.raises(tombolo.MeshError, match="found an array of shape")
    with tombolo.Adaptor() as adaptor, told:
        adaptor.execute(0, 0.0, 0.1, mesh(cells={"tetra": np.empty((0, 5), int)}))


def test_points_of_two_coordinates_come_back_so():
    axis = np.linspace(0, 1, 4)
    points = np.stack(np.meshgrid(axis, axis, indexing="ij"), -1).reshape(-1, 2)
    numbers = np.arange(16).reshape(4, 4)
    quads = np.stack([numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]], -1).reshape(-1, 4)
    edits = [{"displacement": {"vertices": [15], "values": [[0.1, 0.0, 0.0]]}}]
    with tombolo.Adaptor(None, orders=[{"order": {"edits": edits}}]) as adaptor:
        motion = adaptor.execute(0, 0.0, 0.1, tombolo.Mesh(points, {"quad": quads})).motion
    assert motion.coordinates.shape == (16, 2)
    points[:] = motion.coordinates
    assert points[15, 0] == pytest.approx(1.1)


@pytest.mark.parametrize("waits_for_viewer", [False, True])
@pytest.mark.parametrize("raises", [False, True])
def test_signals_are_handled_while_a_solver_waits(tmp_path, waits_for_viewer, raises):
    configuration = {
        "version": 1,
        "stream": {"listen": "127.0.0.1:0"},
        "steering": {"wait_for_viewer": waits_for_viewer},
    }
    orders = None if waits_for_viewer else [{"at": {"cycle": 0}, "pause": {}}]
    adaptor = tombolo.Adaptor(configuration, orders=orders, output=tmp_path)

    def handle(number, frame):
        if raises:
            raise InterruptedError("enough")
        adaptor.stop()

    before = signal.signal(signal.SIGUSR1, handle)
    # Where it waits, only the signal ends it: the timer stops what does not heed it.
    signalled = threading.Timer(1.0, os.kill, [os.getpid(), signal.SIGUSR1])
    overdue = threading.Timer(30.0, adaptor.stop)
    try:
        signalled.start()
        overdue.start()
        begun = time.monotonic()
        if raises:
            with pytest.raises(InterruptedError, match="enough"):
                adaptor.execute(0, 0.0, 0.1, {"solid": mesh()})
        else:
            assert adaptor.execute(0, 0.0, 0.1, {"solid": mesh()}).stop
        assert time.monotonic() - begun < 20
        assert adaptor.execute(1, 0.1, 0.1, {"solid": mesh()}).stop
    finally:
        overdue.cancel()
        signalled.join()
        signal.signal(signal.SIGUSR1, before)
        adaptor.finalize()


def test_features_of_vertices_are_whole_numbers():
    surface = {
        "version": 1,
        "pipelines": [{"name": "all", "stages": [{"surface": {}}, {"statistics": {"field": "p"}}]}],
    }
    shown = tombolo.Mesh(POINTS, {"tetra": TETS}, {"p": np.zeros(27)}, vertex_features=np.arange(27) / 2)
    told = pytest.raises(tombolo.MeshError, match=r"vertex_features: found 0\.5 at entry 1; expected a whole number")
    with tombolo.Adaptor(surface) as adaptor, told:
        adaptor.execute(0, 0.0, 0.1, shown)


def test_masked_values_are_refused():
    temperature = np.ma.masked_array(np.arange(27.0))
    shown = mesh(fields={"temperature": temperature})
    # A mask that hides nothing is none.
    assert _native.lent(shown)
    temperature[3] = np.ma.masked
    masked = np.ma.masked_array(POINTS, mask=POINTS > 0.9)
    separate = [np.ma.masked_array(axis, mask=axis > 0.9) for axis in POINTS.T]
    for given, what in (
        (shown, "field 'temperature'"),
        (mesh(masked), "points"),
        (mesh(separate), "points, component 0"),
        (mesh(vertex_features=np.ma.masked_equal(np.arange(27), 5)), "vertex_features"),
    ):
        with pytest.raises(tombolo.MeshError, match=f"{what}.* masked"):
            _native.lent(given)


class Watched(UserDict):
    """Fields or faces that count how often they are looked at."""

    looks = 0

    def items(self):
        self.looks += 1
        return super().items()


def test_fields_and_faces_are_lent_where_they_are_looked_at():
    health = {"name": "health", "every": {"steps": 3}, "stages": [{"statistics": {"field": "p"}}]}
    points = POINTS.copy()
    shown = mesh(points, fields={"p": np.zeros(27)})
    shown.fields, shown.faces = Watched(shown.fields), Watched(shown.faces)
    looks = []
    with tombolo.Adaptor({"version": 1, "pipelines": [health]}) as adaptor:
        for cycle in range(7):
            adaptor.execute(cycle, 0.1 * cycle, 0.1, {"solid": shown})
            looks.append((shown.fields.looks, shown.faces.looks))
    assert looks == [(1, 1)] * 3 + [(2, 2)] * 3 + [(3, 3)]
    # What is wrong with a field is told once it is looked at.
    shown.fields["p"] = np.zeros(5)
    with tombolo.Adaptor({"version": 1, "pipelines": [health | {"every": {"steps": 2}}]}) as adaptor:
        adaptor.execute(0, 0.0, 0.1, {"solid": mesh(points, fields={"p": np.zeros(27)})})
        assert not adaptor.looks_at(1, 0.1, 0.1)
        adaptor.execute(1, 0.1, 0.1, {"solid": shown})
        with pytest.raises(tombolo.MeshError, match="field 'p': found 5 values"):
            adaptor.execute(2, 0.2, 0.1, {"solid": shown})


@pytest.mark.parametrize("other", [np.ndarray.tolist, lambda array: array.astype(array.dtype.newbyteorder(">"))])
def test_arrays_that_lie_otherwise_while_nobody_looks_are_the_same_mesh(other):
    points, tops = POINTS.copy(), []
    with tombolo.Adaptor({"version": 1}, orders=[{"at": {"cycle": 3}, "order": {"edits": SQUEEZE}}]) as adaptor:
        for cycle in range(5):
            lent, cells = (other(points), {"tetra": other(TETS)}) if cycle in (1, 2) else (points, {"tetra": TETS})
            motion = adaptor.execute(cycle, 0.1 * cycle, 0.1, {"solid": mesh(lent, cells)}).motion
            if motion is not None:
                points[:] = motion.coordinates
            tops.append(points[:, 2].max())
    assert tops[-1] == pytest.approx(0.8), adaptor.orders
