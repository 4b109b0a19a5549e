"""What the studies of this folder share: a flow that runs, answers that have settled, and two ways to ask for them.

A study asks for a `Quantity`, the pressure drop or the flow rate, at one shape after another. `Running` asks one flow
that goes on, and changes its shape by an order. `Restarted` asks a flow that begins anew in each shape. Both wait by
the same `Criterion`. For a study of your own copy this file and one that uses it: that one says what the shapes are,
and how they are searched.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Optional

import numpy as np
import tombolo
from numpy.typing import NDArray

SHAPE = {"name": "shape", "on": "order", "stages": [{"deform": {}}, {"guard": {"min_scaled_jacobian": 0.02}}]}

Edits = Callable[[float], list[dict[str, Any]]]
Ask = Callable[[float], float]
Search = Callable[[Ask, float], float]


def configuration(*pipelines: Mapping[str, Any]) -> dict[str, Any]:
    """Pipelines with a server on any free port."""
    return {"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": list(pipelines)}


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Within the block SIGTERM raises `SystemExit`, as Ctrl-C raises `KeyboardInterrupt`: what has begun is ended."""

    def end(number: int, _: object) -> None:
        # One is enough: a second must not break off what the first has begun to end.
        signal.signal(number, signal.SIG_IGN)
        raise SystemExit(128 + number)

    if threading.current_thread() is not threading.main_thread():
        # Python lets the main thread alone handle signals.
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextlib.contextmanager
def begun(
    program: Path, case: Path, pipelines: Mapping[str, Any], orders: Sequence[Mapping[str, Any]], folder: Path
) -> Iterator[Path]:
    """The link of a flow that runs; it is ended behind the block."""
    (folder / "pipelines.json").write_text(json.dumps(pipelines))
    (folder / "orders.json").write_text(json.dumps(orders))
    files = ["--pipelines", folder / "pipelines.json", "--orders", folder / "orders.json", "--out", folder]
    command = [str(part) for part in (program, "--case", case, *files)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    try:
        line = "it said nothing"
        for line in process.stdout:  # noqa: B007
            # The file with the link is whole before the run says where it is.
            if links := sorted(folder.glob("tombolo-*.link")):
                break
        else:
            raise RuntimeError(f"the flow ended before it opened its server: {line}")
        yield links[0]
    finally:
        process.terminate()
        process.stdout.read()
        process.wait(timeout=60)
        process.stdout.close()


class Quantity(NamedTuple):
    """What a study asks a flow for.

    Attributes
    ----------
    name, unit : str
        As a picture has them on its axis.
    monitor : str
        Its name among the monitors of the pipeline.
    stages : list of dict
        The pipeline that measures it at each step.
    """

    name: str
    unit: str
    monitor: str
    stages: Sequence[Mapping[str, Any]]


DROP = Quantity(
    "pressure drop",
    "Pa",
    "drop",
    [
        {"surface": {}},
        {"integrate": {"name": "inlet", "features": ["inlet"], "field": "pressure", "unit": "Pa"}},
        {"integrate": {"name": "outlet", "features": ["outlet"], "field": "pressure", "unit": "Pa"}},
        {"difference": {"name": "drop", "of": "inlet.mean", "minus": "outlet.mean", "unit": "Pa"}},
    ],
)
# In the mean over a hundredth of a second: where pressure drives the flow, it swings a little from step to step.
RATE = Quantity(
    "flow rate",
    "m3/s",
    "rate.mean",
    [
        {"surface": {}},
        {"integrate": {"name": "outlet", "features": ["outlet"], "vector": "velocity", "units": {"flow_rate": "m3/s"}}},
        {"time_statistics": {"name": "rate", "monitor": "outlet.flow_rate", "window": 0.01, "unit": "m3/s"}},
    ],
)


class Criterion(NamedTuple):
    """When a flow has settled.

    Over `window` steps the quantity has changed by less than `change` of what it is in the reference shape.
    """

    window: int
    change: float


class Flows(NamedTuple):
    """How the flows of a study begin, change their shape and settle.

    Attributes
    ----------
    program, case : path
        The program `flow`, and its case.
    parameters : dict
        Parameters of the case that are not as it says.
    schedule : int
        Steps that the mesh takes from one shape to the next.
    criterion : Criterion
        When a flow has settled.
    timeout : float
        Seconds for one answer, at most.
    quantity : Quantity
        What is asked for.
    """

    program: Path
    case: Path
    parameters: Mapping[str, float]
    schedule: int
    criterion: Criterion
    timeout: float = 600.0
    quantity: Quantity = DROP

    @contextlib.contextmanager
    def begun(self, edits: Sequence[Mapping[str, Any]] = ()) -> Iterator[tombolo.Run]:
        """A client of a flow that begins in the shape of these edits; both are ended behind the block."""
        at = {"cycle": 0}
        orders = [{"at": at, "parameter": {"name": name, "value": value}} for name, value in self.parameters.items()]
        with contextlib.ExitStack() as ended:
            ended.enter_context(terminable())
            folder = Path(ended.enter_context(tempfile.TemporaryDirectory()))
            case = self.shaped(edits, folder)
            measured = {"name": "study", "every": {"steps": 1}, "stages": self.quantity.stages}
            link = ended.enter_context(begun(self.program, case, configuration(measured, SHAPE), orders, folder))
            run = ended.enter_context(tombolo.connect(link))
            yield run

    def shaped(self, edits: Sequence[Mapping[str, Any]], folder: Path) -> Path:
        """The case on a mesh that edits have shaped; the case as it is without any."""
        if not edits:
            return self.case
        case = json.loads(self.case.read_text())
        mesh, shape, file = folder / "shaped.vtu", folder / "edits.json", folder / "case.json"
        shape.write_text(json.dumps(edits))
        files = ["--mesh", self.case.parent / case["mesh"], "--edits", shape, "--out", mesh]
        subprocess.run([sys.executable, "-m", "tombolo", "edit", *files], check=True, stdout=subprocess.DEVNULL)
        # These lie beside the case, and others are given in their place.
        for name in ("pipelines", "orders"):
            case.pop(name, None)
        file.write_text(json.dumps(case | {"mesh": str(mesh)}))
        return file

    def settled(self, run: tombolo.Run, since: int, scale: Optional[float]) -> tuple[float, int]:
        """The quantity, once it has settled behind the cycle `since`; and the cycle at which it had.

        `scale` is the quantity of the reference, None where it is that which is asked for.
        """
        window, change = self.criterion

        def found() -> Optional[tuple[float, int]]:
            cycles, results = self.history(run)
            cycles, results = cycles[cycles > since], results[cycles > since]
            if len(results) < window:
                return None
            windows = np.lib.stride_tricks.sliding_window_view(results, window)
            allowed = change * np.abs(windows.mean(axis=1) if scale is None else scale)
            steady = np.flatnonzero(np.ptp(windows, axis=1) <= allowed)
            if not len(steady):
                return None
            end = steady[0] + window - 1
            return float(results[end]), int(cycles[end])

        answer = run.wait_for(found, self.timeout)
        assert answer is not None
        return answer

    def history(self, run: tombolo.Run) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The cycles so far, and the quantity at each."""
        table = run.monitors.get("study")
        if table is None:
            return np.empty(0), np.empty(0)
        results = table[self.quantity.monitor]
        return table["cycle"][: len(results)], results


class Answer(NamedTuple):
    """The quantity at a value of what is varied, and the steps that it took to settle."""

    value: float
    result: float
    steps: int


class Study:
    """Answers to a question, and what they cost.

    Attributes
    ----------
    name : str
        The way it asks.
    reference : float
        The quantity in the shape that the case begins with: what "settled" is measured by.
    answers : list of Answer
        What it was told, in order.
    histories : list
        Of each flow the cycles and the quantity at each.
    spent : int
        The steps of all flows.
    """

    name: str
    reference: float

    def __init__(self, flows: Flows, edits: Edits) -> None:
        self.flows, self.edits = flows, edits
        self.answers: list[Answer] = []
        self.histories: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
        self.spent = 0

    @property
    def mean(self) -> float:
        """The steps that an answer took, on average."""
        return float(np.mean([answer.steps for answer in self.answers]))


class Running(Study):
    """Answers from one flow that goes on.

    The steps of an answer count from the first motion of the mesh. `spent` counts all: those too before the first
    order, `start`, and those that the flow takes while an order is on its way.
    """

    name = "one running flow"

    def __init__(self, run: tombolo.Run, flows: Flows, edits: Edits) -> None:
        super().__init__(flows, edits)
        self.run = run
        self.reference, self.start = flows.settled(run, 0, None)
        self.spent, self.histories = self.start, [flows.history(run)]

    def ask(self, value: float) -> float:
        """Ask for the quantity at a value."""
        # A whole stack replaces the orders before it: shapes do not add up.
        schedule = {"steps": self.flows.schedule, "ease": "smooth"}
        order = {"stack": self.edits(value), "schedule": schedule}
        applied = self.run.order(order).wait(self.flows.timeout).cycle_applied
        assert applied is not None
        result, cycle = self.flows.settled(self.run, applied + self.flows.schedule, self.reference)
        self.answers.append(Answer(value, result, cycle - applied))
        self.spent, self.histories = cycle, [self.flows.history(self.run)]
        return result


class Restarted(Study):
    """Answers from a flow that begins anew in each shape."""

    name = "a flow for each shape"

    def __init__(self, flows: Flows, edits: Edits, reference: float) -> None:
        super().__init__(flows, edits)
        self.reference = reference

    def ask(self, value: float) -> float:
        """Ask for the quantity at a value."""
        with self.flows.begun(self.edits(value)) as run:
            result, cycle = self.flows.settled(run, 0, self.reference)
            cycles, results = self.flows.history(run)
        self.answers.append(Answer(value, result, cycle))
        self.histories.append((cycles[cycles <= cycle], results[cycles <= cycle]))
        self.spent += cycle
        return result


class Comparison(NamedTuple):
    """A study that was made in both ways, and the values that they have found."""

    running: Running
    restarted: Restarted
    values: tuple[float, float]

    @property
    def studies(self) -> tuple[Study, Study]:
        """Both ways."""
        return self.running, self.restarted

    @property
    def quantity(self) -> Quantity:
        """What both have asked for."""
        return self.running.flows.quantity


def compare(flows: Flows, edits: Edits, search: Search) -> Comparison:
    """Makes a study in both ways.

    Parameters
    ----------
    flows : Flows
        How flows begin and settle.
    edits : callable
        The edits that make the shape of a value, measured from the reference.
    search : callable
        Finds a value, by a function that gives the quantity at a value, and the quantity of the reference.
    """
    with flows.begun() as run:
        running = Running(run, flows, edits)
        first = search(running.ask, running.reference)
    restarted = Restarted(flows, edits, running.reference)
    return Comparison(running, restarted, (first, search(restarted.ask, running.reference)))


def reached(times: float, lower: float, upper: float, tolerance: float) -> Search:
    """A search between two bounds for the value at which the quantity is so many times the reference's.

    It is Brent's method for a root.
    """
    from scipy.optimize import brentq

    def find(ask: Ask, reference: float) -> float:
        return float(brentq(lambda value: ask(value) - times * reference, lower, upper, xtol=tolerance))

    return find


def least(lower: float, upper: float, tolerance: float) -> Search:
    """A search for the value at which the quantity is least between two bounds, by Brent's method."""
    from scipy.optimize import minimize_scalar

    def find(ask: Ask, _: float) -> float:
        options = {"xatol": tolerance}
        return float(minimize_scalar(ask, bounds=(lower, upper), method="bounded", options=options).x)

    return find


def sampled(lower: float, upper: float, trials: int) -> Search:
    """A search for the value at which the quantity is least by Optuna, which takes no answer for exact."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)

    def find(ask: Ask, _: float) -> float:
        search = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1))
        search.optimize(lambda trial: ask(trial.suggest_float("value", lower, upper)), n_trials=trials)
        return float(search.best_params["value"])

    return find


def evolved(lower: float, upper: float, trials: int) -> Search:
    """A search for the value at which the quantity is least by CMA-ES, which takes no answer for exact either."""
    import cma

    def find(ask: Ask, _: float) -> float:
        # It searches for two numbers at least: the second one changes nothing.
        options = {"bounds": [0, 1], "maxiter": max(trials // 6, 1), "popsize": 6, "seed": 1, "verbose": -9}
        search = cma.CMAEvolutionStrategy([0.5, 0.5], 0.25, options)
        search.optimize(lambda at: ask(lower + float(at[0]) * (upper - lower)))
        return lower + float(search.result.xfavorite[0]) * (upper - lower)

    return find


def arguments(
    description: str, case: str, tolerance: float, schedule: int, criterion: Criterion
) -> argparse.ArgumentParser:
    """What each study can be told on the command line; these are its defaults."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--flow", type=Path, required=True, help="the program flow")
    parser.add_argument("--case", type=Path, default=Path(case))
    parser.add_argument(
        "--set", nargs=2, action="append", default=[], metavar=("NAME", "VALUE"), help="a parameter of the case"
    )
    parser.add_argument("--tolerance", type=float, default=tolerance, help="of what is searched for")
    parser.add_argument("--schedule", type=int, default=schedule, help="steps from one shape to the next")
    parser.add_argument("--window", type=int, default=criterion.window, help="steps that it has to be steady for")
    parser.add_argument(
        "--change", type=float, default=criterion.change, help="by which it may change, in parts of the reference's"
    )
    parser.add_argument("--timeout", type=float, default=600, help="seconds for one answer at most")
    parser.add_argument("--plot", type=Path, help="a picture of what was measured over the steps, by matplotlib")
    return parser


