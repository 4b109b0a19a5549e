"""A run in a notebook: its cells are run again, and what they return is shown."""

import gc
import os
import re
import subprocess
import sys
import types
from html.parser import HTMLParser
from xml.etree import ElementTree

import numpy as np
import pytest
import tombolo
from conftest import CONFIGURATION, wait
from tombolo.jupyter import Plot, _svg, viewer


def steers(link):
    """Whether one who connects now can steer."""
    with tombolo.connect(link) as other:
        try:
            other.drive(0.5)
        except tombolo.NotDriverError:
            return False
        return True


def test_a_cell_that_is_run_again_has_the_wheel_again(solver):
    run = tombolo.connect(solver.link)
    run.set("heating", 2, timeout=30)
    run = tombolo.connect(solver.link)
    gc.collect()
    run.set("heating", 3, timeout=30)
    wait(lambda: run.status.viewers == 1)
    run.close()


def test_a_run_that_only_a_function_or_an_iterator_refers_to_stays(solver):
    def connect():
        run = tombolo.connect(solver.link)
        run.drive()
        return run

    called = []
    remove = connect().on("monitor", called.append)
    gc.collect()
    count = len(called)
    wait(lambda: len(called) > count + 20)
    assert not steers(solver.link)
    remove()
    gc.collect()
    assert wait(lambda: steers(solver.link), 10)

    events = connect().events("monitor", timeout=30)
    gc.collect()
    first = next(events).data["cycle"]
    assert next(events).data["cycle"] == first + 1 and not steers(solver.link)
    del events
    gc.collect()
    assert wait(lambda: steers(solver.link), 10)


def test_a_run_that_its_own_function_refers_to_goes_with_it(solver):
    def watch():
        run = tombolo.connect(solver.link)
        run.drive()
        called = []
        remove = run.on(None, lambda event: called.append(run.status.cycle))
        wait(lambda: called)
        return remove

    watch()()
    gc.collect()
    assert wait(lambda: steers(solver.link), 10)


class Page(HTMLParser):
    """What is seen of a page, and what its elements say."""

    def __init__(self, page):
        super().__init__()
        self.seen, self.elements = "", {}
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.elements[tag] = dict(attributes)

    def handle_data(self, text):
        self.seen += f"{text} "


def test_a_run_shows_itself_in_a_notebook(solver, run):
    run.wait_for(lambda: run.monitors.get("health") and run.monitors["health"].rows and run.status.cycle > 5, 30)
    page = Page(run._repr_html_())
    # A run that names no page is in no frame: no browser would show it.
    assert not {"iframe", "script", "object", "embed"} & set(page.elements)
    assert page.elements["a"]["href"] == solver.link
    assert page.elements["a"]["target"] == "_blank" and "noopener" in page.elements["a"]["rel"].split()
    place, secret = solver.link.split("?token=")
    assert place in page.seen and secret[:32] not in page.seen
    assert " running" in page.seen and re.search(r" cycle +[1-9]", page.seen)
    assert re.search(r" health +.*temperature\.max [0-9.]+,", page.seen)
    run.pause(timeout=30)
    run.wait_for(lambda: run.status.paused, 30)
    assert "paused, steered from here" in run._repr_html_()
    run.stop(timeout=30)
    assert run.wait(30)["how"] == "stopped" and " stopped " in Page(run._repr_html_()).seen


def test_a_link_in_a_notebook_is_nothing_but_a_link():
    assert Page(viewer('http://127.0.0.1:1/?token=a"><b>')).elements.keys() == {"a"}
    for link in ("unix:/run/user/tombolo.sock?token=secret", "javascript:alert(1)"):
        page = Page(viewer(link))
        assert not page.elements and "no browser" in page.seen and "secret" not in page.seen


