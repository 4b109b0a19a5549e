"""The plug-in of ParaView, in ParaView's own Python."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import tombolo
from conftest import FLOW, load

CLIENT = Path(__file__).parents[3] / "clients/paraview"
PIPELINES = {
    "version": 1,
    "stream": {"listen": "127.0.0.1:0"},
    "pipelines": [
        {
            "name": "surface",
            "every": {"steps": 10},
            "stages": [
                {"surface": {}},
                {"select": {"fields": ["velocity", "pressure"]}},
                {"write": {"file": "surface-{cycle}.vtp"}},
                {"stream": {"error": {"relative": 1e-3}}},
            ],
        },
        {"name": "shape", "on": "order", "stages": [{"deform": {}}, {"guard": {"min_scaled_jacobian": 0.02}}]},
    ],
}


def triangles(rows):
    """Each triangle from its least vertex on."""
    return {tuple(np.roll(row, -np.argmin(row)).tolist()) for row in rows}


def test_a_running_nozzle_is_followed_and_steered_by_the_plug_in(small_nozzle, tmp_path):
    program = os.environ.get("TOMBOLO_PVPYTHON") or shutil.which("pvpython")
    if program is None:
        pytest.skip("there is no pvpython: Debian's python3-paraview does not go with the python3-vtk9 of other tests")
    pyvista, spatial = pytest.importorskip("pyvista"), pytest.importorskip("scipy.spatial")
    throat = load("study/throat.py")
    package = Path(tombolo.__file__).parents[1]
    environment = os.environ | {"PYTHONPATH": f"{package}:{CLIENT / 'debian'}"}
    with throat.begun(FLOW, small_nozzle, PIPELINES, [], tmp_path) as link:
        command = [program, CLIENT / "nozzle.py", link, "--out", tmp_path]
        said = subprocess.run(command, check=False, env=environment, capture_output=True, text=True, timeout=120)
    assert said.returncode == 0, said.stdout + said.stderr
    assert said.stdout.count("forecast: applied") == 3, said.stdout
    assert said.stdout.count("order: applied") == 3, said.stdout
    assert said.stdout.count("undo: applied") == 3, said.stdout

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
