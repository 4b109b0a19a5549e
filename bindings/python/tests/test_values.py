"""What cannot be meant is told where it was given: what was found, and what is expected."""

import asyncio
import copy
import os
import subprocess
import sys
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
import tombolo
from conftest import SQUEEZE, box
from tombolo import _native

POINTS, TETS = box(1)


def test_commands(run, solver):
    aio = run.aio
    for ask, text in (
        (lambda: run.undo(-1), "count: found -1, expected a whole number from 1 on"),
        (lambda: run.undo(0), "count: found 0, expected a whole number from 1 on"),
        (lambda: run.undo(1.5), "count: found 1.5, expected a whole number"),
        (lambda: run.undo(1 << 40), "count: found 1099511627776"),
        (lambda: asyncio.run(aio.undo(-1)), "count: found -1"),
        (lambda: run.set("heating", "3"), "parameter 'heating': found '3', expected a number"),
        (lambda: run.set("heating", None), "parameter 'heating': found None, expected a number"),
        (lambda: asyncio.run(aio.set("heating", "x")), "parameter 'heating': found 'x'"),
        (lambda: tombolo.connect(solver.link, attempts=-1), "attempts: found -1, expected a whole number from 0 on"),
    ):
        with pytest.raises(tombolo.ConfigurationError) as error:
            ask()
        assert text in str(error.value)
    assert run.orders == []
    assert run.set("heating", np.float32(2.5), timeout=30).done


def test_settings_of_an_adaptor():
    for settings, text in (
        (
            {"parameters": [("heating", 1, 0, 2)]},
            "parameters: found [('heating', 1, 0, 2)], expected a dict from names",
        ),
        ({"parameters": {"": (1, 0, 2)}}, "parameters: found the name ''"),
        ({"parameters": {3: (1, 0, 2)}}, "parameters: found the name 3"),
        ({"parameters": {"heating": "102"}}, "parameter 'heating': found '102', expected (value, minimum, maximum)"),
        ({"parameters": {"heating": (1, 0)}}, "parameter 'heating': found (1, 0), expected (value, minimum, maximum)"),
        ({"conditions": ["inflow"]}, "conditions: found ['inflow'], expected a dict from names to 'inflow', 'outflow'"),
        ({"configuration": ""}, "configuration: found an empty text"),
        ({"orders": ""}, "orders: found an empty text"),
    ):
        with pytest.raises(tombolo.ConfigurationError) as error:
            tombolo.Adaptor(**settings)
        assert text in str(error.value)


def test_numbers_that_json_cannot_hold_have_their_place(run):
    values = np.zeros((2, 3))
    values[1, 2] = np.nan
    edits = [{"translate": {}}, {"displacement": {"vertices": [0, 1], "values": values}}]
    with pytest.raises(tombolo.ConfigurationError) as error:
        run.order(edits)
    assert str(error.value) == "order: [1].displacement.values[1][2]: found nan, expected a finite number"
    with pytest.raises(tombolo.ConfigurationError, match=r"configuration: a\.b\[0\]: found inf, expected a finite"):
        tombolo.Adaptor({"a": {"b": (np.inf,)}})
    ring = []
    ring.append(ring)
    with pytest.raises(tombolo.ConfigurationError, match="expected what JSON can hold"):
        run.order(ring)


def test_what_is_no_communicator():
    class Null:
        def Get_size(self):
            raise Exception("MPI_ERR_COMM: invalid communicator")

    for given in (3, Null()):
        with pytest.raises(tombolo.ConfigurationError, match=r"the communicator: found .*expected one of mpi4py"):
            tombolo.Adaptor(communicator=given)


def test_what_is_no_mesh_for_a_shaper():
    mesh = tombolo.Mesh(POINTS, {"tetra": TETS})
    for given, text in (
        ("part.vtu", "found the name of a file, 'part.vtu' (read it first"),
        (POINTS, "found coordinates without cells (tombolo.Shaper(points, cells)), expected a tombolo.Mesh"),
        (POINTS.tolist(), "found coordinates without cells"),
        (None, "found a NoneType, expected a tombolo.Mesh"),
        ({"a": mesh, "b": mesh}, "found 2 meshes (a, b), expected one"),
        ({}, "found 0 meshes"),
    ):
        with pytest.raises(tombolo.MeshError) as error:
            tombolo.Shaper(given)
        assert text in str(error.value)
    assert tombolo.Shaper({"a": mesh}).features == tombolo.Shaper(mesh).features


def test_a_shaper_has_no_orders_that_could_be_replaced():
    shaper = tombolo.Shaper(POINTS, {"tetra": TETS})
    for ask in (shaper.shape, shaper.forecast):
        with pytest.raises(TypeError, match="replaces"):
            ask(SQUEEZE, replaces="o1")


