"""Runs that are connected and steered in the background, as a program with an interface does it."""

import threading
import time
import weakref

import pytest
import tombolo
from conftest import SQUEEZE, Relay, wait
from tombolo import background
from tombolo.background import Requests, connection

pytestmark = pytest.mark.usefixtures("connections")


def test_a_connection_is_shared_and_nobody_waits_for_it(solver):
    begun = time.monotonic()
    known = connection(solver.link)
    assert time.monotonic() - begun < 1
    assert connection(f" {solver.link}\n") is known
    assert connection("") is None
    surface = wait(lambda: known.surface)
    assert known.failure is None and known.run.features
    assert surface.names == ["top", "bottom", "untagged"]
    assert "token" not in repr(known)


def test_why_there_is_no_run_is_told_and_it_is_tried_again(solver, tmp_path, monkeypatch):
    file = tmp_path / "run.link"
    file.write_text("nothing")
    known = connection(str(file))
    assert "expected http://" in wait(lambda: known.failure)
    file.write_text(solver.link)
    assert connection(str(file)) is known
    # Not at once.
    assert known.run is None and known.failure is not None
    monkeypatch.setattr(background.clock, "monotonic", lambda now=time.monotonic: now() + 10)
    assert connection(str(file)) is known
    assert wait(lambda: known.run).status.cycle >= 0
    assert known.failure is None


def test_a_surface_that_did_not_come_is_asked_for_again(solver, monkeypatch):
    relay = Relay(solver.link)
    # What is watched stays connected; what is asked for is a connection of its own.
    connect = background.connect

    def connect_alone(link):
        run = connect(link)
        relay.refuses = True
        return run

    monkeypatch.setattr(background, "connect", connect_alone)
    known = connection(relay.link)
    wait(lambda: known.failure)
    run = known.run
    assert run.connected and known.surface is None
    relay.refuses = False
    monkeypatch.setattr(background.clock, "monotonic", lambda now=time.monotonic: now() + 10)
    assert wait(lambda: connection(relay.link).surface).names == ["top", "bottom", "untagged"]
    assert known.run is run and known.failure is None
    relay.server.close()


def test_the_views_that_come_are_those_at_which_somebody_looks(solver):
    known = connection(solver.link)
    run = wait(lambda: known.run)
    wait(lambda: run.chosen_views == frozenset())
    assert not run.views
    look = known.look("midplane")
    assert look.connection is known and wait(lambda: run.views.get(look.view)).name == "midplane"
    del look
    assert connection(solver.link) is known and run.chosen_views == frozenset()

    # Any thread may look, and look away.
    failures = []

    def glance():
        try:
            for _ in range(300):
                assert known.look("midplane").view == "midplane"
        except Exception as error:
            failures.append(error)

    threads = [threading.Thread(target=glance) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30)
    look = known.look("midplane")
    assert failures == [] and run.chosen_views == {look.view}


def test_another_run_behind_the_same_file_is_found_once_the_first_has_ended(begin, tmp_path, monkeypatch):
    first, file = begin(), tmp_path / "run.link"
    file.write_text(first.link)
    known = connection(str(file))
    ended = wait(lambda: known.surface and known.run)
    first.close()
    wait(lambda: not ended.connected)
    assert connection(str(file)).run is ended and known.surface is not None
    second = begin()
    file.write_text(second.link)
    monkeypatch.setattr(background.clock, "monotonic", lambda now=time.monotonic: now() + 10)
    assert connection(str(file)) is known
    assert wait(lambda: known.run is not ended and known.run).link == second.link
    assert wait(lambda: known.surface) is not None and known.failure is None


def test_orders_are_forecast_given_and_taken_back(solver):
    known, requests = connection(solver.link), Requests()
    run = wait(lambda: known.run)
    assert requests.outcomes == {}
    requests.forecast(run, SQUEEZE)
    told = wait(lambda: requests.outcomes["forecast"].partition("asked")[0])
    assert told.startswith("applied, least scaled Jacobian 0.")
    assert run.edit_count == 0
    requests.order(run, SQUEEZE, schedule={"steps": 2})
    wait(lambda: requests.outcomes.get("status") == "applied, shape 2 of 2")
    wait(lambda: run.edit_count == 1)
    assert run.edit_count == len(run.stack)
    requests.undo(run)
    wait(lambda: run.edit_count == 0 and requests.outcomes["status"].startswith("applied"))
    requests.order(run, [{"translate": {"features": ["tpo"], "by": [0, 0, 1]}}])
    wait(lambda: "tpo" in "".join(requests.outcomes.values()))
    watching = tombolo.connect(solver.link, watch=True)
    requests.undo(watching)
    wait(lambda: requests.outcomes["undo"].startswith("refused: this client only watches"))
    watching.close()


class Slow:
    """A run whose answers come when they are let through, or are an error that nobody expects."""

    def __init__(self):
        self.let_through = {}

    def forecast(self, edits):
        if edits is None:
            raise TypeError("no such edits")
        assert self.let_through.setdefault(edits, threading.Event()).wait(30)
        return tombolo.Forecast({"outcome": edits, "min_scaled_jacobian": 0.5})


def test_of_the_answers_the_one_to_the_last_question_is_kept():
    run, requests = Slow(), Requests()
    for edits in ("first", "second"):
        requests.forecast(run, edits)
        wait(lambda edits=edits: edits in run.let_through)
    for edits in ("second", "first"):
        run.let_through[edits].set()
        wait(lambda: requests.outcomes["forecast"] != "asked")
    wait(lambda: all(not thread.name.startswith("tombolo-forecast") for thread in threading.enumerate()))
    assert requests.outcomes["forecast"] == "second, least scaled Jacobian 0.5"
    requests.forecast(run, None)
    assert wait(lambda: requests.outcomes["forecast"].partition("asked")[0]) == "failed: TypeError: no such edits"


def test_an_error_that_nobody_expects_is_told():
    known = connection("http://a\ud800:9/?token=a")
    assert wait(lambda: known.failure).startswith("UnicodeEncodeError: ")


def test_a_connection_lasts_as_long_as_somebody_refers_to_it(solver, connections):
    known, again = [connection(solver.link)], connection(solver.link)
    wait(lambda: known[0].surface)
    with tombolo.connect(solver.link, watch=True) as other:
        other.wait_for(lambda: other.status.viewers == 2, 30)
        known.clear()
        assert len(connections) == 1
        del again
        assert not connections
        other.wait_for(lambda: other.status.viewers == 1, 30)


def test_a_connection_that_waits_for_the_first_step_ends_too(connections):
    with tombolo.Adaptor({"version": 1, "stream": {"listen": "127.0.0.1:0"}}) as adaptor:
        known = [connection(adaptor.link)]
        thread, run = known[0]._thread, weakref.ref(wait(lambda: known[0].run))
        assert known[0].surface is None and known[0].failure is None and thread.is_alive()
        known.clear()
        thread.join(20)
        assert not thread.is_alive() and run() is None and not connections
