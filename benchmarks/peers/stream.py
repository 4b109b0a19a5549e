"""What it takes to stream a surface that changes at each step from one process to another, by Tombolo or by Rerun.

    stream.py PEER TRIANGLES STEPS PAUSE CHANGE FOLDER

PEER is `tombolo`, `rerun` (the whole mesh is logged at each step) or `rerun-changes` (the triangles are logged once,
then what changes alone). A step begins PAUSE seconds after the last one, or at once where that took longer. CHANGE is
`values`, or `points`, which change beside them. Prints one JSON object.

Rerun's SDK has no client in Python that a live stream reaches. Its own program receives the stream and writes it to a
file in FOLDER, from which arrays are read once it is over.
"""

import json
import os
import socket
import statistics
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

#: Steps in which connections and buffers settle, and which do not count.
BEFORE = 10
#: Shapes and values that take turns, made before the first step.
STATES = 8


def surface(triangles, change):
    """A torus with waves on it: points, values and colours of each state, and the triangles."""
    rows = round((triangles / 2) ** 0.5)
    turn = np.linspace(0, 2 * np.pi, rows, endpoint=False)
    u, v = (angles.ravel() for angles in np.meshgrid(turn, turn, indexing="ij"))
    numbers = np.arange(rows * rows).reshape(rows, rows)
    right, up = np.roll(numbers, -1, 0), np.roll(numbers, -1, 1)
    across = np.roll(up, -1, 0)
    halves = [(numbers, right, across), (numbers, across, up)]
    cells = np.concatenate([np.stack([corner.ravel() for corner in half], -1) for half in halves])
    noise = np.random.default_rng(1)
    states = []
    for phase in np.linspace(0, 2 * np.pi, STATES, endpoint=False):
        # No row of vertices repeats another, and noise of a hundredth leaves less to compress.
        values = 0.7 * np.sin(3 * u + 2 * v + phase) + 0.3 * np.sin(5 * u - 7 * v - phase)
        values += 0.01 * noise.standard_normal(len(u))
        thick = 0.4 + (0.05 * np.sin(3 * u + 2 * v + phase) if change == "points" else 0)
        around = 1 + thick * np.cos(v)
        points = np.stack([around * np.cos(u), around * np.sin(u), thick * np.sin(v)], -1)
        part = np.clip((values + 1) / 2, 0, 1)
        colours = np.stack([part, np.full_like(part, 0.5), 1 - part, np.ones_like(part)], -1)
        states.append((points, values, np.round(255 * colours).astype(np.uint8)))
    return states, cells


def traffic():
    """Bytes of the TCP connections of this process: how many the others have got from it, and it from them."""
    sent = received = 0
    for name in os.listdir("/proc/self/fd"):
        try:
            with socket.socket(fileno=os.dup(int(name))) as connection:
                told = connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 136)
                counts = struct.unpack_from("2Q", told, 120)
        except OSError:
            continue  # It is no connection.
        sent, received = sent + counts[0], received + counts[1]
    return sent, received


def produce(show, steps, pause):
    """Shows steps: the moment of the first that counts, the seconds of each call, and those of the processors."""
    seconds = []
    for step in range(BEFORE + steps):
        begun = time.monotonic()
        if step == BEFORE:
            first, busy = begun, time.process_time()
        show(step)
        took = time.monotonic() - begun
        if step >= BEFORE:
            seconds.append(took)
        time.sleep(max(pause - took, 0))
    return first, seconds, time.process_time() - busy


