"""A run from outside: watched, steered, lost and found again."""

import asyncio
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from urllib.request import urlopen

import numpy as np
import pytest
import tombolo
from conftest import SQUEEZE, Relay, wait


def test_what_a_feature_is_to_the_flow(begin):
    running = begin(conditions={"top": "inflow", "bottom": "outflow"})
    with tombolo.connect(running.link) as run:
        run.wait_for(lambda: run.features, 30)
        told = {feature["name"]: feature["condition"] for feature in run.features}
    assert told == {"top": "inflow", "bottom": "outflow", "untagged": None}


def test_facts(run):
    assert run.view_names == ["midplane"]
    assert run.parameters == {"heating": (1, 0, 10, None)}
    run.wait_for_cycle(2, 30)
    run.wait_for(lambda: run.features, 30)
    assert "top" in {feature["name"] for feature in run.features}
    assert {field["name"] for field in run.fields} == {"temperature", "material"}
    assert run.wait_for(lambda: run.status.step_seconds, 30) > 0
    assert run.pipelines[0]["name"] == "midplane"
    assert "token" not in repr(run)


def test_a_link_for_somebody_else(run, solver):
    place = run.link.split("?")[0]
    for rights in ("watch", "drive"):
        link = run.link_for(rights)
        assert link.startswith(f"{place}?key=") and len(link.split("=")[1]) == 32
        assert urlopen(link).status == 200
    assert asyncio.run(run.aio.link_for()).startswith(place)
    with pytest.raises(tombolo.ConfigurationError, match="'watch' or 'drive'"):
        run.link_for("look")
    with tombolo.connect(solver.adaptor.watching_link, watch=True) as watcher:
        assert watcher.link_for("watch").startswith(place)
        with pytest.raises(tombolo.RejectedError, match="for watching"):
            watcher.link_for("drive")


def test_views_are_arrays(run):
    view = run.wait_for_view("midplane", timeout=30)
    later = run.wait_for_view("midplane", after=view.cycle, timeout=30)
    assert later.cycle > view.cycle
    np.testing.assert_allclose(later.points[:, 1], 0.45, atol=1e-4)
    assert later.triangles.max() < len(later.points)
    heights = later.points[:, 2] + 0.01 * later.cycle
    np.testing.assert_allclose(later.fields["temperature"], heights, rtol=1e-4, atol=1e-4)
    assert later.associations == {"temperature": "vertex", "material": "element"}
    assert len(later.fields["material"]) == len(later.triangles) + len(later.lines)


def test_views_for_others(run):
    view = run.wait_for_view("midplane", timeout=30)
    meshio = pytest.importorskip("meshio")
    assert isinstance(view.to_meshio(), meshio.Mesh)
    assert np.array_equal(view.to_meshio().point_data["temperature"], view.fields["temperature"])
    pytest.importorskip("pyvista")
    poly = view.to_pyvista()
    assert poly.n_points == len(view.points) and poly.n_cells == len(view.triangles)
    sizes = poly.compute_cell_sizes(length=False, volume=False)
    assert sizes.cell_data["Area"].sum() == pytest.approx(1, rel=1e-3)


def test_monitors_grow(run):
    table = run.monitors["health"]
    run.wait_for(lambda: table.rows >= 5, 30)
    before = table["cycle"]
    copy = before.copy()
    run.wait_for(lambda: table.rows > len(before) + 100, 60)
    assert np.array_equal(before, copy)
    cycles = table["cycle"]
    assert np.array_equal(np.diff(cycles), np.ones(len(cycles) - 1))
    np.testing.assert_allclose(table["temperature.max"][: len(cycles)], 1 + 0.01 * cycles)
    pandas = pytest.importorskip("pandas")
    frame = run.monitors.to_pandas()
    assert isinstance(frame, pandas.DataFrame) and "health.quality.min" in frame.columns


def test_an_order_is_given_forecast_and_taken_back(solver, run):
    run.wait_for(lambda: run.features, 30)
    forecast = run.forecast(SQUEEZE, timeout=60)
    assert forecast.outcome == "applied" and forecast.min_scaled_jacobian > 0
    order = run.order(SQUEEZE, schedule={"steps": 3})
    assert order.wait(60) is order and order.status == "applied" and order.shape == (3, 3)
    assert order.cycle_applied is not None
    run.wait_for(lambda: run.status.cycle > order.cycle_applied + 4, 30)
    assert solver.points[:, 2].max() == pytest.approx(0.8)
    assert run.stack and run.orders[-1].id == order.id
    undone = run.undo().wait(60)
    run.wait_for(lambda: run.status.cycle > undone.cycle_applied + 4, 30)
    assert np.array_equal(solver.points, solver.reference)


