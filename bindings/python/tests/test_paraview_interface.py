"""ParaView with its interface, on a screen in memory: it steers a running nozzle, and follows it by itself."""

import contextlib
import ctypes
import os
import shutil
import subprocess
import time

import numpy as np
import pytest
import tombolo
from conftest import FLOW, GALLERY, study, wait
from test_paraview import SURFACE, check_shown, paraview

SCREEN = (1152, 768)
#: Where the buttons of *Tombolo Order* are on it, below its properties.
BUTTONS = {"Forecast": (138, 635), "Give": (138, 664), "Undo": (138, 693)}
SCRIPT = """
import os
from pathlib import Path
from paraview import servermanager, simple
from nozzle import *

link, out = os.environ["TOMBOLO_LINK"], Path(os.environ["OUT"])
with open(out / "told.txt", "w") as file:
    steer(link, "surface", 200, out, lambda text: print(text, file=file))
for source in reversed(list(simple.GetSources().values())):
    simple.Delete(source)


def tell(*_):
    cycle = servermanager.Fetch(run).GetFieldData().GetArray("cycle")
    with open(out / "cycles.txt", "a") as file:
        print(int(cycle.GetValue(0)), file=file)


view = simple.GetActiveViewOrCreate("RenderView")
run = TomboloRun(Link=link, View="surface")
surface = TomboloSurface(Link=link)
while True:
    surface.SMProxy.InvokeCommand("Refresh")
    run.SMProxy.InvokeCommand("Refresh")
    surface.UpdatePipeline()
    run.UpdatePipeline()
    if servermanager.Fetch(surface).GetNumberOfPoints() and servermanager.Fetch(run).GetNumberOfPoints():
        break
display = simple.Show(run, view, "GeometryRepresentation")
display.Representation = "Surface With Edges"
simple.ColorBy(display, ("POINTS", "pressure"))
pinched = TomboloScaleDirection(Input=surface, Features="throat", Fixed="inlet, outlet", Factors=[1, 1, 0.5])
order = TomboloOrder(Input=pinched, Link=link, Steps=10, Every=2)
simple.Hide(surface, view)
order.SMProxy.InvokeCommand("Give")
order.UpdatePipeline()
run.SMProxy.AddObserver("UpdateDataEvent", tell)


def write_table(*_):
    rows = servermanager.Fetch(order).GetRowData()
    columns = [rows.GetAbstractArray(column) for column in range(rows.GetNumberOfArrays())]
    lines = [[column.GetVariantValue(row).ToString() for column in columns] for row in range(rows.GetNumberOfTuples())]
    (out / "table.txt").write_text(os.linesep.join(": ".join(line) for line in lines))


order.SMProxy.AddObserver("UpdateDataEvent", write_table)
# A table is kept up to date where it is shown.
layout = simple.GetLayout(view)
layout.SplitViewVertical(view, 0.65)
sheet = simple.CreateView("SpreadSheetView")
simple.AssignViewToLayout(sheet, layout)
simple.Show(order, sheet)
simple.Render(sheet)
simple.SetActiveView(view)
view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = [2.1, 0, 0.25], [0, 0, 0], [0, 0, 1]
view.ResetCamera()
simple.GetActiveCamera().Zoom(2.4)
simple.Render()
simple.SetActiveSource(order)
"""


def picture(file):
    """What a screen of Xvfb shows, whose memory is a file in the format of `xwd`."""
    data = file.read_bytes()
    words = np.frombuffer(data, ">u4", 25)
    start, width, height, line, colors = (int(words[index]) for index in (0, 4, 5, 12, 19))
    rows = np.frombuffer(data, np.uint8, line * height, start + 12 * colors).reshape(height, line)
    return rows[:, : 4 * width].reshape(height, width, 4)[:, :, 2::-1]


@pytest.fixture
def screen(tmp_path):
    """A screen in memory: its name, and the file that it is."""
    if not shutil.which("Xvfb"):
        pytest.skip("there is no Xvfb: scripts/setup --distributed")
    folder = tmp_path / "screen"
    folder.mkdir()
    read, write = os.pipe()
    # It takes a number that is free, and tells it.
    size = "x".join(map(str, SCREEN))
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", f"{size}x24", "-fbdir", folder, "-nolisten", "tcp"]
    with subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL) as server:
        os.close(write)
        try:
            with os.fdopen(read) as told:
                yield f":{told.readline().strip()}", folder / "Xvfb_screen0"
        finally:
            server.terminate()


