"""Solvers that others wrote: an order is carried out, the physics is known, and the undo is exact."""

import importlib.util
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import EXAMPLES, FLOW, GALLERY, debian, load, study
from tombolo import _native


def commands(edit, schedule, begin, end):
    """An order at one cycle, and its undo at another."""
    return [
        {"at": {"cycle": begin}, "order": {"edits": [edit], "schedule": schedule}},
        {"at": {"cycle": end}, "order": {"undo": 1}},
    ]


def test_heat_with_scikit_fem(tmp_path):
    pytest.importorskip("skfem")
    heat = load("heat/python/heat_skfem.py")
    fluxes, points = {}, {}

    def seen(cycle, solver, conductivity):
        fluxes[cycle] = solver.flux(conductivity)
        points[cycle] = solver.mesh.p.copy()

    squeeze = {"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, -0.2]}}
    orders = commands(squeeze, {"steps": 5, "every": {"steps": 2}}, 30, 80)
    report = heat.run(130, cells=4, orders=orders, seen=seen, output=tmp_path)

    assert [order["status"] for order in report["orders"]] == ["applied", "applied"]
    # Fourier's law: conductivity times area over height.
    assert points[79][2].max() == pytest.approx(0.8, abs=1e-15)
    assert fluxes[29] == pytest.approx(1, abs=1e-4)
    assert fluxes[79] == pytest.approx(1 / 0.8, abs=1e-4)
    assert fluxes[129] == pytest.approx(1, abs=1e-4)
    assert np.array_equal(points[0], points[129])


def test_a_uniform_temperature_stays_so_on_a_mesh_that_moves():
    pytest.importorskip("skfem")
    heat = load("heat/python/heat_skfem.py")
    solver = heat.Heat(3)
    solver.temperature[:] = 7
    inside = solver.mesh.p.min(0) * (1 - solver.mesh.p.max(0)) > 0
    velocity = np.zeros((inside.size, 3))
    velocity[inside] = [0.3, -0.2, 0.1]
    solver.mesh = type(solver.mesh)(solver.mesh.p + 0.1 * velocity.T, solver.mesh.t)
    solver.step(0.1, 1.0, velocity)
    assert np.abs(solver.temperature - 7).max() < 1e-12


def test_a_flow_around_a_cylinder_with_ngsolve(tmp_path):
    pytest.importorskip("ngsolve")
    cylinder = load("ngsolve/cylinder.py")
    drags, points = {}, {}

    def seen(cycle, flow, at):
        drags[cycle] = flow.drag()
        points[cycle] = at.copy()

    held = ["inlet", "outlet", "wall"]
    thicker = {"scale_direction": {"features": ["cylinder"], "fixed": held, "factors": [1.3, 1, 1.3]}}
    orders = commands(thicker, {"steps": 3, "every": {"steps": 2}}, 12, 30)
    report = cylinder.run(48, size=0.14, orders=orders, seen=seen, output=tmp_path)

    assert [order["status"] for order in report["orders"]] == ["applied", "applied"], report["orders"]
    # A thicker cylinder takes more force; the old one takes the old force, on the old mesh to the bit.
    assert drags[29] > 1.3 * drags[11]
    assert drags[47] == pytest.approx(drags[11], rel=0.03)
    assert np.array_equal(points[0], points[47])
    assert not np.array_equal(points[0], points[29])


def test_a_loaded_bar_with_ngsolve(tmp_path):
    pytest.importorskip("ngsolve")
    elasticity = load("ngsolve/elasticity.py")
    lengthened, points = {}, {}

    def seen(cycle, bar, at):
        lengthened[cycle] = bar.at_end()[0]
        points[cycle] = at.copy()

    longer = {"translate": {"features": ["end"], "fixed": ["clamp"], "by": [0.5, 0, 0]}}
    orders = commands(longer, {"steps": 3, "every": {"steps": 2}}, 60, 130)
    # Without contraction across it, a bar that is pulled has the same stress everywhere.
    bar = {"size": 0.3, "poisson": 0.0, "load": (1e-3, 0, 0), "damping": 1.5}
    report = elasticity.run(200, orders=orders, seen=seen, output=tmp_path, **bar)

    assert [order["status"] for order in report["orders"]] == ["applied", "applied"], report["orders"]
    # Hooke's law: load times length over Young's modulus, whatever the section.
    assert points[129][:, 0].max() == pytest.approx(2.5, abs=1e-12)
    assert lengthened[59] == pytest.approx(2e-3, rel=1e-3)
    assert lengthened[129] == pytest.approx(2.5e-3, rel=1e-3)
    assert lengthened[199] == pytest.approx(2e-3, rel=1e-3)
    assert np.array_equal(points[0], points[199])


def test_a_throat_is_found_on_a_running_flow_and_with_restarts(small_nozzle):
    pytest.importorskip("scipy")
    throat = load("study/throat.py")
    flows = study.Flows(FLOW, small_nozzle, {}, throat.SCHEDULE, throat.CRITERION, timeout=300)
    found = study.compare(flows, throat.throat, study.reached(1.5, *throat.BOUNDS, tolerance=5e-3))

    assert found.values[0] == pytest.approx(found.values[1], abs=5e-3)
    for way in found.studies:
        assert way.answers[-1].result == pytest.approx(1.5 * found.running.reference, rel=0.02)
    # From a shape nearby the flow settles sooner than from rest.
    before, after = found.running.answers[-2:]
    assert abs(after.value - before.value) < 0.05
    assert after.steps < found.restarted.answers[-1].steps


def test_the_throat_for_a_flow_rate_is_found_on_a_running_flow_and_with_restarts(small_case):
    pytest.importorskip("scipy")
    flow_rate = load("study/flow_rate.py")
    case = small_case("nozzle-pressure", "channel-5k")
    flows = study.Flows(FLOW, case, {}, flow_rate.SCHEDULE, flow_rate.CRITERION, timeout=300, quantity=study.RATE)
    found = study.compare(flows, flow_rate.throat, study.reached(0.8, *flow_rate.BOUNDS, tolerance=5e-3))

    wanted = 0.8 * found.running.reference
    assert found.values[0] == pytest.approx(found.values[1], abs=1e-2)
    for way in found.studies:
        assert way.answers[-1].result == pytest.approx(wanted, rel=0.02)
        # The wider the throat, the more passes.
        rates = [answer.result for answer in sorted(way.answers)]
        assert rates[0] < wanted < rates[-1]
    # A fluid that flows already has less to be speeded up.
    assert found.running.mean < found.restarted.mean
    if importlib.util.find_spec("matplotlib"):
        study.plot(found, "height [of the reference's]", GALLERY / "study.png", wanted)


def test_a_widening_is_found_on_a_running_flow_and_with_restarts(small_case):
    pytest.importorskip("scipy")
    widening = load("study/widening.py")
    # At half the density the stream keeps to the wall between these areas: the widest regains most.
    density, speed, lower, upper = 500, 0.15625, 1.2, 2.0
    case = small_case("pipe", "pipe-4k", density=density, time_step=0.02)
    flows = study.Flows(FLOW, case, {}, 5, widening.CRITERION, timeout=300)
    found = study.compare(flows, widening.widening, study.least(lower, upper, tolerance=0.1))

    assert found.values[0] == pytest.approx(found.values[1], abs=0.01)
    assert upper - 0.1 < found.values[0] < upper
    for way in found.studies:
        answers = sorted(way.answers)
        drops = [answer.result for answer in answers]
        assert drops == sorted(drops, reverse=True)
        # Some of the pressure comes back, and no more than without friction: twice that of a flat profile.
        for area, drop, _ in answers:
            assert -density * speed**2 * (1 - 1 / area**2) < drop < found.running.reference
    for running, restarted in zip(found.running.answers, found.restarted.answers):
        assert running.result == pytest.approx(restarted.result, abs=5e-3 * found.running.reference)
    assert found.running.answers[-1].steps < found.restarted.answers[-1].steps


def test_an_angle_is_found_on_a_running_flow_and_with_restarts(small_case):
    pytest.importorskip("scipy")
    angle = load("study/angle.py")
    case = small_case("bypass", "bypass-8k")
    flows = study.Flows(FLOW, case, angle.VISCOSITY, angle.SCHEDULE, angle.CRITERION, timeout=300)
    found = study.compare(flows, angle.bend, study.least(-10, 10, tolerance=2))

    assert found.values[0] == pytest.approx(found.values[1], abs=3)
    least = [min(answer.result for answer in way.answers) for way in found.studies]
    assert least[0] == pytest.approx(least[1], rel=5e-4)
    for way, value, drop in zip(found.studies, found.values, least):
        # It lies between the bounds, and away from it the drop is more.
        assert -5 < value < 5
        far = [answer for answer in way.answers if abs(answer.value - value) > 4]
        assert far and all(answer.result > 1.0005 * drop for answer in far)
    assert found.running.mean < 0.9 * found.restarted.mean


@pytest.mark.parametrize("package", ["optuna", "cma"])
def test_a_search_by_sampling_finds_the_least_of_noisy_answers(package):
    pytest.importorskip(package)
    parser = study.arguments("a study", "case.json", 1e-3, 5, study.Criterion(10, 1e-3))
    study.bounds(parser, 1.0, 3.0, "the bounds")
    search = study.search(parser.parse_args(["--flow", "flow", "--trials", "60", "--by", package]))
    noise, asked = np.random.default_rng(1), []

    def ask(value):
        asked.append(value)
        return (value - 1.6) ** 2 + noise.normal(0, 0.01)

    assert search(ask, 0.0) == pytest.approx(1.6, abs=0.2)
    assert len(asked) == 60 and min(asked) >= 1 and max(asked) <= 3


def test_a_study_that_is_terminated_ends_its_flow(small_nozzle, tmp_path):
    pytest.importorskip("scipy")
    if not Path("/proc/self/task").exists():
        pytest.skip("there is no /proc to find the flow in")
    folder = tmp_path / "temporary"
    folder.mkdir()
    command = [sys.executable, EXAMPLES / "study/throat.py", "--flow", FLOW, "--case", small_nozzle]
    with subprocess.Popen(
        command, env=os.environ | {"TMPDIR": str(folder)}, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            end = time.monotonic() + 60
            while not list(folder.glob("*/tombolo-*.link")) and process.poll() is None and time.monotonic() < end:
                time.sleep(0.05)
            (flow,) = map(int, Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split())
            process.send_signal(signal.SIGTERM)
            _, said = process.communicate(timeout=60)
        finally:
            process.kill()
    is_left = Path(f"/proc/{flow}").exists()
    if is_left:
        os.kill(flow, signal.SIGKILL)
    assert not is_left
    assert process.returncode == 128 + signal.SIGTERM, said
    assert not list(folder.iterdir())


def test_heat_in_numpy_alone(tmp_path):
    heat = load("heat/python/heat_numpy.py")
    fluxes, points = {}, {}

    def seen(cycle, at, flux):
        fluxes[cycle] = flux
        points[cycle] = at.copy()

    squeeze = {"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, -0.2]}}
    orders = commands(squeeze, {"steps": 5, "every": {"steps": 20}}, 800, 1600)
    report = heat.run(2600, count=4, orders=orders, seen=seen, output=tmp_path)

    assert [order["status"] for order in report["orders"]] == ["applied", "applied"]
    # Fourier's law: conductivity times area over height.
    assert fluxes[799] == pytest.approx(1, abs=1e-3)
    assert fluxes[1599] == pytest.approx(1 / 0.8, abs=1e-3)
    assert fluxes[2599] == pytest.approx(1, abs=1e-3)
    assert np.array_equal(points[0], points[2599])

    # A finer mesh takes shorter steps.
    heat.run(150, count=16, seen=seen, output=tmp_path)
    assert 0 <= fluxes[149] <= 1


DOLFINX = """
import json, sys
sys.path.insert(0, sys.argv[1])
import heat_dolfinx, numpy
ranks = heat_dolfinx.MPI.COMM_WORLD
fluxes, points = {}, {}
def seen(cycle, heat):
    fluxes[cycle] = heat.flux()
    points[cycle] = heat.mesh.geometry.x.copy()
report = heat_dolfinx.run(110, cells=4, orders=json.loads(sys.argv[2]), seen=seen, output=sys.argv[3])
moved = ranks.allreduce(not numpy.array_equal(points[0], points[69]), heat_dolfinx.MPI.LOR)
restored = ranks.allreduce(numpy.array_equal(points[0], points[109]), heat_dolfinx.MPI.LAND)
if ranks.rank == 0:
    told = {"ranks": ranks.size, "moved": moved, "restored": restored, "fluxes": [fluxes[at] for at in (29, 69, 109)]}
    print("told", json.dumps(told | {"orders": [order["status"] for order in report["orders"]]}))
"""


@pytest.mark.parametrize("ranks", [1, 2, 3, 4] if _native.DISTRIBUTED else [1])
def test_heat_with_dolfinx_on_ranks(ranks, tmp_path):
    if not Path("/usr/bin/python3").exists() or debian("-c", "import dolfinx").returncode != 0:
        pytest.skip("there is no dolfinx: scripts/setup --distributed")
    squeeze = {"translate": {"features": ["top"], "fixed": ["bottom"], "by": [0, 0, -0.2]}}
    orders = json.dumps(commands(squeeze, {"steps": 5, "every": {"steps": 2}}, 30, 70))
    begin = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    said = debian("-c", DOLFINX, EXAMPLES / "heat/python", orders, tmp_path, begin=begin, folder=tmp_path)
    assert said.returncode == 0, said.stdout + said.stderr
    told = json.loads(next(line for line in said.stdout.splitlines() if line.startswith("told"))[5:])
    assert told["ranks"] == ranks
    assert told["orders"] == ["applied", "applied"]
    assert told["moved"] and told["restored"]
    assert told["fluxes"] == pytest.approx([1, 1 / 0.8, 1], abs=1e-4)