def test_a_forecast_that_nobody_waits_for_any_longer_is_given_up(begin):
    def long(height):
        edit = {"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, height]}}
        return {"edits": [edit], "schedule": {"steps": 10_000}}

    with tombolo.connect(begin(count=12).link) as run:
        run.wait_for(lambda: run.features, 30)
        run.drive()
        begun = time.monotonic()
        assert run.forecast(long(0.1), timeout=120).outcome == "applied"
        whole = time.monotonic() - begun
        begun = time.monotonic()
        with pytest.raises(TimeoutError):
            run.forecast(long(0.2), timeout=0.2 * whole)
        # Found to its end it would keep the next one waiting.
        assert run.forecast(SQUEEZE, timeout=60).outcome == "applied"
        assert time.monotonic() - begun < 0.7 * whole


def test_an_order_takes_the_place_of_one_that_waits(solver, run):
    run.wait_for(lambda: run.features, 30)
    # Both come while the solver computes one step.
    solver.step = 900.0
    wait(lambda: solver.rests_for == 900.0)
    second = run.order([{"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, -0.4]}}])
    better = run.order(SQUEEZE, replaces=second).wait(60, until="accepted")
    solver.step = 0.002
    with pytest.raises(tombolo.RejectedError, match=f"replaced by order {better.id}"):
        second.wait(60)
    better.wait(60)
    assert [edit["translate"]["by"] for edit in run.stack] == [[0, 0, -0.2]]
    for order, reason in ((second, "no longer waits"), ("nobody", "there is no order 'nobody'")):
        with pytest.raises(tombolo.RejectedError, match=reason):
            run.order(SQUEEZE, replaces=order).wait(60)


def test_an_order_that_folds_the_mesh_is_rejected(run):
    run.wait_for(lambda: run.features, 30)
    fold = [{"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, -1.5]}}]
    assert run.forecast(fold, timeout=60).outcome == "rejected"
    with pytest.raises(tombolo.RejectedError) as refused:
        run.order(fold).wait(60)
    assert refused.value.report["status"] == "rejected"
    with pytest.raises(tombolo.RejectedError, match="tpo"):
        run.order([{"translate": {"features": ["tpo"], "by": [0, 0, 1]}}]).wait(60)


def test_a_misspelt_order_has_its_place(run, tmp_path):
    with pytest.raises(tombolo.ConfigurationError, match=r"order:1:\d+: .*translat"):
        run.order([{"translat": {}}])
    file = tmp_path / "edits.json"
    file.write_text('[\n {"translate": {"features": ["top"], "bye": [0, 0, 1]}}]')
    with pytest.raises(tombolo.ConfigurationError, match=r"edits\.json:2:\d+: .*did you mean `by`"):
        run.order(file)
    with pytest.raises(tombolo.ConfigurationError):
        run.order([{"translate": {"features": ["top"], "by": [0, 0, float("nan")]}}])


def test_a_displacement_made_elsewhere_is_an_order(solver, run):
    run.wait_for(lambda: run.features, 30)
    surface = run.surface
    assert np.array_equal(surface.points, solver.reference[surface.vertices])
    assert set(surface.faces_of("top")) <= set(range(len(surface.offsets) - 1))
    values = np.zeros_like(surface.points)
    values[:, 0] = 0.05 * np.sin(np.pi * surface.points[:, 2])
    order = run.order([{"displacement": {"vertices": surface.vertices, "values": values}}]).wait(60)
    run.wait_for(lambda: run.status.cycle > order.cycle_applied + 4, 30)
    moved = solver.points[surface.vertices] - surface.points
    np.testing.assert_allclose(moved, values, atol=1e-12)


def test_commands_take_effect(solver, run):
    command = run.set("heating", 3, timeout=30)
    assert command.done and command.cycle is not None
    run.wait_for_cycle(command.cycle + 2, 30)
    assert solver.heating[-1] == 3 and run.parameters["heating"].value == 3
    run.pause(timeout=30)
    assert run.status.paused
    cycle = len(solver.heating)
    time.sleep(0.1)
    assert len(solver.heating) <= cycle + 1
    run.resume(timeout=30)
    assert not run.status.paused
    run.wait_for_cycle(run.status.cycle + 2, 30)
    with pytest.raises(tombolo.RejectedError, match="from 0 to 10"):
        run.set("heating", 30, timeout=30)
    with pytest.raises(tombolo.RejectedError, match="heating"):
        run.set("heatng", 3, timeout=30)
    with pytest.raises(tombolo.ConfigurationError, match="finite"):
        run.set("heating", float("inf"))


def test_pipelines_change_while_it_runs(run):
    run.wait_for_cycle(2, 30)
    cut = {"name": "cut", "stages": [{"slice": {"origin": [0.5, 0.5, 0.5], "normal": [1, 0, 0]}}, {"stream": {}}]}
    run.change_pipelines({"set": [cut]}, timeout=30)
    assert len(run.wait_for_view("cut", timeout=30).triangles)
    with pytest.raises(tombolo.ConfigurationError, match="pipelines:1:"):
        run.change_pipelines({"set": [{"nme": "x"}]})


def test_a_run_that_is_lost_for_good_is_not_steered(solver):
    relay = Relay(solver.link)
    with tombolo.connect(relay.link, attempts=1) as run:
        run.drive()
        assert run.drives and "driving" in repr(run)
        relay.refuses = True
        relay.cut()
        with pytest.raises(tombolo.LinkError):
            run.wait_for(lambda: False, 30)
        assert not run.drives and repr(run).endswith("not connected>")
        with pytest.raises(tombolo.LinkError):
            run.drive()
    relay.server.close()


def test_one_drives_and_others_watch(solver, run):
    run.drive()
    with tombolo.connect(solver.link) as other, pytest.raises(tombolo.NotDriverError):
        other.pause(timeout=30)
    with tombolo.connect(solver.adaptor.watching_link, watch=True) as watcher:
        with pytest.raises(tombolo.NotDriverError, match="watch"):
            watcher.pause()
        assert watcher.wait_for_view("midplane", timeout=30).cycle >= 0


def test_one_who_only_looks_keeps_nobody_from_steering(solver):
    with tombolo.connect(solver.link) as looks, tombolo.connect(solver.link) as steers:
        assert looks.status.cycle >= 0 and not looks.drives
        steers.set("heating", 2, timeout=30)
        assert steers.drives and not looks.drives
        with pytest.raises(tombolo.NotDriverError):
            looks.set("heating", 3, timeout=30)


def test_the_wheel_is_handed_over_to_who_asks_for_it(solver):
    with tombolo.connect(solver.link) as first, tombolo.connect(solver.link) as second:
        with pytest.raises(tombolo.NotDriverError):
            first.hand_over("c1")
        first.drive()
        with pytest.raises(tombolo.RejectedError, match="c99"):
            first.hand_over("c99")
        first.on("wheel", lambda event: first.hand_over(event.data["asked_by"]))
        assert wait(lambda: drives(second), 30)
        assert not first.drives


def test_a_closed_run_gives_up_the_wheel_though_it_is_still_held(solver):
    first = tombolo.connect(solver.link)
    first.drive()
    with tombolo.connect(solver.link) as second:
        second.wait_for(lambda: second.status.driver, 30)
        with pytest.raises(tombolo.NotDriverError):
            second.drive()
        first.close()
        second.wait_for(lambda: second.status.driver is None, 30)
        second.drive()
        assert second.drives and not first.drives


def drives(run):
    try:
        run.drive()
    except tombolo.NotDriverError:
        return False
    return run.drives


def test_a_closed_run_gives_up_the_wheel_though_an_error_holds_its_client():
    with tombolo.Adaptor({"version": 1, "stream": {"listen": "127.0.0.1:0"}}) as adaptor:
        first = tombolo.connect(adaptor.link)
        first.drive()
        with pytest.raises(tombolo.LinkError, match="404") as kept:
            _ = first.surface
        first.close()
        with tombolo.connect(adaptor.link) as second:
            assert wait(lambda: drives(second), 10)
        assert kept.value.__traceback__ is not None


def test_nothing_is_sent_by_a_client_that_was_closed(solver):
    run = tombolo.connect(solver.link)
    client = run._reader.client
    run.close()
    run.close()
    with pytest.raises(tombolo.EndedError):
        client.pause()
    with pytest.raises(tombolo.CallError, match="closed"):
        run.pause()


def closes_at_once(server):
    server.accept()[0].close()


def test_links_that_lead_nowhere():
    for link, text in (
        ("127.0.0.1:7070", "expected http://HOST:PORT"),
        ("http://127.0.0.1:1/?token=abc", "refused"),
        ("http://nowhere.invalid/?token=abc", "nowhere.invalid"),
    ):
        with pytest.raises(tombolo.LinkError, match=text):
            tombolo.connect(link)
    assert issubclass(tombolo.LinkError, ConnectionError)
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.listen()
        threading.Thread(target=closes_at_once, args=(server,), daemon=True).start()
        with pytest.raises(tombolo.LinkError):
            tombolo.connect(f"http://127.0.0.1:{server.getsockname()[1]}/?token=abc")


def test_a_wrong_token_is_told(solver):
    with pytest.raises(tombolo.LinkError, match="401"):
        tombolo.connect(solver.link[:-4] + "0000")


def test_a_link_is_found_in_the_file_that_the_run_writes(solver, tmp_path):
    file = tmp_path / "run.link"
    file.write_text(f"driving {solver.link}\n")
    with tombolo.connect(file) as run:
        assert run.status.cycle >= 0
    file.write_text("nothing")
    with pytest.raises(tombolo.LinkError, match="without a link"):
        tombolo.connect(file)
    file.write_text("drive: https://127.0.0.1:1/?token=abc\ndrive: http://127.0.0.1:2/?token=abc\n")
    with pytest.raises(tombolo.LinkError, match=r"127\.0\.0\.1:1: the connection was refused"):
        tombolo.connect(file)
    file.write_text(f"drive: unix:{tmp_path}/run.sock?token=abc\n")
    with pytest.raises(tombolo.LinkError, match=r"unix:/.*run\.sock"):
        tombolo.connect(file)


def test_a_lost_connection_is_made_again(solver):
    relay = Relay(solver.link)
    with tombolo.connect(relay.link) as run:
        run.wait_for(lambda: run.features, 30)
        run.drive()
        lost = run.events("lost", timeout=30)
        relay.cut()
        assert next(lost).kind == "lost"
        run.order(SQUEEZE).wait(60)
        assert run.drives and not run.reconnecting
        view = run.wait_for_view("midplane", timeout=30)
        run.wait_for_view("midplane", after=view.cycle, timeout=30)
    relay.server.close()


def test_a_connection_that_is_gone_is_not_shown_as_a_good_one(solver):
    relay = Relay(solver.link)
    with tombolo.connect(relay.link) as run:
        run.drive()
        lost = run.events("lost", timeout=30)
        relay.server.close()
        relay.cut()
        next(lost)
        assert run.reconnecting and "connecting again" in repr(run) and "driving" not in repr(run)
        assert "connecting again" in run._repr_html_()


def test_a_link_file_that_is_not_there_is_named_with_its_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for given, named in (("run.link", tmp_path / "run.link"), ("~/run.link", tmp_path / "home/run.link")):
        with pytest.raises(tombolo.LinkError, match=rf"no file '{named}'"):
            tombolo.connect(given)
    with pytest.raises(tombolo.LinkError) as refused:
        tombolo.connect("127.0.0.1:7070/?token=secret")
    assert "secret" not in str(refused.value)
    with pytest.raises(TypeError, match=r"link: found b'run\.link'"):
        tombolo.connect(b"run.link")


def test_ctrl_c_ends_a_wait(solver):
    program = f"""
import signal
import tombolo
# What a shell begins in the background ignores Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)
run = tombolo.connect({solver.link!r}, watch=True)
print("waiting", flush=True)
try:
    run.wait_for(lambda: False)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
    process = subprocess.Popen([sys.executable, "-X", "dev", "-c", program], stdout=-1, stderr=-1, text=True)
    assert process.stdout.readline() == "waiting\n"
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=20)
    assert out == "interrupted\n" and process.returncode == 0, error


def test_a_program_that_forgets_to_close_ends(solver):
    program = f"import tombolo\nrun = tombolo.connect({solver.link!r}, watch=True)\nrun.on(None, lambda event: None)"
    done = subprocess.run([sys.executable, "-X", "dev", "-c", program], timeout=30, capture_output=True, check=False)
    assert done.returncode == 0 and done.stderr == b"", done.stderr.decode()


def test_a_closed_run_and_a_fork_are_told(solver):
    run = tombolo.connect(solver.link)
    run.close()
    run.close()
    assert not run.connected and not run.drives and run.missed == 0 and "token" not in repr(run)
    for ask in (lambda: run.order(SQUEEZE), lambda: run.stack, lambda: run.surface, lambda: run.on(None, print)):
        with pytest.raises(tombolo.CallError, match="closed"):
            ask()
    with tombolo.connect(solver.link) as run:
        run.drive()
        child = os.fork()
        if child == 0:
            try:
                run.pause()
            except tombolo.CallError:
                os._exit(7 if not run.drives else 2)
            os._exit(1)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7


def test_a_slow_reader_is_shown_the_newest_frame_and_not_each_one(begin):
    solver = begin(step=0.0)
    with tombolo.connect(solver.link) as run:
        frames, cycles = run.events("frame", timeout=60), [run.wait_for_view("midplane", timeout=60).cycle]
        last = cycles[0] + 300
        # Nothing is read while this looks.
        run.wait_for(lambda: wait(lambda: len(solver.heating) > last))
        while cycles[-1] < last:
            cycles.append(next(frames).data.cycle)
        # Some were under way, and 64 are kept of those that came.
        assert len(cycles) < 150


def test_a_command_is_done_once_the_solver_has_it(begin):
    running = begin(step=3.0)
    with tombolo.connect(running.link) as run:
        run.drive()
        command = run.set("heating", 7, timeout=60)
        assert command.cycle is not None
        wait(lambda: 7 in running.heating)


def test_a_run_that_does_not_answer_is_waited_for_as_long_as_the_caller_says(solver):
    relay = Relay(solver.link)
    with tombolo.connect(relay.link, timeout=0.5) as run:
        run.wait_for(lambda: run.features, 30)
        relay.swallows = True
        for ask in (lambda: run.stack, lambda: run.surface, lambda: run.pipelines, lambda: run.link_for(timeout=0.5)):
            begun = time.monotonic()
            with pytest.raises(tombolo.WaitError, match=r"no answer within 0\.5 seconds"):
                ask()
            assert time.monotonic() - begun < 15
        with pytest.raises(tombolo.WaitError, match=r"no answer within 0\.5 seconds"):
            tombolo.connect(relay.link, timeout=0.5)
    relay.server.close()


def test_a_wait_in_vain_says_for_what(begin):
    running = begin(step=900.0)
    with tombolo.connect(running.link) as run:
        run.wait_for(lambda: run.features, 30)
        order = run.order(SQUEEZE)
        for ask, text in (
            (lambda: order.wait(0.5), f"the order {order.id} was not applied within 0.5 seconds"),
            (lambda: order.wait(0.5, until="applying"), f"the order {order.id} was not applying within 0.5 seconds"),
            (lambda: run.set("heating", 2, timeout=0.5), "(set) did not take effect within 0.5 seconds"),
            (lambda: run.wait(0.1), "the run did not end within 0.1 seconds"),
            (lambda: run.wait_for_cycle(9, 0.1), "no step from cycle 9 on was told within 0.1 seconds"),
            (lambda: run.wait_for_view("midplane", after=9, timeout=0.1), "no newer frame of the view 'midplane' came"),
            (lambda: run.wait_for(lambda: False, 0.1), "what was looked for did not come within 0.1 seconds"),
            (lambda: next(run.events("lost", "end", timeout=0.1)), "no event 'lost' or 'end' came within 0.1 seconds"),
        ):
            with pytest.raises(tombolo.WaitError) as error:
                ask()
            assert text in str(error.value)
        running.step = 0.002


def test_a_wait_whose_function_closes_the_run_ends_at_once(solver):
    run = tombolo.connect(solver.link)
    begun = time.monotonic()
    with pytest.raises(tombolo.CallError, match="the run was closed"):
        run.wait_for(run.close, 20)
    assert time.monotonic() - begun < 3 and not run.connected
    run._reader._thread.join(10)
    assert run._reader._client is None