def press(display, button):
    """Presses a button with the mouse."""
    x11, xtest = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
    x11.XOpenDisplay.restype = ctypes.c_void_p
    screen = ctypes.c_void_p(x11.XOpenDisplay(display.encode()))
    try:
        xtest.XTestFakeMotionEvent(screen, -1, *BUTTONS[button], ctypes.c_ulong(0))
        x11.XSync(screen, 0)
        # Something that is pointed at lights up first.
        time.sleep(0.3)
        for is_down in (1, 0):
            xtest.XTestFakeButtonEvent(screen, 1, is_down, ctypes.c_ulong(0))
        x11.XSync(screen, 0)
    finally:
        x11.XCloseDisplay(screen)


@contextlib.contextmanager
def interface(script, display, folder, **variables):
    """ParaView with its interface runs a script; it is ended behind the block."""
    program, environment = paraview("paraview")
    environment |= {"HOME": str(folder), "XDG_RUNTIME_DIR": str(folder), "DISPLAY": display, **variables}
    # It would greet its user before all else.
    release = subprocess.run([program, "--version"], env=environment, capture_output=True, text=True, check=True)
    settings = folder / f".config/ParaView/ParaView{release.stdout.split()[-1]}.ini"
    settings.parent.mkdir(parents=True)
    settings.write_text("[General]\nGeneralSettings.ShowWelcomeDialog=false\n")
    (folder / "script.py").write_text(script)
    command = [program, f"--script={folder / 'script.py'}"]
    with (
        open(folder / "said.txt", "w") as said,
        subprocess.Popen(command, env=environment, stdout=said, stderr=said) as process,
    ):
        try:
            yield process
        finally:
            process.kill()


def test_the_interface_steers_a_run_and_follows_it(small_nozzle, screen, tmp_path):
    image = pytest.importorskip("PIL.Image")
    display, memory = screen
    shown, home = tmp_path / "cycles.txt", tmp_path / "home"
    home.mkdir(0o700)

    def cycles():
        lines = shown.read_text().splitlines() if shown.exists() else []
        return [int(line) for line in lines]

    pipelines = study.configuration(SURFACE, study.SHAPE)
    with (
        study.begun(FLOW, small_nozzle, pipelines, [], tmp_path) as link,
        tombolo.connect(link) as run,
        interface(SCRIPT, display, home, TOMBOLO_LINK=str(link), OUT=str(tmp_path)) as process,
    ):
        said = home / "said.txt"
        wait(lambda: process.poll() is not None or "Traceback" in said.read_text() or cycles(), 180)
        assert process.poll() is None and cycles(), said.read_text()
        # The last order is given in ParaView, and its script has ended: the interface asks for what is new.
        wait(lambda: [order.status for order in run.orders] == 7 * ["applied"], 120)
        applied = run.orders[-1].cycle_applied + 20
        wait(lambda: cycles()[-1] > applied + 50, 120)
        # What is fetched is drawn a moment later.
        time.sleep(1)
        pixels = picture(memory)
        # A person has the mouse.
        table = tmp_path / "table.txt"
        press(display, "Forecast")
        wait(lambda: table.exists() and "forecast: applied" in table.read_text(), 60)
        for button, edits in (("Undo", 0), ("Give", 1), ("Undo", 0)):
            count = len(run.orders)
            press(display, button)
            wait(lambda count=count: len(run.orders) > count and run.orders[-1].status == "applied", 60)
            assert run.edit_count == edits, button
    assert np.all(np.diff(cycles()) >= 0)
    told = (tmp_path / "told.txt").read_text()
    assert [told.count(f"{what}: applied") for what in ("forecast", "order", "undo")] == [3, 3, 3], told
    check_shown(tmp_path)

    view = pixels[205:525, 310:1140].astype(int)
    red = (view[..., 0] > view[..., 2] + 30).any(axis=0)
    drawn = np.abs(view - view[0, 0]).max(axis=-1) > 40
    heights = drawn.sum(axis=0)
    # High at its inlet, which is red, and half as high in its middle.
    assert red[: len(red) // 3].any()
    assert heights[len(heights) // 2] < 0.75 * heights.max()
    image.fromarray(pixels).save(GALLERY / "paraview.png")
