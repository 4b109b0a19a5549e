"""What a run tells: iterated over, called with, and the end of it."""

import sys
import threading

import pytest
import tombolo
from conftest import wait
from tombolo.state import State


def test_events_are_iterated_and_called_with(run, capfd):
    seen, called, others = set(), [], []
    run.on("monitor", lambda event: 1 / 0)
    remove = run.on("monitor", called.append)
    run.on(None, others.append)
    for event in run.events("monitor", "frame", timeout=30):
        seen.add(event.kind)
        if seen == {"monitor", "frame"}:
            break
    run.wait_for(lambda: len(called) > 2 and {"monitor", "frame", "status"} <= {event.kind for event in others}, 30)
    assert {event.kind for event in called} == {"monitor"}
    assert "ZeroDivisionError" in capfd.readouterr().err
    remove()
    count = len(others)
    run.wait_for(lambda: len(others) > count + 10, 30)
    # One call may have been under way.
    count, end = len(called), len(others)
    run.wait_for(lambda: len(others) > end + 30, 30)
    assert len(called) == count
    with pytest.raises(tombolo.WaitError):
        next(run.events("lost", timeout=0.3))


def test_there_are_no_events_of_a_kind_that_is_misspelt(run, capfd):
    for ask in (
        lambda: run.on("moniter", print),
        lambda: run.events("status", "moniter"),
        lambda: run.aio.events("moniter"),
    ):
        with pytest.raises(tombolo.ConfigurationError, match=r"no event 'moniter' \(did you mean 'monitor'\?\)"):
            ask()
    for callback in (3, None):
        with pytest.raises(TypeError, match="expected a function"):
            run.on("monitor", callback)
    called = []

    def leave(event):
        called.append(event)
        if len(called) < 4:
            sys.exit("away")

    run.on("monitor", leave)
    run.wait_for(lambda: len(called) > 5, 30)
    assert "away" in capfd.readouterr().err


def test_the_end_ends_every_wait(solver, run):
    waits = []

    def wait():
        try:
            run.wait_for(lambda: False)
        except tombolo.EndedError as error:
            waits.append(str(error))

    thread = threading.Thread(target=wait)
    thread.start()
    run.wait_for_cycle(2, 30)
    run.stop(timeout=30)
    thread.join(30)
    solver.thread.join(30)
    assert run.wait(30)["how"] == "stopped" and solver.stopped
    assert waits and "the run has ended" in waits[0]
    assert [event.kind for event in run.events()] == ["ended"]
    assert list(run.events("monitor")) == []
    assert not run.drives and "driving" not in repr(run)
    for ask in (run.drive, lambda: run.pause(timeout=30)):
        with pytest.raises(tombolo.EndedError, match="the run has ended: stopped"):
            ask()
    assert run.monitors["health"].rows


def test_values_of_parameters_are_those_told_last():
    state = State()
    bounds = {"minimum": 0, "maximum": 20}
    state.take("hello", {"hello": {"client": "c1", "parameters": [{"name": "inflow", "value": 10, **bounds}]}})
    before = state.hello
    event = state.take("parameters", {"parameters": {"values": {"inflow": 12, "unheard": 3}}})
    assert (event.kind, event.data) == ("parameters", {"values": {"inflow": 12, "unheard": 3}})
    assert state.hello == {"client": "c1", "parameters": [{"name": "inflow", "value": 12, **bounds}]}
    assert before["parameters"][0]["value"] == 10


def test_a_status_is_shown_without_the_whole_message():
    state = State()
    told = {"cycle": 3, "time": 0.5, "driver": "c1", "pipelines": [{"name": "midplane"}]}
    state.take("known", {"status": told})
    assert state.status.message == told
    known = "cycle=3, time=0.5, paused=False, stopped=False, step_seconds=None, viewers=0, driver='c1', quality=None"
    assert repr(state.status) == f"Status({known})"


def test_a_message_of_another_form_is_an_event_and_no_end():
    state = State()
    assert state.take("unknown", {"status": {"cycle": -1}}) == ("status", {"cycle": -1})
    assert state.status is None


def test_nobody_waits_for_a_reader_that_has_failed(solver, monkeypatch):
    with tombolo.connect(solver.link) as run:
        monkeypatch.setattr(run._state, "take", lambda kind, data: 1 / 0)
        with pytest.raises(tombolo.FailedError, match="ZeroDivisionError"):
            run.wait_for(lambda: False, 30)


def test_a_function_that_is_added_after_the_end_is_called_once(solver, run):
    first, second = [], []
    run.on("ended", first.append)
    run.stop(timeout=30)
    run.wait(30)
    wait(lambda: first)
    for _ in range(2):
        # The thread of the first has ended, or is about to.
        run.on("ended", second.append)
        wait(lambda: second)
        assert [event.kind for event in second] == ["ended"] and len(first) == 1
        second.clear()


def test_after_the_end_every_question_says_so(solver, run):
    run.wait_for(lambda: run.features, 30)
    run.stop(timeout=30)
    # It is told that it ends, and the connection ends a moment later.
    wait(lambda: not run.connected)
    for ask in (
        lambda: run.surface,
        lambda: run.stack,
        lambda: run.pipelines,
        run.link_for,
        lambda: run.hand_over("c1"),
    ):
        with pytest.raises(tombolo.EndedError, match="the run has ended: stopped"):
            ask()
