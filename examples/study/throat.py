"""Finds the height of a nozzle's throat that gives a wanted pressure drop, on a flow that goes on all the time.

    scripts/setup && .venv/bin/python scripts/meshes channel-60k && cargo build --release -p tombolo-flow
    .venv/bin/python examples/study/throat.py --flow target/release/flow

Brent's method asks for the pressure drop at one height after another. The study is made twice: on one running flow,
whose shape is changed by an order for each height; and with a flow that begins anew for each height, as such studies
are made today. Both wait by the same criterion: over the last `WINDOW` steps the drop has changed by less than
`SETTLED` of itself.
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

WINDOW, SETTLED = 40, 2e-3
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
    return {"stack": [{"scale_direction": edit}], "schedule": {"steps": 4, "every": {"steps": 5}}}


@contextlib.contextmanager
def flow(program, case, viscosity, orders=()):
    """A flow that runs, and a client that steers it; it is stopped behind the block."""
    with tempfile.TemporaryDirectory() as folder:
        pipelines, commands = Path(folder, "pipelines.json"), Path(folder, "orders.json")
        pipelines.write_text(json.dumps(PIPELINES))
        commands.write_text(
            json.dumps([{"at": {"cycle": 0}, "parameter": {"name": "viscosity_scale", "value": viscosity}}, *orders])
        )
        arguments = ["--case", case, "--pipelines", pipelines, "--orders", commands, "--out", folder]
        process = subprocess.Popen([program, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        try:
            yield tombolo.connect(link(process, Path(folder)))
        finally:
            process.terminate()
            process.stdout.read()
            process.wait(timeout=60)


def link(process, folder):
    """The file with the links of a run, which is there before the run says so."""
    line = "it said nothing"
    for line in process.stdout:  # noqa: B007
        if found := sorted(folder.glob("tombolo-*.link")):
            return found[0]
    raise RuntimeError(f"the flow ended before it opened its server: {line}")


def settled(run, since, timeout):
    """The pressure drop, once it has settled behind the cycle `since`; and the cycle at which it had."""

    def found():
        table = run.monitors.get("study")
        if table is None:
            return None
        cycles = table["cycle"]
        drops = table["drop"][: len(cycles)]
        last = drops[cycles > since][-WINDOW:]
        if len(last) < WINDOW or np.ptp(last) > SETTLED * abs(last.mean()):
            return None
        return float(last[-1]), int(cycles[len(drops) - 1])

    return run.wait_for(found, timeout)


class Running:
    """Answers from one flow that goes on."""

    def __init__(self, run, timeout):
        self.run, self.timeout = run, timeout
        settled(run, 0, timeout)
        self.began, self.answers = run.status.cycle, []

    def drop(self, height):
        order = self.run.order(throat(height)).wait(self.timeout)
        drop, cycle = settled(self.run, order.cycle_applied + 20, self.timeout)
        self.answers.append((height, drop, cycle))
        return drop

    @property
    def steps(self):
        return self.answers[-1][2]


class Restarted:
    """Answers from a flow that begins anew in each shape."""

    def __init__(self, begin, timeout):
        self.begin, self.timeout, self.answers, self.steps = begin, timeout, [], 0

    def drop(self, height):
        order = throat(height) | {"schedule": {"steps": 1}}
        with self.begin(orders=[{"at": {"cycle": 0}, "order": order}]) as run:
            drop, cycle = settled(run, 0, self.timeout)
        self.steps += cycle
        self.answers.append((height, drop, cycle))
        return drop


def search(study, wanted, tolerance):
    """The height at which the drop is the wanted one, by Brent's method between a half and the whole."""
    return scipy.optimize.brentq(lambda height: study.drop(height) - wanted, 0.5, 1.0, xtol=tolerance)


def main():
    """The program."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--flow", required=True, help="the program flow")
    arguments.add_argument("--case", default="examples/flow/cases/nozzle.json")
    arguments.add_argument(
        "--times", type=float, default=1.5, help="the wanted drop, in parts of that of the reference"
    )
    arguments.add_argument("--tolerance", type=float, default=2e-3, help="of the height")
    arguments.add_argument("--viscosity", type=float, default=20, help="in parts of the case's: thick fluids settle")
    arguments.add_argument("--timeout", type=float, default=600, help="seconds for one answer at most")
    given = arguments.parse_args()

    def begin(orders=()):
        return flow(given.flow, given.case, given.viscosity, orders)

    with begin() as run:
        running = Running(run, given.timeout)
        reference, _ = settled(run, 0, given.timeout)
        wanted = given.times * reference
        found = search(running, wanted, given.tolerance)
    restarted = Restarted(begin, given.timeout)
    again = search(restarted, wanted, given.tolerance)

    print(f"drop of the reference {reference:.3f} Pa, wanted {wanted:.3f} Pa")
    for name, study, height in (("one running flow", running, found), ("a flow for each", restarted, again)):
        print(f"{name}: height {height:.4f} after {len(study.answers)} answers and {study.steps} steps")
        for answer in study.answers:
            print("  height {:.4f}: {:.3f} Pa at cycle {}".format(*answer))
    print(f"steps, running / anew: {running.steps / restarted.steps:.2f}; heights differ by {abs(found - again):.4f}")
    return 0 if abs(found - again) <= 5 * given.tolerance else 1


if __name__ == "__main__":
    sys.exit(main())
