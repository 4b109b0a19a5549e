"""Transient heat in a box with dolfinx 0.5 (Debian's python3-dolfinx) on any number of ranks, on a mesh that moves.

    python3 examples/heat/python/heat_dolfinx.py             # opens a server: follow the link that it prints
    mpirun -n 4 python3 examples/heat/python/heat_dolfinx.py --steps 100 --orders ORDERS.json

The bottom is held at 0 and the top at 1. In the end the flux through the box is `conductivity * area / height`. Several
ranks need the package built with `--features distributed`.

A rank's `mesh.geometry.x` has the vertices that it owns and, behind them, copies of those of its neighbours. Both are
lent, and both are written: who writes only the first has a mesh that is torn where the ranks meet.
"""

import argparse
import json
from pathlib import Path

import dolfinx
import numpy as np
import tombolo
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

PIPELINES = {
    "version": 1,
    "stream": {"listen": "127.0.0.1:0"},
    "pipelines": [{"name": "surface", "every": {"steps": 1}, "stages": [{"surface": {}}, {"stream": {}}]}],
}


class Heat:
    """The state of the solver on this rank."""

    def __init__(self, cells, time_step, communicator):
        self.communicator = communicator
        ghosts = dolfinx.cpp.mesh.GhostMode.none
        self.mesh = dolfinx.mesh.create_unit_cube(communicator, cells, cells, cells, ghost_mode=ghosts)
        space = fem.FunctionSpace(self.mesh, ("CG", 1))
        self.temperature = fem.Function(space)
        self.velocity = fem.Function(fem.VectorFunctionSpace(self.mesh, ("CG", 1)))
        self.conductivity = fem.Constant(self.mesh, PETSc.ScalarType(1))

        # dolfinx numbers points, unknowns and vertices each by itself.
        topology = self.mesh.topology
        self.tets = self.mesh.geometry.dofmap.array.reshape(-1, 4)
        self.unknowns = np.empty(len(self.mesh.geometry.x), np.int32)
        self.unknowns[self.tets] = space.dofmap.list.array.reshape(-1, 4)
        points = np.empty_like(self.unknowns)
        points[topology.connectivity(3, 0).array.reshape(-1, 4)] = self.tets

        self.faces, self.held, tags = {}, [], []
        for number, (name, height) in enumerate({"bottom": 0, "top": 1}.items()):
            facets = dolfinx.mesh.locate_entities_boundary(self.mesh, 2, lambda x, z=height: np.isclose(x[2], z))
            self.faces[name] = points[topology.connectivity(2, 0).array.reshape(-1, 3)[facets]]
            unknowns = fem.locate_dofs_topological(space, 2, facets)
            self.held.append(fem.dirichletbc(PETSc.ScalarType(height), unknowns, space))
            tags.append(np.stack([facets, np.full_like(facets, number)]))
        facets, numbers = np.concatenate(tags, 1)
        order = np.argsort(facets)
        marked = dolfinx.mesh.meshtags(self.mesh, 2, facets[order], numbers[order])
        bottom = ufl.Measure("ds", self.mesh, subdomain_data=marked)(0)

        u, v, normal = ufl.TrialFunction(space), ufl.TestFunction(space), ufl.FacetNormal(self.mesh)
        conducted = self.conductivity * ufl.dot(ufl.grad(u), ufl.grad(v))
        # The ALE term: vertices that move carry their values along.
        carried = ufl.dot(self.velocity, ufl.grad(u)) * v
        self.left = fem.form((u * v / time_step + conducted - carried) * ufl.dx)
        self.right = fem.form(self.temperature * v / time_step * ufl.dx)
        self.leaving = fem.form(-self.conductivity * ufl.dot(ufl.grad(self.temperature), normal) * bottom)
        self.solver = PETSc.KSP().create(communicator)
        self.solver.setType("gmres")
        self.solver.getPC().setType("bjacobi")
        self.solver.setTolerances(rtol=1e-12)

    def step(self):
        """One step of backward Euler on the mesh as it is at the step's end."""
        matrix = fem.petsc.assemble_matrix(self.left, self.held)
        matrix.assemble()
        load = fem.petsc.assemble_vector(self.right)
        fem.petsc.apply_lifting(load, [self.left], [self.held])
        load.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        fem.petsc.set_bc(load, self.held)
        self.solver.setOperators(matrix)
        self.solver.solve(load, self.temperature.vector)
        self.temperature.x.scatter_forward()

    def flux(self):
        """The heat that leaves through the bottom in a unit of time."""
        return self.communicator.allreduce(fem.assemble_scalar(self.leaving))


def run(steps, cells=6, time_step=0.05, orders=None, seen=None, output=None, communicator=MPI.COMM_WORLD):
    """Takes the steps, and calls `seen(cycle, heat)` behind each; returns the report."""
    heat = Heat(cells, time_step, communicator)
    geometry = heat.mesh.geometry
    # Tombolo wants the vertices of all cells the same way round; dolfinx does not care.
    tets = heat.tets.copy()
    inverted = np.linalg.det(geometry.x[tets[:, 1:]] - geometry.x[tets[:, :1]]) < 0
    tets[inverted, 2:] = tets[inverted, :1:-1]
    count = np.arange(len(geometry.x), dtype=np.int32)
    lent = tombolo.Mesh(
        geometry.x,  # (vertices, 3), borrowed as it lies
        {"tetra": tets},
        faces=heat.faces,
        global_vertices=geometry.index_map().local_to_global(count),
    )
    settings = {"parameters": {"conductivity": (1, 0.1, 10)}, "orders": orders, "output": output}
    with tombolo.Adaptor(PIPELINES, communicator=communicator, **settings) as adaptor:
        if communicator.rank == 0:
            print(adaptor.invitation() or "no server", flush=True)
        for cycle in range(steps):
            lent.fields["temperature"] = heat.temperature.x.array[heat.unknowns]
            steering = adaptor.execute(cycle, time_step * cycle, time_step, {"solid": lent})
            if steering.stop:
                break
            heat.conductivity.value = steering.parameters["conductivity"]
            velocity = heat.velocity.x.array.reshape(-1, 3)
            velocity[:] = 0
            if steering.motion is not None:
                geometry.x[:] = steering.motion.coordinates
                velocity[heat.unknowns] = steering.motion.velocity
            heat.step()
            if seen is not None:
                seen(cycle, heat)
    return adaptor.report


def main():
    """The program."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--steps", type=int, default=1_000_000)
    arguments.add_argument("--cells", type=int, default=6, help="along each axis")
    arguments.add_argument("--orders", type=Path, help="a file of orders known beforehand")
    arguments.add_argument("--output", type=Path, help="the folder of the journal and of files")
    given = arguments.parse_args()

    def seen(cycle, heat):
        height = heat.communicator.allreduce(heat.mesh.geometry.x[:, 2].max(), MPI.MAX)
        flux = heat.flux()
        if cycle % 10 == 9 and heat.communicator.rank == 0:
            print(f"cycle {cycle}: height {height!r}, flux {flux:.6f}", flush=True)

    orders = json.loads(given.orders.read_text()) if given.orders else None
    run(given.steps, given.cells, orders=orders, seen=seen, output=given.output)


if __name__ == "__main__":
    main()
