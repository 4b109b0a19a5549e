"""What is known of a run at once, what is not there yet, and what is not there at all."""

import copy
import pickle
import time

import numpy as np
import pytest
import tombolo
from conftest import box, ends, features_of
from tombolo.state import State


def test_what_is_announced_is_there_at_once(begin):
    # Nothing is measured or shown while this looks.
    running = begin(step=900.0)
    with tombolo.connect(running.link) as run:
        table = run.monitors["health"]
        assert {"cycle", "time", "quality.min", "temperature.max"} <= set(table)
        assert len(table["quality.min"]) == table.rows <= 1
        assert {"cycle", "quality.min"} <= set(table.last) or table.last == {}
        assert run.plot("health", "quality.min")._repr_svg_().startswith("<svg")


def test_before_the_first_step_there_are_tables_without_rows(tmp_path):
    pipelines = [
        {"name": "health", "stages": [{"quality": {}}]},
        {"name": "skin", "stages": [{"surface": {}}, {"stream": {}}]},
    ]
    configuration = {"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": pipelines}
    with tombolo.Adaptor(configuration, output=tmp_path) as adaptor, tombolo.connect(adaptor.link) as run:
        table = run.monitors["health"]
        assert table.rows == 0 and table.last == {} and len(table["quality.min"]) == 0
        assert "nothing measured yet" in run.plot("health", "quality.min")._repr_svg_()
        pytest.importorskip("pandas")
        assert len(run.monitors.to_pandas()) == 0
        with pytest.raises(KeyError, match=r"no frame of the view 'skin' .* run\.wait_for_view\('skin'\)"):
            run.views["skin"]
        assert run.views.get("skin") is None and not run.views


def test_of_what_is_not_there_the_nearest_is_told(run):
    run.wait_for_view("midplane", timeout=30)
    for ask, near in (
        (lambda: run.views["midplan"], "no view 'midplan' (did you mean 'midplane'?); there are: midplane"),
        (lambda: run.wait_for_view("midplan", timeout=5), "no view 'midplan' (did you mean 'midplane'?)"),
        (lambda: run.monitors["helth"], "no monitors of a pipeline 'helth' (did you mean 'health'?)"),
        (lambda: run.monitors["health"]["qality.min"], "no monitor 'qality.min' (did you mean 'quality.min'?)"),
        (lambda: run.surface.faces_of("topp"), "no feature 'topp' (did you mean 'top'?); there are: top, bottom"),
        (lambda: run.views["nothing alike"], "no view 'nothing alike'; there are: midplane"),
        (lambda: run.views[3], "no view '3'; there are: midplane"),
    ):
        with pytest.raises(KeyError) as error:
            ask()
        assert near in error.value.args[0]
    assert list(run.views) == ["midplane"] and "midplane" in repr(run.views) and dict(run.views)


def test_a_view_does_not_change_any_more(run):
    view = run.wait_for_view("midplane", timeout=30)
    for array in (view.points, view.triangles, view.lines, view.features, *view.fields.values()):
        if array is not None:
            with pytest.raises(ValueError, match="read-only"):
                array[:] = 0
    later = run.wait_for_view("midplane", after=view.cycle, timeout=30)
    assert later.triangles.any() and np.array_equal(later.triangles, view.triangles)
    pytest.importorskip("meshio")
    # Copies are anybody's own.
    mesh = later.to_meshio()
    mesh.points[:] = 0
    mesh.point_data["temperature"][:] = 0
    mesh.cell_data["material"][0][:] = 0
    assert later.points.any() and later.fields["temperature"].any()


def test_a_surface_for_meshio_has_its_features():
    pytest.importorskip("meshio")
    points, tets = box(2)
    shaper = tombolo.Shaper(points, {"tetra": tets}, ends(points, tets))
    surface = shaper.surface.to_meshio()
    assert np.array_equal(
        surface.points[surface.cells_dict["triangle"]], points[shaper.surface.vertices][surface.cells_dict["triangle"]]
    )
    assert features_of(surface) == [(it["name"], it["faces"], it["vertices"]) for it in shaper.features]


def test_tables_are_copied_with_the_rows_that_there_are():
    table = tombolo.MonitorTable("health")
    for cycle in range(100):
        table._append({"cycle": cycle, "time": 0.1 * cycle, "values": {"drag": cycle}})
    for other in (pickle.loads(pickle.dumps(table)), copy.deepcopy(table)):
        table._append({"cycle": 200, "time": 20, "values": {"drag": 0}})
        assert other.pipeline == "health" and np.array_equal(other["drag"], np.arange(100))
        other._append({"cycle": 100, "time": 10, "values": {"drag": 100, "lift": 1}})
        assert other.last == {"cycle": 100, "time": 10, "drag": 100, "lift": 1} and other.rows == 101


