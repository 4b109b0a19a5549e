"""Follows a run in ParaView without an interface, as that does it: asks ten times a second what is new, and shows it.

    TOMBOLO_LINK=http://127.0.0.1:7070/?token=... pvpython benchmarks/peers/follow_in_paraview.py

Goes on until it is killed, and says after each step that it has shown how many there were.
"""

import os
import sys
import time
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2] / "clients/paraview"))
import nozzle
from nozzle import cycle, servermanager

run = nozzle.TomboloRun(Link=os.environ["TOMBOLO_LINK"], View="surface")
shown, newest = 0, -1
while True:
    run.SMProxy.InvokeCommand("Refresh")
    run.UpdatePipeline()
    now = cycle(servermanager.Fetch(run))
    if now > newest:
        shown, newest = shown + 1, now
        print(shown, flush=True)
    time.sleep(0.1)
