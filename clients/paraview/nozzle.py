"""Pinches a running nozzle by the filters of the plug-in, forecasts, and takes it back: without an interface.

    flow --case examples/flow/cases/nozzle.json                       # prints its link, and writes it to a file
    pvpython clients/paraview/nozzle.py tombolo-7070.link

The throat is pinched to half its height as in the paper: at once, and in ten shapes; the third order is the
displacement that two chains of edits add up to. Each makes the shape that its chain shows, whatever the run had before;
its undo brings that back. With `--out` what is shown after each order is written as `shown-CYCLE.vtp`.
"""

import argparse
import time
from pathlib import Path

from paraview import servermanager, simple

simple.LoadPlugin(str(Path(__file__).with_name("tombolo_paraview.py")), ns=globals())


def wait(proxy, found, seconds=60):
    """Asks for what is new until it is there, as the interface does ten times a second."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        proxy.SMProxy.InvokeCommand("Refresh")
        proxy.UpdatePipeline()
        data = servermanager.Fetch(proxy)
        if found(data):
            return data
        time.sleep(0.05)
    raise TimeoutError("it did not come in time")


def cycle(data):
    """The step that is shown; -1 before the first."""
    array = data.GetFieldData().GetArray("cycle")
    return -1 if array is None else int(array.GetValue(0))


def newest(run):
    """What a run shows from now on: the frame on its way may be of before."""
    run.UpdatePipeline()
    shown = servermanager.Fetch(run)
    for _ in range(2):
        before = cycle(shown)
        shown = wait(run, lambda data, before=before: cycle(data) > before)
    return shown


def rows(table):
    """A table of two columns as a dict."""
    return {
        table.GetValue(row, 0).ToString(): table.GetValue(row, 1).ToString() for row in range(table.GetNumberOfRows())
    }


def steer(link, view, cycles, out, say):
    """Gives and takes back the three orders; says what becomes of each, and writes what is shown into a folder."""
    run = TomboloRun(Link=link, View=view)  # noqa: F821
    began = cycle(wait(run, lambda data: cycle(data) >= 0))
    surface = TomboloSurface(Link=link)  # noqa: F821
    wait(surface, lambda data: data.GetNumberOfPoints() > 0)

    def pinch(factor):
        handle = {"Features": "throat", "Fixed": "inlet, outlet"}
        return TomboloScaleDirection(Input=surface, Factors=[1, 1, factor], **handle)  # noqa: F821

    def keep():
        shown = newest(run)
        if out:
            simple.SaveData(str(out / f"shown-{cycle(shown)}.vtp"), proxy=run)

    both = TomboloCombineDisplacements(First=pinch(0.75), Second=pinch(0.75))  # noqa: F821
    for edits, steps in ((pinch(0.5), 1), (pinch(0.5), 10), (both, 10)):
        order = TomboloOrder(Input=edits, Link=link, Steps=steps, Every=2)  # noqa: F821
        order.SMProxy.InvokeCommand("Forecast")
        told = rows(wait(order, lambda table: rows(table).get("forecast", "asked") != "asked"))
        say(f"forecast: {told['forecast']}")
        order.SMProxy.InvokeCommand("Give")
        told = rows(wait(order, lambda table: rows(table).get("status", "").startswith(("applied", "rejected"))))
        say(f"order: {told['status']} {told.get('reason', '')}")
        keep()
        order.SMProxy.InvokeCommand("Undo")
        wait(order, lambda table: rows(table).get("stack") == "0 edits")
        told = rows(wait(order, lambda table: rows(table).get("status", "").startswith("applied")))
        say(f"undo: {told['status']}")
        keep()
    shown = wait(run, lambda data: cycle(data) >= began + cycles)
    say(f"watched from cycle {began} to {cycle(shown)}")


def main():
    """The program."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("link")
    arguments.add_argument("--view", default="surface")
    arguments.add_argument("--cycles", type=int, default=200, help="how long it is watched, at least")
    arguments.add_argument("--out", type=Path)
    given = arguments.parse_args()
    steer(given.link, given.view, given.cycles, given.out, lambda text: print(text, flush=True))


if __name__ == "__main__":
    main()
