"""Transient heat in a box, in NumPy alone, on a mesh that moves: linear tetrahedra, lumped mass, explicit steps.

python examples/heat/python/heat_numpy.py                # opens a server: follow the link that it prints
"""

import numpy as np
import tombolo

SURFACE = {"name": "surface", "every": {"steps": 10}, "stages": [{"surface": {}}, {"stream": {}}]}
PIPELINES = {"version": 1, "stream": {"listen": "127.0.0.1:0"}, "pipelines": [SURFACE]}
CUBE = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]]


def box(count):
    """The unit cube: points, tetrahedra, and the triangles of its top and bottom."""
    axis = np.linspace(0, 1, count + 1)
    points = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    numbers = np.arange(len(points)).reshape((count + 1,) * 3)
    ends = [slice(None, -1), slice(1, None)]
    corners = np.stack([numbers[ends[c & 1], ends[c >> 1 & 1], ends[c >> 2]].ravel() for c in range(8)], -1)
    tets = corners[:, CUBE].reshape(-1, 4)
    faces = tets[:, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]].reshape(-1, 3)
    named = {name: faces[(points[faces, 2] == height).all(1)] for name, height in (("bottom", 0), ("top", 1))}
    return points, tets, named


def geometry(points, tets):
    """The volume of each tetrahedron, and the gradients of its four hat functions."""
    edges = points[tets[:, 1:]] - points[tets[:, :1]]
    inverse = np.linalg.inv(edges).transpose(0, 2, 1)
    return np.linalg.det(edges) / 6, np.concatenate([-inverse.sum(1, keepdims=True), inverse], 1)


def run(steps, count=6, time_step=1e-3, orders=None, seen=lambda *_: None, output=None):
    """Takes the steps, and calls `seen(cycle, points, flux)` behind each; returns the report."""
    points, tets, faces = box(count)
    temperature = np.zeros(len(points))
    temperature[np.unique(faces["top"])] = 1
    held = np.unique(np.concatenate([faces["top"], faces["bottom"]]))
    mesh = tombolo.Mesh(points, {"tetra": tets}, {"temperature": temperature}, faces=faces)
    settings = {"parameters": {"conductivity": (1, 0.1, 2)}, "orders": orders, "output": output}
    with tombolo.Adaptor(PIPELINES, **settings) as adaptor:
        print(adaptor.invitation() or "no server", flush=True)
        for cycle in range(steps):
            steering = adaptor.execute(cycle, cycle * time_step, time_step, {"solid": mesh})
            if steering.stop:
                break
            velocity = np.zeros_like(points)
            if steering.motion is not None:
                points[:], velocity = steering.motion.coordinates, steering.motion.velocity
            volumes, gradients = geometry(points, tets)
            mass = np.bincount(tets.ravel(), np.repeat(volumes / 4, 4), len(points))
            conductivity = steering.parameters["conductivity"]
            # Explicit steps are stable up to a length that the smallest tetrahedron sets.
            parts = 1 + int(2 * conductivity * time_step * (gradients**2).sum((1, 2)).max())
            for _ in range(parts):
                slope = np.einsum("ti,tij->tj", temperature[tets], gradients)
                conducted = np.einsum("t,tj,tij->ti", conductivity * volumes, slope, gradients)
                # Vertices that move carry their values along: the ALE term.
                carried = np.einsum("t,tij,tj->ti", volumes / 4, velocity[tets], slope)
                rate = np.bincount(tets.ravel(), (carried - conducted).ravel(), len(points))
                flux = rate[np.unique(faces["bottom"])].sum()
                rate[held] = 0
                temperature += time_step / parts * rate / mass
            seen(cycle, points, flux)
    return adaptor.report


if __name__ == "__main__":
    run(100_000)
