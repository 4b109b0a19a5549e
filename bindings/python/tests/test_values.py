"""What cannot be meant is told where it was given: what was found, and what is expected."""

import asyncio

import numpy as np
import pytest
import tombolo
from conftest import SQUEEZE, box

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