def test_without_frames_no_view_is_waited_for(solver):
    with tombolo.connect(solver.link, views=False) as run:
        begun = time.monotonic()
        with pytest.raises(KeyError, match="connected with views=False"):
            run.views["midplane"]
        with pytest.raises(tombolo.CallError, match="connected with views=False"):
            run.wait_for_view("midplane", timeout=30)
        assert time.monotonic() - begun < 3 and not run.views and run.view_names == ["midplane"]


def test_a_view_that_was_removed_is_there_no_more(run):
    skin = {"name": "skin", "stages": [{"surface": {}}, {"stream": {}}]}
    for _ in range(2):
        run.change_pipelines({"set": [skin]}, timeout=30)
        assert len(run.wait_for_view("skin", timeout=30).triangles) and "skin" in run.views
        run.change_pipelines({"remove": ["skin"]}, timeout=30)
        run.wait_for(lambda: "skin" not in run.view_names, 30)
        assert list(run.views) == ["midplane"] and len(run.views) == 1
        with pytest.raises(KeyError, match="no view 'skin'"):
            run.views["skin"]


def test_tables_of_cycles_that_are_counted_anew_are_joined_by_row():
    pytest.importorskip("pandas")
    monitors = tombolo.Monitors()
    for step in range(6):
        for pipeline, every in (("health", 1), ("drag", 2)):
            if step % every == 0:
                told = {"cycle": step % 3, "time": 0.1 * step, "values": {"value": 10 * every + step}}
                monitors._table(pipeline)._append(told)
    frame = monitors.to_pandas()
    assert frame.index.tolist() == [0, 1, 2, 0, 1, 2] and frame.index.name == "cycle"
    assert frame["health.value"].tolist() == [10, 11, 12, 13, 14, 15]
    assert frame["drag.value"].fillna(-1).tolist() == [20, -1, 22, -1, 24, -1]
    # One step that is shown twice.
    for value in (1, 2):
        monitors._table("health")._append({"cycle": 9, "time": 9.0, "values": {"value": value}})
    assert monitors.to_pandas().loc[9, "health.value"].tolist() == [1, 2]


def test_a_late_frame_of_a_removed_view_is_not_that_of_a_new_one():
    state = State()
    told = {"views": [{"name": "skin"}]}
    state.take("hello", {"hello": dict(told)})
    state.take("hello", {"hello": {"views": []}})
    # It was on its way when the view was removed.
    state.views["skin"] = "late"
    state.take("hello", {"hello": dict(told)})
    assert not state.views


def test_the_views_that_are_chosen_are_those_that_come(run, solver):
    skin = {"name": "skin", "stages": [{"surface": {}}, {"stream": {}}]}
    run.change_pipelines({"set": [skin]}, timeout=30)
    # Also one that is announced a moment later.
    run.choose_views(["skin"])
    assert "midplane" not in run.views
    with pytest.raises(KeyError, match="'midplane' come: it was not chosen"):
        run.views["midplane"]
    with pytest.raises(tombolo.CallError, match="'midplane' come: it was not chosen"):
        run.wait_for_view("midplane", timeout=30)
    now = run.status.cycle
    assert run.wait_for_view("skin", after=now, timeout=30).cycle > now
    with pytest.raises(KeyError, match=r"no view 'sknn' .did you mean 'skin'"):
        run.choose_views(["skin", "sknn"])
    with pytest.raises(TypeError, match="found the text 'skin'"):
        run.choose_views("skin")
    # No frame of the other comes, and none of before is shown later.
    left_out = run.status.cycle
    frames = run.events("frame", timeout=30)
    while (frame := next(frames).data).cycle < left_out + 50:
        assert frame.name == "skin" or frame.cycle <= left_out
    run.choose_views()
    # The first frame may be the newest that the run had made before; later ones follow.
    assert len(run.wait_for_view("midplane", after=left_out, timeout=30).triangles)

    # A run that is paused has made no frame since: the newest is sent again.
    run.pause(timeout=30)
    for names in ([], None, ["midplane"], []):
        run.choose_views(names)
    run.choose_views()
    assert run.wait_for_view("midplane", timeout=30).cycle == run.status.cycle
    run.resume(timeout=30)

    with tombolo.connect(solver.link, views=[]) as other:
        assert not other.views and other.chosen_views == frozenset()
        other.choose_views(["midplane"])
        other.wait_for_view("midplane", timeout=30)
    with tombolo.connect(solver.link, views=["midplane"]) as other:
        now = other.status.cycle
        other.wait_for_view("midplane", after=now, timeout=30)
        assert list(other.views) == ["midplane"]
    with pytest.raises(KeyError, match="no view 'nothing'"):
        tombolo.connect(solver.link, views=["nothing"])
    with pytest.raises(TypeError, match="found the text 'midplane'"):
        tombolo.connect(solver.link, views="midplane")