def test_a_run_that_names_the_notebook_shows_the_viewer_in_it():
    pages = ["https://hub.example.org", "http://localhost:8888"]
    page = Page(viewer("http://127.0.0.1:7070/?token=a", pages))
    assert page.elements["iframe"]["src"] == "http://localhost:7070/?token=a"
    assert page.elements["a"]["href"] == "http://127.0.0.1:7070/?token=a"
    for link, pages, framed in [
        ("https://hub.example.org/runs/a/?token=a", pages, "https://hub.example.org/runs/a/?token=a"),
        ("https://relay.example.org/a/?token=a", pages, "https://relay.example.org/a/?token=a"),
        ("http://localhost:7070/?token=a", ["http://[::1]:8888"], "http://[::1]:7070/?token=a"),
        ("http://localhost:7070/?token=a", ["http://127.0.0.1"], "http://127.0.0.1:7070/?token=a"),
        ("https://relay.example.org/?token=a", ["http://localhost:8888"], None),
        ("http://node7:7070/?token=a", ["http://localhost:8888"], None),
    ]:
        assert Page(viewer(link, pages)).elements.get("iframe", {}).get("src") == framed, (link, pages)


def test_a_run_in_a_notebook_is_in_a_frame_where_it_says_so(begin):
    stream = {"listen": "127.0.0.1:0", "embed": ["http://localhost:8888"]}
    solver = begin({**CONFIGURATION, "stream": stream})
    with tombolo.connect(solver.link) as run:
        frame = Page(run._repr_html_()).elements["iframe"]
        assert frame["src"] == solver.link.replace("127.0.0.1", "localhost")
        run.stop(timeout=30)
        run.wait(30)
        assert "iframe" not in Page(run._repr_html_()).elements


def test_a_monitor_is_plotted(run):
    run.wait_for(lambda: "health" in run.monitors and run.monitors["health"].rows > 5, 30)
    root = ElementTree.fromstring(Plot(run, "health", "temperature.max")._repr_svg_())
    (line,) = root.iter("{http://www.w3.org/2000/svg}polyline")
    heights = [float(pair.split(",")[1]) for pair in line.get("points").split()]
    assert len(heights) > 5 and heights == sorted(heights, reverse=True)
    parted = ElementTree.fromstring(_svg("t", np.arange(5), np.array([1, 2, np.nan, 3, 4])))
    assert len(list(parted.iter("{http://www.w3.org/2000/svg}polyline"))) == 2
    assert "nothing measured" in _svg("t", np.arange(2), np.full(2, np.nan))


def test_a_plot_of_what_is_not_measured_does_not_live(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "IPython.display", types.SimpleNamespace(display=None))
    for names, near in ((("helth", "quality.min"), "health"), (("health", "qality.min"), "quality.min")):
        with pytest.raises(KeyError, match=rf"did you mean '{near}'"):
            Plot(run, *names).live(timeout=30)


SHOWN = """
import sys
import tombolo
from IPython.core.interactiveshell import InteractiveShell
from IPython.display import display
from IPython.utils.capture import capture_output

shell = InteractiveShell.instance()
shell.display_formatter.active_types = shell.display_formatter.format_types
with tombolo.connect(sys.argv[1]) as run:
    table = run.monitors["health"]
    run.wait_for(lambda: table.rows > 5, 30)
    with capture_output() as captured:
        display(run)
        run.plot("health", "quality.min").live(timeout=1.2)
for shown in captured.outputs:
    data, of_display = shown.data, (shown.transient or {}).get("display_id")
    print(*sorted(data), of_display is not None, shown.update)
    assert "<table>" in data.get("text/html", "<table>") and "<polyline" in data.get("image/svg+xml", "<polyline")
"""


def test_a_run_and_a_plot_that_lives_are_displayed_by_ipython(solver, tmp_path):
    pytest.importorskip("IPython")
    environment = os.environ | {"IPYTHONDIR": str(tmp_path)}
    command = [sys.executable, "-c", SHOWN, solver.link]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    of_run, of_plot, *updates = done.stdout.splitlines()
    assert of_run == "text/html text/plain False False"
    assert of_plot == "image/svg+xml text/plain True False"
    assert updates and set(updates) == {"image/svg+xml text/plain True True"}
