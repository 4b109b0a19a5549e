"""Finds the height of a nozzle's throat that gives a wanted pressure drop, on a flow that goes on all the time.

    scripts/setup && .venv/bin/python scripts/meshes channel-60k && cargo build --release -p tombolo-flow
    scripts/python && .venv/bin/python examples/study/throat.py --flow target/release/flow

Brent's method asks for the pressure drop at one height after another. The study is made twice: on one running flow,
whose shape is changed by an order for each height; and with a flow that begins anew for each height, as such studies
are made today. Both wait by the same criterion: over the last `WINDOW` steps the drop has changed by less than
`SETTLED` of itself. docs/study.md has what came out.
"""

import argparse
import contextlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import scipy.optimize
import tombolo

WINDOW, SETTLED = 10, 1e-3
SCHEDULE = 5  # steps that the mesh takes from one shape to the next
PIPELINES = {
    "version": 1,
    "stream": {"listen": "127.0.0.1:0"},
    "pipelines": [
        {
            "name": "study",
            "every": {"steps": 1},
            "stages": [
                {"surface": {}},
                {"integrate": {"name": "inlet", "features": ["inlet"], "field": "pressure", "unit": "Pa"}},
                {"integrate": {"name": "outlet", "features": ["outlet"], "field": "pressure", "unit": "Pa"}},
                {"difference": {"name": "drop", "of": "inlet.mean", "minus": "outlet.mean", "unit": "Pa"}},
            ],
        },
        {"name": "shape", "on": "order", "stages": [{"deform": {}}, {"guard": {"min_scaled_jacobian": 0.02}}]},
    ],
}


def throat(height):
    """The order of a throat's height, as a fraction of the reference's; it replaces the orders before it."""
    edit = {"features": ["throat"], "fixed": ["inlet", "outlet"], "factors": [1, 1, height], "name": "throat"}
    return {"stack": [{"scale_direction": edit}], "schedule": {"steps": 1, "every": {"steps": SCHEDULE}}}


@contextlib.contextmanager
def begun(program, case, pipelines, orders, folder):
    """The link of a flow that runs; it is ended behind the block."""
    folder = Path(folder)
    (folder / "pipelines.json").write_text(json.dumps(pipelines))
    (folder / "orders.json").write_text(json.dumps(orders))
    files = ["--pipelines", folder / "pipelines.json", "--orders", folder / "orders.json", "--out", folder]
    command = [program, "--case", case, *files]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        yield link(process, folder)
    finally:
        process.terminate()
        process.stdout.read()
        process.wait(timeout=60)
        process.stdout.close()


@contextlib.contextmanager
def flow(program, case, viscosity, orders=()):
    """A flow that runs, and a client that steers it; both are ended behind the block."""
    thick = {"at": {"cycle": 0}, "parameter": {"name": "viscosity_scale", "value": viscosity}}
    with (
        tempfile.TemporaryDirectory() as folder,
        begun(program, case, PIPELINES, [thick, *orders], folder) as link,
        tombolo.connect(link) as run,
    ):
        yield run


def link(process, folder):
    """The file with the links of a run, which is there before the run says so."""
    line = "it said nothing"
    for line in process.stdout:  # noqa: B007
        if found := sorted(folder.glob("tombolo-*.link")):
            return found[0]
    raise RuntimeError(f"the flow ended before it opened its server: {line}")


def history(run):
    """The cycles so far, and the pressure drop at each."""
    table = run.monitors.get("study")
    if table is None:
        return np.empty(0), np.empty(0)
    drops = table["drop"]
    return table["cycle"][: len(drops)], drops


def settled(run, since, timeout):
    """The pressure drop, once it has settled behind the cycle `since`; and the cycle at which it had."""

    def found():
        cycles, drops = history(run)
        drops = drops[cycles > since]
        if len(drops) < WINDOW:
            return None
        windows = np.lib.stride_tricks.sliding_window_view(drops, WINDOW)
        steady = np.flatnonzero(np.ptp(windows, axis=1) <= SETTLED * np.abs(windows.mean(axis=1)))
        if not len(steady):
            return None
        end = steady[0] + WINDOW - 1
        return float(drops[end]), int(cycles[cycles > since][end])

    return run.wait_for(found, timeout)


