"""What the adaptor costs a solver in Python at steps at which nothing is due, and the memory that lending a mesh takes.

    python.py CUBES CALLS FILE

Shows a box of CUBES cubed cubes, of six tetrahedra each, with the configuration in FILE. Prints one JSON object.
"""

import gc
import json
import statistics
import sys
import time

import numpy as np
import tombolo


def resident():
    """Bytes of memory that this process has, and the most that it had."""
    with open("/proc/self/status") as status:
        found = dict(line.split(":", 1) for line in status)
    return tuple(1024 * int(found[name].split()[0]) for name in ("VmRSS", "VmHWM"))


def box(count):
    axis = np.linspace(0, 1, count + 1)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    numbers = np.arange((count + 1) ** 3, dtype=np.int32).reshape((count + 1,) * 3)

    def corner(i, j, k):
        return numbers[i : count + i, j : count + j, k : count + k].ravel()

    tets = []
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (1, 0, 2), (2, 1, 0)):
        at = np.zeros((4, 3), int)
        for row, axis_of_step in enumerate((a, b, c), 1):
            at[row:, axis_of_step] = 1
        rows = at if (a, b, c) in ((0, 1, 2), (1, 2, 0), (2, 0, 1)) else at[[0, 2, 1, 3]]
        tets.append(np.stack([corner(*row) for row in rows], -1))
    return points, np.concatenate(tets)


def main():
    cubes, calls = int(sys.argv[1]), int(sys.argv[2])
    points, tets = box(cubes)
    velocity, pressure = np.zeros_like(points), np.zeros(len(points))
    mesh = tombolo.Mesh(points, {"tetra": tets}, {"velocity": velocity, "pressure": pressure})
    channels = {"fluid": mesh}
    gc.collect()
    before, peak = resident()
    with tombolo.Adaptor(sys.argv[3]) as adaptor:
        adaptor.execute(0, 0.0, 1e-3, channels)
        lent, lent_peak = resident()
        seconds = []
        for cycle in range(1, calls):
            begun = time.perf_counter()
            adaptor.execute(cycle, 1e-3 * cycle, 1e-3, channels)
            seconds.append(time.perf_counter() - begun)
    print(
        json.dumps(
            {
                "tets": len(tets),
                "seconds": statistics.median(seconds),
                "p95": sorted(seconds)[int(0.95 * len(seconds))],
                "added_bytes": lent - before,
                "peak_bytes": lent_peak - max(peak, before),
                "mesh_bytes": sum(array.nbytes for array in (points, tets, velocity, pressure)),
            }
        )
    )


main()
