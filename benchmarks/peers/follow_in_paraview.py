"""Follows a run in ParaView without an interface, as that does it: asks ten times a second what is new, and shows it.

    TOMBOLO_LINK=http://127.0.0.1:7070/?token=... pvpython benchmarks/peers/follow_in_paraview.py

A line `follow` or `leave` on standard input begins or ends the connection. Says the cycle of each step that it has
shown, and `left` behind a connection. Goes on until it is killed.
"""

import os
import sys
import threading
import time
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2] / "clients/paraview"))
import nozzle
from nozzle import cycle, servermanager
from tombolo import background

told = ["leave"]


def listen():
    """Keeps what it is told last."""
    # ParaView puts a text of its own in the place of sys.stdin.
    for line in sys.__stdin__:
        told[0] = line.strip()


threading.Thread(target=listen, daemon=True).start()
run = nozzle.TomboloRun(View="surface")
done, newest = None, -1
while True:
    if told[0] != done:
        done = told[0]
        run.Link = os.environ["TOMBOLO_LINK"] if done == "follow" else ""
        run.UpdatePipeline()
        if done == "leave":
            while background._CONNECTIONS:
                time.sleep(0.01)
            print("left", flush=True)
    run.SMProxy.InvokeCommand("Refresh")
    run.UpdatePipeline()
    now = cycle(servermanager.Fetch(run))
    if now > newest:
        newest = now
        print(newest, flush=True)
    time.sleep(0.1)