def by_tombolo(states, cells, steps, pause, folder):
    import tombolo

    points, values, _ = states[0]
    mesh = tombolo.Mesh(points, {"triangle": cells}, {"value": values})
    pipelines = {
        "version": 1,
        "stream": {"listen": "127.0.0.1:0"},
        "steering": {"wait_for_viewer": True},
        "pipelines": [{"name": "surface", "every": {"steps": 1}, "stages": [{"surface": {}}, {"stream": {}}]}],
    }

    def show(step):
        mesh.points, mesh.fields["value"], _ = states[step % STATES]
        adaptor.execute(step, 0.01 * step, 0.01, {"surface": mesh})

    with tombolo.Adaptor(pipelines, output=folder) as adaptor:
        command = [sys.executable, __file__, "receive", adaptor.link, str(BEFORE + steps - 1)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as receiver:
            first, seconds, busy = produce(show, steps, pause)
            told = json.loads(receiver.communicate(timeout=120)[0])
    return seconds, {**told, "busy": busy, "last": told["last"] - first, "to_arrays": None}


def receive(link, end):
    """Counts the frames that reach a client of Tombolo, each of them arrays of NumPy, until that of the last step."""
    import tombolo

    frames = before = 0
    with tombolo.connect(link, watch=True) as run:
        for event in run.events("frame", timeout=60):
            view = event.data
            if view.cycle < BEFORE:
                before = traffic()[1]
                continue
            assert len(view.points) == len(view.fields["value"]) and len(view.triangles)
            frames += 1
            if view.cycle >= end:
                break
        last = time.monotonic()
        received = traffic()[1] - before
    print(json.dumps({"frames": frames, "last": last, "frame_bytes": received / frames}))


def by_rerun(states, cells, steps, pause, folder, moves, only_changes):
    import rerun
    import rerun_cli

    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    file = Path(folder, "stream.rrd")
    file.unlink(missing_ok=True)
    triangles = cells.astype(np.uint32)
    states = [(points.astype(np.float32), colours) for points, _, colours in states]
    # The program itself: the script of this name would leave it behind.
    program = Path(rerun_cli.__file__).with_name("rerun")
    command = [program, "--bind", "127.0.0.1", "--port", str(port), "--save", file]

    def show(step):
        points, colours = states[step % STATES]
        rerun.set_time("step", sequence=step)
        if step and only_changes:
            changed = {"vertex_positions": points} if moves else {}
            mesh = rerun.Mesh3D.from_fields(**changed, vertex_colors=colours)
        else:
            mesh = rerun.Mesh3D(vertex_positions=points, triangle_indices=triangles, vertex_colors=colours)
        rerun.log("surface", mesh)

    # In a folder of its own it sends nobody anything of its first session.
    environment = {**os.environ, "XDG_CONFIG_HOME": folder}
    with subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL) as receiver:
        try:
            wait_for(port)
            rerun.init("tombolo_benchmark")
            rerun.connect_grpc(f"rerun+http://127.0.0.1:{port}/proxy")
            first, seconds, busy = produce(show, steps, pause)
            rerun.get_global_data_recording().flush(timeout_sec=60)
            sent = traffic()[0]
            # The last frame was written when the file grew last.
            while time.time() - file.stat().st_mtime < 1:
                time.sleep(0.1)
            last = time.monotonic() - (time.time() - file.stat().st_mtime)
            rerun.disconnect()
        finally:
            receiver.terminate()
    begun = time.monotonic()
    frames = frames_of(file)
    to_arrays = (time.monotonic() - begun) / frames
    told = {"frames": frames - BEFORE, "last": last - first, "busy": busy}
    return seconds, {**told, "frame_bytes": sent / frames, "to_arrays": to_arrays}


def wait_for(port):
    """Waits until a program listens."""
    for _ in range(200):
        try:
            socket.create_connection(("127.0.0.1", port)).close()
            return
        except OSError:
            time.sleep(0.1)
    raise TimeoutError("Rerun's program does not listen")


def frames_of(file):
    """Makes arrays of NumPy of all that was logged, and counts the frames."""
    from rerun.chunk import RrdReader

    frames = 0
    for chunk in RrdReader(file).stream():
        if chunk.entity_path != "/surface":
            continue
        columns = chunk.to_record_batch()
        for name in columns.schema.names:
            if name.startswith("Mesh3D:"):
                numbers = columns[name]
                while hasattr(numbers, "flatten"):  # A list of lists.
                    numbers = numbers.flatten()
                assert len(numbers.to_numpy())
        frames += chunk.num_rows
    return frames


def main():
    peer, triangles, steps, pause, change, folder = sys.argv[1:]
    states, cells = surface(int(triangles), change)
    given = (states, cells, int(steps), float(pause), folder)
    if peer == "tombolo":
        seconds, told = by_tombolo(*given)
    else:
        seconds, told = by_rerun(*given, change == "points", peer == "rerun-changes")
    print(
        json.dumps(
            {
                "triangles": len(cells),
                "steps": len(seconds),
                "seconds": statistics.median(seconds),
                "busy": told["busy"] / len(seconds),
                "arrived": told["frames"],
                "frames_a_second": told["frames"] / told["last"],
                "frame_bytes": told["frame_bytes"],
                "to_arrays": told["to_arrays"],
            }
        )
    )


if __name__ == "__main__":
    if sys.argv[1] == "receive":
        receive(sys.argv[2], int(sys.argv[3]))
    else:
        main()