def test_one_edit_by_itself_is_no_order(run):
    shaper = tombolo.Shaper(POINTS, {"tetra": TETS})
    for given, found in (
        ({"translate": {"features": ["top"], "by": [0, 0, 1]}}, "an object with the key `translate` alone"),
        ({}, "an object without a key"),
        (None, "null"),
        ({"version": 1, "pipelnes": []}, "an object with the keys `pipelnes`, `version`"),
    ):
        for ask in (run.order, shaper.shape):
            with pytest.raises(tombolo.ConfigurationError) as error:
                ask(given)
            assert f"order: found {found}, expected an order of a new shape" in str(error.value)
    with pytest.raises(tombolo.ConfigurationError, match="did you mean `edits`"):
        run.order({"edit": []})


def test_points_that_are_measured_are_those_of_the_mesh():
    shaper = tombolo.Shaper(POINTS, {"tetra": TETS})
    wrong = POINTS.copy()
    wrong[3, 1] = np.nan
    for given, text in (
        (wrong, r"points: row 3: found \(0, NaN, 1\), expected finite coordinates"),
        (POINTS[:, :2], "points: found 2 columns, expected 3, as the mesh has"),
        (POINTS[:4], "points: found 4 rows, expected 8"),
    ):
        for measure in (shaper.quality, shaper.scaled_jacobians):
            with pytest.raises(tombolo.MeshError, match=text):
                measure(given)


def cells_told(cells, points=POINTS):
    with tombolo.Adaptor() as adaptor, pytest.raises(tombolo.MeshError) as error:
        adaptor.execute(0, 0.0, 0.1, {"solid": {"points": points, "cells": cells}})
    return str(error.value)


def test_cells_that_cannot_be_are_told_in_plain_words():
    for kind in ("tetra10", "triangle6", "hexahedron27", 24, np.uint8(22)):
        assert "expected linear cells: of PyVista's, mesh.linear_copy()" in cells_told({kind: np.zeros((1, 10), int)})
    assert "did you mean 'tetra'" in cells_told({"tetar": TETS})
    vtk = {"connectivity": TETS.ravel(), "offsets": np.arange(0, 25, 4), "types": np.full(6, 10)}
    assert "found 'ofsets' beside 'connectivity'" in cells_told({**vtk, "ofsets": 3})
    assert cells_told({**vtk, "connectivity": TETS.ravel() + 1}).startswith(
        "channel 'solid', cells, connectivity: cell 0"
    )


def test_meshes_are_any_mappings_and_a_channel_may_be_called_points():
    mesh = MappingProxyType({"points": POINTS, "cells": MappingProxyType({"tetra": TETS})})
    plain = tombolo.Mesh(POINTS, {"tetra": TETS})
    for given in (mesh, {"points": mesh}, {"points": plain}, MappingProxyType({"solid": mesh})):
        lent = _native.lent(given)
        assert [name for name, *_ in lent] == ["points"] * 3 + ["cells"]
    with pytest.raises(tombolo.MeshError, match="did you mean 'cells'"):
        _native.lent({"solid": MappingProxyType({"points": POINTS, "cell": {}})})


@pytest.mark.parametrize("kind", [KeyboardInterrupt, MemoryError, SystemExit])
def test_what_interrupts_the_reading_of_a_mesh_is_raised_as_it_is(kind):
    class Interrupted:
        def __array__(self, *_, **__):
            raise kind("enough")

        def __index__(self):
            raise kind("enough")

        @property
        def points(self):
            raise kind("enough")

    with tombolo.Adaptor() as adaptor:
        for given in (tombolo.Mesh(Interrupted()), tombolo.Mesh(POINTS, {"tetra": Interrupted()}), Interrupted()):
            with pytest.raises(kind, match="enough"):
                adaptor.execute(0, 0.0, 0.1, given)
        with pytest.raises(kind, match="enough"):
            adaptor.execute(Interrupted(), 0.0, 0.1, tombolo.Mesh(POINTS))
        # It may be called again.
        adaptor.execute(0, 0.0, 0.1, tombolo.Mesh(POINTS))


def test_an_error_of_a_property_is_told():
    class Odd:
        @property
        def points(self):
            raise RuntimeError("not on this device")

    with tombolo.Adaptor() as adaptor, pytest.raises(tombolo.MeshError, match="not on this device"):
        adaptor.execute(0, 0.0, 0.1, {"solid": Odd()})