class Running:
    """Answers from one flow that goes on: heights, drops, and the steps from the first motion of the mesh.

    `spent` counts all steps, those too that the flow takes while an order is on its way.
    """

    name = "one running flow"

    def __init__(self, run, timeout):
        self.run, self.timeout, self.answers, self.histories = run, timeout, [], []
        self.reference, self.start = settled(run, 0, timeout)
        self.spent = 0

    def drop(self, height):
        order = self.run.order(throat(height)).wait(self.timeout)
        drop, cycle = settled(self.run, order.cycle_applied + SCHEDULE, self.timeout)
        self.answers.append((height, drop, cycle - order.cycle_applied))
        self.spent, self.histories = cycle, [history(self.run)]
        return drop


class Restarted:
    """Answers from a flow that begins anew in each shape."""

    name = "a flow for each height"

    def __init__(self, begin, timeout):
        self.begin, self.timeout, self.answers, self.histories = begin, timeout, [], []

    @property
    def spent(self):
        return sum(taken for _, _, taken in self.answers)

    def drop(self, height):
        order = throat(height) | {"schedule": {"steps": 1}}
        with self.begin(orders=[{"at": {"cycle": 0}, "order": order}]) as run:
            drop, cycle = settled(run, 0, self.timeout)
            cycles, drops = history(run)
        self.histories.append((cycles[cycles <= cycle], drops[cycles <= cycle]))
        self.answers.append((height, drop, cycle))
        return drop


def search(study, wanted, tolerance):
    """The height at which the drop is the wanted one, by Brent's method between a half and the whole."""
    return scipy.optimize.brentq(lambda height: study.drop(height) - wanted, 0.5, 1.0, xtol=tolerance)


def plot(studies, wanted, file):
    """Draws the pressure drop over the steps that were spent."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(8, 3.5), layout="constrained")
    for study, color in zip(studies, ("tab:blue", "tab:orange")):
        spent, label = 0, study.name
        for cycles, drops in study.histories:
            axes.plot(spent + cycles, drops, color=color, label=label, linewidth=1)
            spent, label = spent + cycles[-1], None
    axes.axhline(wanted, color="gray", linestyle="dotted", label="wanted")
    axes.set(xlabel="solver steps spent", ylabel="pressure drop [Pa]", ylim=(0, 2.2 * wanted), xlim=(0, None))
    axes.legend()
    figure.savefig(file, dpi=110)


def compare(begin, times, tolerance, timeout):
    """Makes the study in both ways: the wanted drop, both studies, and the height that each finds."""
    with begin() as run:
        running = Running(run, timeout)
        wanted = times * running.reference
        found = search(running, wanted, tolerance)
        studies = [running, Restarted(begin, timeout)]
    again = search(studies[1], wanted, tolerance)
    return wanted, studies, (found, again)


def main():
    """The program."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--flow", required=True, help="the program flow")
    arguments.add_argument("--case", default="examples/flow/cases/nozzle.json")
    arguments.add_argument("--times", type=float, default=1.5, help="the wanted drop, in parts of the reference's")
    arguments.add_argument("--tolerance", type=float, default=1e-3, help="of the height")
    arguments.add_argument(
        "--viscosity", type=float, default=1, help="in parts of the case's: thick fluids settle soon"
    )
    arguments.add_argument("--timeout", type=float, default=600, help="seconds for one answer at most")
    arguments.add_argument("--plot", help="a picture of the drop over the steps, by matplotlib")
    given = arguments.parse_args()

    def begin(orders=()):
        return flow(given.flow, given.case, given.viscosity, orders)

    wanted, studies, heights = compare(begin, given.times, given.tolerance, given.timeout)
    running, restarted = studies
    print(f"drop of the reference {running.reference:.3f} Pa after {running.start} steps, wanted {wanted:.3f} Pa")
    for study, height in zip(studies, heights):
        print(f"{study.name}: height {height:.4f} after {len(study.answers)} answers and {study.spent} steps")
        for answer in study.answers:
            print("  height {:.4f}: {:.3f} Pa, settled after {} steps".format(*answer))
    print(f"steps, running / anew: {running.spent / restarted.spent:.2f}")
    if given.plot:
        plot(studies, wanted, given.plot)
    return 0 if abs(heights[0] - heights[1]) <= 2 * given.tolerance else 1


if __name__ == "__main__":
    sys.exit(main())
