"""Transient heat in a box with scikit-fem, on a mesh that moves.

    python examples/heat/python/heat_skfem.py                # opens a server: follow the link that it prints
    python examples/heat/python/heat_skfem.py --steps 100 --orders ORDERS.json

The bottom is held at 0 and the top at 1. In the end the flux through the box is `conductivity * area / height`.

scikit-fem keeps what it has computed of a mesh: a change of `mesh.p` in place goes unnoticed, so that a mesh that
moves is a new one.
"""

import argparse
import json
from pathlib import Path

import numpy as np
import tombolo
from skfem import Basis, BilinearForm, ElementTetP1, ElementVector, FacetBasis, Functional, MeshTet, condense, solve
from skfem.helpers import dot, grad

PIPELINES = {
    "version": 1,
    "stream": {"listen": "127.0.0.1:0"},
    "pipelines": [
        {"name": "surface", "every": {"steps": 1}, "stages": [{"surface": {}}, {"stream": {}}]},
        {"name": "heat", "every": {"steps": 1}, "stages": [{"statistics": {"field": "temperature"}}]},
    ],
}


@BilinearForm
def mass(u, v, _):
    """The heat in the box."""
    return u * v


@BilinearForm
def stiffness(u, v, _):
    """Conduction, for a conductivity of 1."""
    return dot(grad(u), grad(v))


@BilinearForm
def carried(u, v, w):
    """The ALE term: vertices that move carry their values along."""
    return dot(w["mesh_velocity"], grad(u)) * v


@Functional
def outward_flux(w):
    """The heat that leaves through a boundary, for a conductivity of 1."""
    return -dot(w.n, grad(w["temperature"]))


class Heat:
    """The state of the solver: a mesh and a temperature at each of its vertices."""

    def __init__(self, cells):
        axis = np.linspace(0, 1, cells + 1)
        # Tombolo wants the vertices of all cells the same way round; scikit-fem does not care.
        self.mesh = MeshTet.init_tensor(axis, axis, axis).oriented()
        self.temperature = np.zeros(self.mesh.p.shape[1])
        # Found once: by their numbers they stay what they are, wherever the mesh moves.
        self.top = self.mesh.facets_satisfying(lambda x: x[2] == 1, boundaries_only=True)
        self.bottom = self.mesh.facets_satisfying(lambda x: x[2] == 0, boundaries_only=True)
        self.held = np.unique(self.mesh.facets[:, np.concatenate([self.top, self.bottom])])
        self.temperature[np.unique(self.mesh.facets[:, self.top])] = 1

    def step(self, time_step, conductivity, velocity=None):
        """One step of backward Euler on the mesh as it is at the step's end."""
        basis = Basis(self.mesh, ElementTetP1())
        matrix = mass.assemble(basis) / time_step
        load = matrix @ self.temperature
        matrix = matrix + conductivity * stiffness.assemble(basis)
        if velocity is not None:
            vector = basis.with_element(ElementVector(ElementTetP1()))
            matrix = matrix - carried.assemble(basis, mesh_velocity=vector.interpolate(velocity.ravel()))
        self.temperature[:] = solve(*condense(matrix, load, x=self.temperature, D=self.held))

    def flux(self, conductivity):
        """The heat that leaves through the bottom in a unit of time."""
        facets = FacetBasis(self.mesh, ElementTetP1(), facets=self.bottom)
        return conductivity * outward_flux.assemble(facets, temperature=facets.interpolate(self.temperature))


def run(steps, cells=6, time_step=0.05, orders=None, seen=None, output=None):
    """Takes the steps, and calls `seen(cycle, heat, conductivity)` behind each; returns the report."""
    heat = Heat(cells)
    facets = heat.mesh.facets
    lent = tombolo.Mesh(
        heat.mesh.p.T,  # (vertices, 3), borrowed as it lies
        {"tetra": heat.mesh.t.T},  # borrowed as it lies
        {"temperature": heat.temperature},
        faces={"top": facets[:, heat.top].T, "bottom": facets[:, heat.bottom].T},
    )
    with tombolo.Adaptor(PIPELINES, parameters={"conductivity": (1, 0.1, 10)}, orders=orders, output=output) as adaptor:
        print("heat: open", adaptor.link, flush=True)
        for cycle in range(steps):
            steering = adaptor.execute(cycle, time_step * cycle, time_step, {"solid": lent})
            if steering.stop:
                break
            velocity = None
            if steering.motion is not None:
                heat.mesh = MeshTet(np.ascontiguousarray(steering.motion.coordinates.T), heat.mesh.t)
                lent.points = heat.mesh.p.T
                velocity = steering.motion.velocity
            heat.step(time_step, steering.parameters["conductivity"], velocity)
            if seen is not None:
                seen(cycle, heat, steering.parameters["conductivity"])
    return adaptor.report


def main():
    """The program."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--steps", type=int, default=1_000_000)
    arguments.add_argument("--cells", type=int, default=6, help="along each axis")
    arguments.add_argument("--orders", type=Path, help="a file of orders known beforehand")
    given = arguments.parse_args()

    def seen(cycle, heat, conductivity):
        if cycle % 10 == 0:
            print(f"cycle {cycle}: flux {heat.flux(conductivity):.6f}", flush=True)

    orders = json.loads(given.orders.read_text()) if given.orders else None
    run(given.steps, given.cells, orders=orders, seen=seen)


if __name__ == "__main__":
    main()