def bounds(parser: argparse.ArgumentParser, lower: float, upper: float, meaning: str) -> None:
    """What studies that look for the least can be told too."""
    parser.add_argument("--bounds", type=float, nargs=2, default=(lower, upper), help=meaning)
    parser.add_argument("--trials", type=int, help="search by sampling, with so many answers")
    parser.add_argument("--by", choices=("optuna", "cma"), default="optuna", help="the package that samples")


def search(given: argparse.Namespace) -> Search:
    """The search for the least that the command line asks for."""
    lower, upper = given.bounds
    if not given.trials:
        return least(lower, upper, given.tolerance)
    return (evolved if given.by == "cma" else sampled)(lower, upper, given.trials)


def flows(given: argparse.Namespace, quantity: Quantity = DROP) -> Flows:
    """The flows that the command line asks for."""
    parameters = {name: float(value) for name, value in given.set}
    criterion = Criterion(given.window, given.change)
    return Flows(given.flow, given.case, parameters, given.schedule, criterion, given.timeout, quantity)


def tell(comparison: Comparison, name: str) -> None:
    """Prints what came out; `name` is what was varied."""
    running, restarted, values = comparison
    quantity = comparison.quantity
    print(f"{quantity.name} of the reference {running.reference:.4g} {quantity.unit} after {running.start} steps")
    for way, value in zip(comparison.studies, values):
        print(f"{way.name}: {name} {value:.4f} after {len(way.answers)} answers and {way.spent} steps")
        for answer in way.answers:
            print(
                f"  {name} {answer.value:.4f}: {answer.result:.4g} {quantity.unit}, settled after {answer.steps} steps"
            )
    print(f"steps, running / anew: {running.spent / restarted.spent:.2f} in all", end=", ")
    print(f"{running.mean / restarted.mean:.2f} per answer, on average")


