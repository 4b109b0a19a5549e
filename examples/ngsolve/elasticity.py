"""A bar that is clamped at one end and loaded at the other, in time, with NGSolve: linear elasticity.

    python examples/ngsolve/elasticity.py                      # opens a server: follow the link that it prints
    python examples/ngsolve/elasticity.py --steps 100 --orders ORDERS.json

Quadratic elements, Newmark's method with the mean acceleration, damping in proportion to the mass. An order changes the
shape of the bar that bears no load; what the load does to it is `bending`, which the viewer shows as a field.
"""

import argparse
import json
from pathlib import Path

import ngsolve as ngs
import numpy as np
import tombolo
from netgen.occ import Box, OCCGeometry, Pnt, X

PIPELINES = {
    "version": 1,
    "stream": {"listen": "127.0.0.1:0"},
    "pipelines": [
        {"name": "surface", "every": {"steps": 2}, "stages": [{"surface": {}}, {"stream": {}}]},
        {"name": "bending", "every": {"steps": 1}, "stages": [{"statistics": {"field": "bending"}}]},
    ],
}


def bar(size):
    """A bar of 2 x 0.3 x 0.3 along x."""
    box = Box(Pnt(0, 0, 0), Pnt(2, 0.3, 0.3))
    box.faces.name = "side"
    box.faces.Min(X).name = "clamp"
    box.faces.Max(X).name = "end"
    return ngs.Mesh(OCCGeometry(box).GenerateMesh(maxh=size))


class Bar:
    """The state of the solver; density and Young's modulus are 1."""

    def __init__(self, size, poisson, load, damping, time_step):
        self.mesh = mesh = bar(size)
        self.poisson, self.load, self.damping, self.time_step = poisson, load, damping, time_step
        self.space = ngs.VectorH1(mesh, order=2, dirichlet="clamp")
        self.bending, self.velocity, self.acceleration = (ngs.GridFunction(self.space) for _ in range(3))
        # A linear field has a number for each vertex: all x, then all y, then all z.
        self.deformation = ngs.GridFunction(ngs.VectorH1(mesh, order=1))
        self.assemble()

    def assemble(self):
        """Sets the operators up on the mesh as it is."""
        u, v = self.space.TnT()
        shear = 0.5 / (1 + self.poisson)
        spread = self.poisson / ((1 + self.poisson) * (1 - 2 * self.poisson))
        strain = ngs.Sym(ngs.Grad(u))
        stress = 2 * shear * strain + spread * ngs.Trace(strain) * ngs.Id(3)
        stiffness = ngs.InnerProduct(stress, ngs.Grad(v)) * ngs.dx
        half, mass = 0.5 * self.time_step, u * v * ngs.dx
        self.stiffness = ngs.BilinearForm(stiffness).Assemble().mat
        self.mass = ngs.BilinearForm(mass).Assemble().mat
        self.force = ngs.LinearForm(ngs.CF(self.load) * v * ngs.ds("end")).Assemble().vec
        implicit = ngs.BilinearForm((1 + half * self.damping) * mass + half**2 * stiffness).Assemble().mat
        self.inverse = implicit.Inverse(self.space.FreeDofs(), inverse="sparsecholesky")

    def move(self, displacement):
        """Moves the mesh to the reference and a displacement of shape (vertices, 3)."""
        self.mesh.UnsetDeformation()
        self.deformation.vec.FV().NumPy()[:] = displacement.T.ravel()
        if displacement.any():
            self.mesh.SetDeformation(self.deformation)
        self.assemble()

    def step(self):
        """One step of Newmark's method."""
        half = 0.5 * self.time_step
        u, v, a = (field.vec for field in (self.bending, self.velocity, self.acceleration))
        # What the step would reach with no acceleration at its end.
        v.data += half * a
        u.data += self.time_step * v - half**2 * a
        a.data = self.inverse * (self.force - self.stiffness * u - self.damping * self.mass * v).Evaluate()
        u.data += half**2 * a
        v.data += half * a

    def at_end(self):
        """How far the end has come, in the mean over it: a tuple of x, y and z."""
        end = self.mesh.Boundaries("end")
        area = ngs.Integrate(ngs.CF(1), self.mesh, definedon=end)
        return tuple(ngs.Integrate(self.bending[axis], self.mesh, definedon=end) / area for axis in range(3))

    def at_vertices(self):
        """The bending (vertices, 3), as a view of what NGSolve holds."""
        return self.bending.vec.FV().NumPy().reshape(3, -1)[:, : self.mesh.nv].T


def run(steps, size=0.15, poisson=0.3, load=(0, 0, -2e-5), damping=0.2, orders=None, seen=None, output=None):
    """Takes the steps, and calls `seen(cycle, bar, points)` behind each; returns the report."""
    time_step = 0.5
    solver = Bar(size, poisson, load, damping, time_step)
    mesh = solver.mesh
    reference = np.array([vertex.point for vertex in mesh.vertices])
    points = reference.copy()
    faces = {name: [] for name in dict.fromkeys(mesh.GetBoundaries())}
    for face in mesh.Elements(ngs.BND):
        faces[face.mat].append([vertex.nr for vertex in face.vertices])
    lent = tombolo.Mesh(
        points,
        # Netgen numbers tetrahedra the other way round.
        {"tetra": np.array([[v.nr for v in cell.vertices] for cell in mesh.Elements(ngs.VOL)])[:, [0, 2, 1, 3]]},
        {"bending": solver.at_vertices()},
        faces={name: np.array(of) for name, of in faces.items()},
    )
    with tombolo.Adaptor(PIPELINES, orders=orders, output=output) as adaptor:
        print("bar: open", adaptor.link, flush=True)
        for cycle in range(steps):
            steering = adaptor.execute(cycle, time_step * cycle, time_step, {"bar": lent})
            if steering.stop:
                break
            if steering.motion is not None:
                points[:] = steering.motion.coordinates
                solver.move(points - reference)
            solver.step()
            if seen is not None:
                seen(cycle, solver, points)
    return adaptor.report


def main():
    """The program."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--steps", type=int, default=1_000_000)
    arguments.add_argument("--orders", type=Path, help="a file of orders known beforehand")
    given = arguments.parse_args()

    def seen(cycle, solver, _):
        if cycle % 20 == 0:
            print(f"cycle {cycle}: the end has come down by {-solver.at_end()[2]:.6f}", flush=True)

    run(given.steps, orders=json.loads(given.orders.read_text()) if given.orders else None, seen=seen)


if __name__ == "__main__":
    main()