def test_timeouts_are_seconds_and_are_looked_at_before_anything_is_sent(run, solver):
    for timeout in (float("nan"), -1, "1", [1]):
        for ask in (
            lambda timeout=timeout: run.set("heating", 5, timeout=timeout),
            lambda timeout=timeout: run.pause(timeout=timeout),
            lambda timeout=timeout: run.pause(wait=False, timeout=timeout),
            lambda timeout=timeout: run.forecast(SQUEEZE, timeout=timeout),
            lambda timeout=timeout: run.drive(timeout),
            lambda timeout=timeout: run.hand_over("c1", timeout),
            lambda timeout=timeout: run.link_for("watch", timeout),
            lambda timeout=timeout: run.wait(timeout),
            lambda timeout=timeout: run.wait_for(lambda: False, timeout),
            lambda timeout=timeout: run.wait_for_cycle(10**9, timeout),
            lambda timeout=timeout: run.wait_for_view("midplane", after=10**9, timeout=timeout),
            lambda timeout=timeout: next(run.events("lost", timeout=timeout)),
            lambda timeout=timeout: tombolo.connect(solver.link, timeout=timeout),
        ):
            with pytest.raises(tombolo.ConfigurationError) as error:
                ask()
            assert f"timeout: found {timeout!r}, expected" in str(error.value)
    assert not run.drives
    assert run.set("heating", np.float32(2), timeout=np.float32(30)).done and run.link_for(timeout=float("inf"))
    assert run.parameters["heating"].value == 2 and not run.status.paused


def test_cycles_are_any_whole_numbers(run):
    table = run.monitors["health"]
    run.wait_for(lambda: table.rows, 30)
    status = run.wait_for_cycle(np.int64(2), 30)
    assert run.wait_for_cycle(table["cycle"][-1] + 2, 30).cycle > status.cycle - 1
    assert run.wait_for_view("midplane", after=np.int32(2), timeout=30).cycle > 2
    for ask in (lambda: run.wait_for_cycle("3", 1), lambda: run.wait_for_view("midplane", after="3", timeout=1)):
        with pytest.raises(tombolo.ConfigurationError, match="found '3', expected a number"):
            ask()
    steering = tombolo.Adaptor().execute(np.int64(0), 0.0, 0.1, tombolo.Mesh(POINTS, {"tetra": TETS}))
    assert steering.motion is None


def test_what_has_arrays_is_equal_to_itself_alone():
    shaper = tombolo.Shaper(POINTS, {"tetra": TETS})
    surface, table = shaper.surface, tombolo.MonitorTable("health")
    table._append({"cycle": 0, "time": 0.0, "values": {"drag": 1.0}})
    shape = tombolo.Shape(POINTS, 1.0, 0.5, {"min": 0.5}, {})
    skeleton = tombolo.Skeleton(POINTS, np.ones(8), [], np.zeros(8, np.uint32))
    view = tombolo.View("skin", 0, 0.0, POINTS, TETS[:, :3], TETS[:, :2], None, {}, {})
    for one in (surface, table, shape, skeleton, view):
        same = one
        assert (one == same, one != same, one in [same], len({one, same})) == (True, False, True, 1)
        other = copy.copy(one) if one is table else one._replace()
        assert (one == other, one != other, one in [other], len({one, other})) == (False, True, False, 2)


@pytest.mark.parametrize("empty", [np.empty((0, 3), int), [], {"triangle": np.empty((0, 3), int)}, {}])
def test_a_feature_without_faces_is_told_by_its_name(empty):
    faces = {"top": [[0, 1, 2]], "lid": empty}
    for given in ((POINTS, {"tetra": TETS}, faces), (tombolo.Mesh(POINTS, {"tetra": TETS}, faces=faces),)):
        with pytest.raises(tombolo.MeshError, match="the feature 'lid' has no faces"):
            tombolo.Shaper(*given)


CALLER = """
import numpy as np
import tombolo

conditions = {"inlet": "inflow"}
cycle = np.int64(3)
adaptor = tombolo.Adaptor(conditions=conditions)
adaptor.execute(cycle, 0.0, 0.1, tombolo.Mesh(np.zeros((3, 3))))
adaptor.looks_at(cycle, 0.0, 0.1)


async def steer(run: tombolo.Run) -> None:
    run.wait_for_cycle(cycle)
    run.wait_for_view("skin", after=cycle)
    run.wait_for_cycle(run.monitors["heat"]["cycle"][-1])
    run.undo(np.int64(1))
    order = await run.aio.order([], deadline=np.int64(3))
    run.order([], replaces=order)
    await run.aio.cancel(order)
    await run.aio.wait_for_cycle(cycle)
"""


def test_what_callers_give_has_the_types_that_it_is_said_to_have(tmp_path):
    pytest.importorskip("mypy")
    (tmp_path / "caller.py").write_text(CALLER)
    environment = os.environ | {"MYPYPATH": str(Path(tombolo.__file__).parents[1])}
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", tmp_path / "cache", "caller.py"]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
