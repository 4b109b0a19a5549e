"""The plug-in of ParaView, in ParaView's own Python."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import tombolo
from conftest import FLOW, ends, study

CLIENT = Path(__file__).parents[3] / "clients/paraview"
SURFACE = {
    "name": "surface",
    "every": {"steps": 10},
    "stages": [
        {"surface": {}},
        {"select": {"fields": ["velocity", "pressure"]}},
        {"write": {"file": "surface-{cycle}.vtp"}},
        {"stream": {"error": {"relative": 1e-3}}},
    ],
}


def pvpython(*arguments):
    """What ParaView's Python says to a script."""
    program = os.environ.get("TOMBOLO_PVPYTHON") or shutil.which("pvpython")
    if program is None:
        pytest.skip("there is no pvpython: Debian's python3-paraview does not go with the python3-vtk9 of other tests")
    package = Path(tombolo.__file__).parents[1]
    environment = os.environ | {"PYTHONPATH": f"{package}:{CLIENT / 'debian'}"}
    command = [program, *map(str, arguments)]
    said = subprocess.run(command, check=False, env=environment, capture_output=True, text=True, timeout=120)
    assert said.returncode == 0, said.stdout + said.stderr
    return said.stdout + said.stderr


EACH = """
import sys, time
from paraview import servermanager, simple
simple.LoadPlugin(sys.argv[1], ns=globals())
surface = TomboloSurface(Link=sys.argv[2])
for _ in range(300):
    surface.SMProxy.InvokeCommand("Refresh")
    surface.UpdatePipeline()
    if servermanager.Fetch(surface).GetNumberOfPoints():
        break
    time.sleep(0.05)
ends = {"Features": "top", "Fixed": "bottom"}
shown = {
    "translate": TomboloTranslate(Input=surface, By=[0.1, 0, 0.2], **ends),
    "rotate": TomboloRotate(Input=surface, Axis=[0, 0, 1], Degrees=20, HarmonicOrder=1, **ends),
    "scale_direction": TomboloScaleDirection(Input=surface, Factors=[0.5, 1, 1], **ends),
    "scale_normals": TomboloScaleNormals(Input=surface, Distance=0.1, **ends),
}
shown["two"] = TomboloTranslate(Input=shown["rotate"], By=[0, 0, 0.1], **ends)
shown["sum"] = TomboloCombineDisplacements(First=shown["translate"], Second=shown["rotate"], Weights=[1, 0.5])
shown["angle"] = TomboloFeaturesByAngle(Input=surface, Angle=40)
shown["curve"] = TomboloSkeleton(Input=surface)
for name, proxy in shown.items():
    proxy.UpdatePipeline()
    simple.SaveData(f"{sys.argv[3]}/{name}.vtp", proxy=proxy)
written = TomboloExportDisplacement(Input=shown["two"], FileName=f"{sys.argv[3]}/two.txt")
written.UpdatePipeline()
written.SMProxy.InvokeCommand("Write")
TomboloTranslate(Input=surface, Features="tpo", By=[0, 0, 1]).UpdatePipeline()
TomboloDragSkeleton(Input=surface, Fixed="bottom", At=[0.5, 0.5, 0.5], To=[0.6, 0.5, 0.5]).UpdatePipeline()
"""


def test_each_filter_moves_the_surface_as_the_kernel_does(solver, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    (tmp_path / "each.py").write_text(EACH)
    said = pvpython(tmp_path / "each.py", CLIENT / "tombolo_paraview.py", solver.link, tmp_path)
    assert "tpo" in said, said
    # A cube has no curve in its middle.
    assert "no node that can be dragged" in said, said

    shaper = tombolo.Shaper(solver.reference, {"tetra": solver.cells}, ends(solver.reference, solver.cells))
    handle = {"features": ["top"], "fixed": ["bottom"]}
    turned = {"rotate": {**handle, "axis": [0, 0, 1], "degrees": 20, "harmonic_order": 1}}
    expected = {
        "translate": shaper.displacement([{"translate": {**handle, "by": [0.1, 0, 0.2]}}]),
        "rotate": shaper.displacement([turned]),
        "scale_direction": shaper.displacement([{"scale_direction": {**handle, "factors": [0.5, 1, 1]}}]),
        "scale_normals": shaper.displacement([{"scale_normals": {**handle, "distance": 0.1}}]),
        "two": shaper.displacement([turned, {"translate": {**handle, "by": [0, 0, 0.1]}}]),
    }
    expected["sum"] = expected["translate"] + 0.5 * expected["rotate"]
    for name, moved in expected.items():
        assert np.array_equal(pyvista.read(tmp_path / f"{name}.vtp").point_data["displacement"], moved), name
    written = shaper.displacement([{"displacement": {"file": str(tmp_path / "two.txt")}}])
    assert np.array_equal(written, expected["two"])
    assert len(set(pyvista.read(tmp_path / "angle.vtp").cell_data["features"])) == 6
    assert pyvista.read(tmp_path / "curve.vtp").point_data["radius"].min() > 0


def triangles(rows):
    """Each triangle from its least vertex on."""
    return {tuple(np.roll(row, -np.argmin(row)).tolist()) for row in rows}


def test_a_running_nozzle_is_followed_and_steered_by_the_plug_in(small_nozzle, tmp_path):
    pyvista, spatial = pytest.importorskip("pyvista"), pytest.importorskip("scipy.spatial")
    pipelines = study.configuration(SURFACE, study.SHAPE)
    with study.begun(FLOW, small_nozzle, pipelines, [], tmp_path) as link:
        said = pvpython(CLIENT / "nozzle.py", link, "--out", tmp_path)
    assert said.count("forecast: applied") == 3, said
    assert said.count("order: applied") == 3, said
    assert said.count("undo: applied") == 3, said

    shown = sorted(tmp_path.glob("shown-*.vtp"), key=lambda file: int(file.stem[6:]))
    assert len(shown) == 6
    heights = []
    for file in shown:
        frame, written = pyvista.read(file), pyvista.read(tmp_path / f"surface-{int(file.stem[6:]):06}.vtp")
        # The codec has an order of its own: points and triangles are found by where they are.
        size = np.linalg.norm(np.ptp(written.points, axis=0))
        distances, found = spatial.cKDTree(written.points).query(frame.points)
        assert distances.max() < 1e-5 * size
        assert len(set(found)) == written.n_points == frame.n_points
        assert triangles(found[frame.regular_faces]) == triangles(written.regular_faces)
        for name in ("velocity", "pressure"):
            values = written.point_data[name][found]
            assert np.abs(frame.point_data[name] - values).max() <= 1.001e-3 * np.ptp(values)
        middle = np.abs(written.points[:, 1]) < 0.05
        heights.append(np.ptp(written.points[middle, 2]))
    assert heights == pytest.approx([0.05, 0.1, 0.05, 0.1, 0.05, 0.1], rel=0.02)
