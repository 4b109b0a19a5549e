"""A mesh, a solver that runs on a thread, and what the examples need."""

import contextlib
import importlib.util
import json
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import tombolo
from tombolo import background

#: What may be left out where `TOMBOLO_NO_SKIPS` asks for all: a wheel takes minutes to build, and ParaView to fetch.
MAY_SKIP = ("there is no new wheel", "scripts/fetch-paraview")
PROJECT = Path(__file__).parents[3]
EXAMPLES = PROJECT / "examples"
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", PROJECT / "target"))
FLOW = TARGET / "debug/flow"
GALLERY = TARGET / "gallery"
GALLERY.mkdir(parents=True, exist_ok=True)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Takes a test that was skipped for a failed one, where none may be."""
    report = yield
    reason = report.longrepr[2] if report.skipped and isinstance(report.longrepr, tuple) else None
    if reason and os.environ.get("TOMBOLO_NO_SKIPS") and not any(known in reason for known in MAY_SKIP):
        report.outcome, report.longrepr = "failed", f"{item.nodeid} was skipped: {reason}"
    return report


def box(count, dtype=float):
    """The unit cube as tetrahedra, six in each of `count` cubed cubes: points and cells."""
    axis = np.linspace(0, 1, count + 1)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    numbers = np.arange((count + 1) ** 3).reshape((count + 1,) * 3)
    corner = {
        (i, j, k): numbers[i : count + i, j : count + j, k : count + k].ravel()
        for i in (0, 1)
        for j in (0, 1)
        for k in (0, 1)
    }
    tets = []
    for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        steps, at = [(0, 0, 0)], [0, 0, 0]
        for axis_of_step in order:
            at[axis_of_step] = 1
            steps.append(tuple(at))
        sign = np.linalg.det(np.diff(np.array(steps, float), axis=0))
        chosen = steps if sign > 0 else [steps[0], steps[2], steps[1], steps[3]]
        tets.append(np.stack([corner[step] for step in chosen], -1))
    return points.astype(dtype), np.concatenate(tets)


def boundary(tets):
    """The faces of one cell alone."""
    faces = np.concatenate([tets[:, corners] for corners in ([0, 1, 3], [1, 2, 3], [2, 0, 3], [0, 2, 1])])
    _, first, counts = np.unique(np.sort(faces, 1), axis=0, return_index=True, return_counts=True)
    return faces[first[counts == 1]]


def ends(points, tets):
    """The faces of a box at the top and at the bottom."""
    faces = boundary(tets)
    heights = points[faces, 2]
    return {
        "top": faces[(heights == points[:, 2].max()).all(1)],
        "bottom": faces[(heights == points[:, 2].min()).all(1)],
    }


SQUEEZE = [{"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, -0.2]}}]


def load(file):
    """An example as a module, which finds those beside it."""
    file = EXAMPLES / file
    if str(file.parent) not in sys.path:
        sys.path.append(str(file.parent))
    specification = importlib.util.spec_from_file_location(file.stem, file)
    module = importlib.util.module_from_spec(specification)
    sys.modules[specification.name] = module
    specification.loader.exec_module(module)
    return module


study = load("study/study.py")
CONFIGURATION = study.configuration(
    {
        "name": "midplane",
        "every": {"steps": 1},
        "stages": [
            {"slice": {"origin": [0.5, 0.45, 0.5], "normal": [0, 1, 0]}},
            {"select": {"fields": ["temperature", "material"]}},
            {"stream": {"error": {"relative": 1e-6}}},
        ],
    },
    {
        "name": "health",
        "every": {"steps": 1},
        "stages": [{"quality": {}}, {"statistics": {"field": "temperature"}}],
    },
)


class Solver:
    """A solver on a thread of its own, which moves its mesh as it is asked to."""

    def __init__(self, configuration=CONFIGURATION, step=0.002, count=3, **settings):
        self.points, self.cells = box(count)
        self.reference = self.points.copy()
        self.error = None
        self.heating = []
        self.stopped = False
        self.end = threading.Event()
        self.step = step
        self.rests_for = 0.0
        self.adaptor = tombolo.Adaptor(configuration, parameters={"heating": (1, 0, 10)}, **settings)
        self.link = self.adaptor.link
        self.thread = threading.Thread(target=self.solve, daemon=True)
        self.thread.start()

    def solve(self):
        try:
            temperature = np.zeros(len(self.points))
            faces = ends(self.points, self.cells)
            mesh = tombolo.Mesh(self.points, {"tetra": self.cells}, faces=faces)
            mesh.fields["material"] = np.arange(len(self.cells), dtype=np.int32)
            with self.adaptor:
                cycle = 0
                while not self.end.is_set():
                    temperature = self.reference[:, 2] + 0.01 * cycle
                    mesh.fields["temperature"] = temperature
                    steering = self.adaptor.execute(cycle, 0.1 * cycle, 0.1, {"solid": mesh})
                    if steering.stop:
                        self.stopped = True
                        break
                    if steering.motion is not None:
                        self.points[:] = steering.motion.coordinates
                    self.heating.append(steering.parameters["heating"])
                    self.rest()
                    cycle += 1
        except Exception as error:
            self.error = error

    def rest(self):
        """Rest until the next step; a rest may be made longer, or ended, while it is taken."""
        begun = time.monotonic()
        while (left := self.step - (time.monotonic() - begun)) > 0 and not self.end.is_set():
            self.rests_for = self.step
            time.sleep(min(left, 0.005))
        self.rests_for = 0.0

    def close(self):
        self.end.set()
        # It may have come to its end by itself.
        with contextlib.suppress(tombolo.CallError):
            self.adaptor.stop()
        self.thread.join(20)
        assert not self.thread.is_alive()
        if self.error is not None:
            raise self.error


class Relay:
    """Passes bytes on to the run of a link, swallows or refuses them when it is told to, until it is cut."""

    def __init__(self, link):
        self.port, self.pairs = int(link.split(":")[2].split("/")[0]), []
        self.server = socket.create_server(("127.0.0.1", 0))
        self.link = link.replace(f":{self.port}/", f":{self.server.getsockname()[1]}/")
        self.swallows = self.refuses = False
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        while True:
            try:
                client = self.server.accept()[0]
            except OSError:
                return
            if self.refuses:
                client.close()
                continue
            other = socket.create_connection(("127.0.0.1", self.port))
            self.pairs.append((client, other))
            for one, two in ((client, other), (other, client)):
                threading.Thread(target=self.copy, args=(one, two), daemon=True).start()

    def copy(self, one, two):
        try:
            while block := one.recv(65536):
                if not self.swallows:
                    two.sendall(block)
            two.shutdown(socket.SHUT_WR)
        except OSError:
            pass

    def cut(self):
        pairs, self.pairs = self.pairs, []
        for one in (one for pair in pairs for one in pair):
            # One that has ended by itself is not connected any more.
            with contextlib.suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
            one.close()


@pytest.fixture
def begin(tmp_path):
    """Begins solvers, which end with the test."""
    with contextlib.ExitStack() as ended:

        def make(*arguments, **settings):
            running = Solver(*arguments, output=tmp_path, **settings)
            ended.callback(running.close)
            return running

        yield make


@pytest.fixture
def solver(begin):
    """A solver under way, which ends with the test."""
    return begin()


@pytest.fixture
def run(solver):
    """A client of the solver that is under way."""
    with tombolo.connect(solver.link) as connected:
        yield connected


@pytest.fixture
def connections(monkeypatch):
    """The connections in the background: none is known before a test, and none is left behind it."""
    known = type(background._CONNECTIONS)()
    monkeypatch.setattr(background, "_CONNECTIONS", known)
    yield known
    for connection in list(known.values()):
        if connection.run is not None:
            connection.run.close()


def program(*arguments):
    """What the program `tombolo` of the package did."""
    command = [sys.executable, "-X", "dev", "-m", "tombolo", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def debian(*arguments, begin=(), folder=None):
    """What Debian's Python did, whose packages for MPI a virtual environment has not."""
    paths = [str(Path(tombolo.__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])]
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    ours = {"PYTHONPATH": ":".join(paths), "OMPI_MCA_rmaps_base_oversubscribe": "1"}
    cache = {} if folder is None else {"XDG_CACHE_HOME": str(folder)}
    environment = os.environ | allowed | ours | cache
    command = [*begin, "/usr/bin/python3", *map(str, arguments)]
    return subprocess.run(command, check=False, env=environment, capture_output=True, text=True, timeout=150)