def conclude(
    comparison: Comparison, given: argparse.Namespace, name: str, unit: str, wanted: Optional[float] = None
) -> int:
    """Prints what came out, and draws it where that is asked for; the exit code: 0 where both ways agree."""
    tell(comparison, name)
    if given.plot:
        plot(comparison, f"{name} [{unit}]", given.plot, wanted)
    first, second = comparison.values
    return 0 if abs(first - second) <= 2 * given.tolerance else 1


def plot(comparison: Comparison, name: str, file: Path, wanted: Optional[float] = None) -> None:
    """Draws the quantity over the steps that were spent, and over what was varied."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (time, shape) = pyplot.subplots(
        1, 2, figsize=(10, 3.5), width_ratios=(2, 1), sharey=True, layout="constrained"
    )
    for way, color, marker in zip(comparison.studies, ("tab:blue", "tab:orange"), "ox"):
        spent = 0
        for cycles, results in way.histories:
            time.plot(spent + cycles, results, color=color, linewidth=1)
            spent += int(cycles[-1])
        values, results, _ = zip(*way.answers)
        shape.plot(values, results, marker, color=color, markerfacecolor="none", label=way.name)
    answers = [answer.result for way in comparison.studies for answer in way.answers] + [comparison.running.reference]
    room = 0.3 * np.ptp(answers)
    time.set(
        xlabel="solver steps spent", ylabel=f"{comparison.quantity.name} [{comparison.quantity.unit}]", xlim=(0, None)
    )
    # The peaks while a mesh moves would leave no room for the rest.
    time.set(ylim=(min(answers) - room, max(answers) + room))
    shape.set(xlabel=name)
    if wanted is not None:
        for axes in (time, shape):
            axes.axhline(wanted, color="gray", linestyle="dotted")
    shape.legend()
    figure.savefig(file, dpi=110)