def on_ranks(ranks, text, *arguments):
    """What a program over mpi4py did on so many ranks; more than one where this was built with MPI."""
    if not Path("/usr/bin/python3").exists() or debian("-c", "import mpi4py, numpy").returncode != 0:
        pytest.skip("there is no mpi4py: scripts/setup --distributed")
    if ranks > 1 and not tombolo.distributed:
        pytest.skip("built without MPI")
    begin = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    return debian("-c", text, *arguments, begin=begin)


def features_of_program(file):
    """The features that the program finds in a file: the name of each, its faces and its vertices."""
    done = program("features", "--mesh", file, "--json")
    assert done.returncode == 0, done.stderr
    return [(it["name"], it["faces"], it["vertices"]) for it in json.loads(done.stdout)["features"]]


def features_of(mesh):
    """The same of a mesh of this or another package."""
    return [(it["name"], it["faces"], it["vertices"]) for it in tombolo.Shaper(mesh).features]


def wait(found, seconds=60):
    """What is asked for again and again until it is there."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        answer = found()
        if answer:
            return answer
        time.sleep(0.02)
    raise TimeoutError("it did not come in time")


@pytest.fixture
def small_case(tmp_path):
    """Makes a case of the flow on a mesh of scripts/meshes."""

    def make(name, mesh, **changes):
        if not FLOW.exists():
            pytest.skip("the program flow is not built: cargo build -p tombolo-flow")
        pytest.importorskip("gmsh")
        command = [sys.executable, PROJECT / "scripts/meshes", mesh, "--out", tmp_path]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        cases = EXAMPLES / "flow/cases"
        case = json.loads((cases / f"{name}.json").read_text())
        case |= {"mesh": f"{mesh}.msh", "pipelines": str(cases / case["pipelines"]), **changes}
        file = tmp_path / f"{name}.json"
        file.write_text(json.dumps(case))
        return file

    return make


@pytest.fixture
def small_nozzle(small_case):
    """The case of the nozzle on a coarse mesh."""
    return small_case("nozzle", "channel-5k")
