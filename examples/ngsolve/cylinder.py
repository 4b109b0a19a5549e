"""Navier-Stokes around a cylinder in a channel with NGSolve, on a mesh that moves (ALE).

    python examples/ngsolve/cylinder.py                      # opens a server: follow the link that it prints
    python examples/ngsolve/cylinder.py --steps 100 --orders ORDERS.json

Taylor-Hood elements; Stokes is implicit, convection explicit. NGSolve moves a mesh by a field of displacements from
the reference mesh: each shape is written into it, and the operator is assembled anew.
"""

import argparse
import json
from pathlib import Path

import ngsolve as ngs
import numpy as np
import tombolo
from netgen.occ import Box, Cylinder, OCCGeometry, Pnt, X, Y

MIDPLANE = {"slice": {"origin": [0, 0.2, 0], "normal": [0, 1, 0]}}
PIPELINES = {
    "version": 1,
    "stream": {"listen": "127.0.0.1:0"},
    "pipelines": [
        {"name": "midplane", "every": {"steps": 1}, "stages": [MIDPLANE, {"stream": {}}]},
        {"name": "surface", "every": {"steps": 5}, "stages": [{"surface": {}}, {"stream": {}}]},
        {"name": "speed", "every": {"steps": 1}, "stages": [{"statistics": {"field": "velocity"}}]},
    ],
}


def channel(size):
    """A channel of 1.2 x 0.4 x 0.4 with a cylinder of radius 0.06 across it."""
    box = Box(Pnt(0, 0, 0), Pnt(1.2, 0.4, 0.4))
    box.faces.name = "wall"
    box.faces.Min(X).name = "inlet"
    box.faces.Max(X).name = "outlet"
    cylinder = Cylinder(Pnt(0.4, 0, 0.2), Y, r=0.06, h=0.4)
    cylinder.faces.name = "cylinder"
    return ngs.Mesh(OCCGeometry(box - cylinder).GenerateMesh(maxh=size))


class Flow:
    """The state of the solver: velocity and pressure on a mesh that is deformed."""

    def __init__(self, size, viscosity, time_step):
        self.mesh = mesh = channel(size)
        self.viscosity, self.time_step = viscosity, time_step
        velocity = ngs.VectorH1(mesh, order=2, dirichlet="inlet|wall|cylinder")
        self.space = velocity * ngs.H1(mesh, order=1)
        self.state = ngs.GridFunction(self.space)
        # Linear fields have a number for each vertex: all x, then all y, then all z.
        linear = ngs.VectorH1(mesh, order=1)
        self.deformation, self.mesh_velocity = ngs.GridFunction(linear), ngs.GridFunction(linear)
        inflow = ngs.CF((250 * ngs.y * (0.4 - ngs.y) * ngs.z * (0.4 - ngs.z), 0, 0))
        self.given = mesh.BoundaryCF({"inlet": inflow, "wall|cylinder": self.mesh_velocity}, default=0 * inflow)
        self.boundary = ngs.GridFunction(self.space)
        self.free = ngs.Projector(self.space.FreeDofs(), True)
        self.assemble()

    def assemble(self):
        """Sets Stokes' operator up on the mesh as it is."""
        (u, p), (v, q) = self.space.TnT()
        stokes = self.viscosity * ngs.InnerProduct(ngs.Grad(u), ngs.Grad(v)) - ngs.div(u) * q - ngs.div(v) * p
        self.stokes = ngs.BilinearForm(stokes * ngs.dx).Assemble()
        mass = ngs.BilinearForm((u * v + self.time_step * (stokes - 1e-10 * p * q)) * ngs.dx).Assemble()
        self.inverse = mass.mat.Inverse(self.space.FreeDofs(), inverse="umfpack")

    def move(self, displacement, velocity):
        """Moves the mesh to the reference and a displacement, at a velocity; both of shape (vertices, 3)."""
        self.mesh.UnsetDeformation()
        self.deformation.vec.FV().NumPy()[:] = displacement.T.ravel()
        self.mesh_velocity.vec.FV().NumPy()[:] = velocity.T.ravel()
        if displacement.any():
            self.mesh.SetDeformation(self.deformation)
        self.assemble()

    def step(self):
        """One step; walls that move take the fluid along."""
        v = self.space.TestFunction()[0]
        u, moved = self.state.components[0], self.mesh_velocity
        self.boundary.components[0].Set(self.given, definedon=self.mesh.Boundaries("inlet|wall|cylinder"))
        self.state.vec.data = self.free * self.state.vec + self.boundary.vec
        convection = ngs.LinearForm((ngs.Grad(u) * (u - moved)) * v * ngs.dx).Assemble()
        residual = (convection.vec + self.stokes.mat * self.state.vec).Evaluate()
        self.state.vec.data -= self.time_step * self.inverse * residual

    def drag(self):
        """The force of the flow on the cylinder along the channel, as the residual against a field that is 1 there."""
        test = ngs.GridFunction(self.space)
        test.components[0].Set(ngs.CF((1, 0, 0)), definedon=self.mesh.Boundaries("cylinder"))
        return -ngs.InnerProduct((self.stokes.mat * self.state.vec).Evaluate(), test.vec)

    def at_vertices(self):
        """Velocity (vertices, 3) and pressure (vertices,), as views of what NGSolve holds."""
        vertices, (velocity, pressure) = self.mesh.nv, self.state.components
        numbers = velocity.vec.FV().NumPy()
        return numbers.reshape(3, -1)[:, :vertices].T, pressure.vec.FV().NumPy()


def run(steps, size=0.08, viscosity=0.01, time_step=0.01, orders=None, seen=None, output=None):
    """Takes the steps, and calls `seen(cycle, flow, points)` behind each; returns the report."""
    flow = Flow(size, viscosity, time_step)
    mesh = flow.mesh
    reference = np.array([vertex.point for vertex in mesh.vertices])
    points = reference.copy()
    faces = {name: [] for name in dict.fromkeys(mesh.GetBoundaries())}
    for face in mesh.Elements(ngs.BND):
        faces[face.mat].append([vertex.nr for vertex in face.vertices])
    velocity, pressure = flow.at_vertices()
    lent = tombolo.Mesh(
        points,
        # Netgen numbers tetrahedra the other way round.
        {"tetra": np.array([[v.nr for v in cell.vertices] for cell in mesh.Elements(ngs.VOL)])[:, [0, 2, 1, 3]]},
        {"velocity": velocity, "pressure": pressure},
        faces={name: np.array(of) for name, of in faces.items()},
    )
    with tombolo.Adaptor(PIPELINES, orders=orders, output=output) as adaptor:
        print("cylinder: open", adaptor.link, flush=True)
        for cycle in range(steps):
            steering = adaptor.execute(cycle, time_step * cycle, time_step, {"flow": lent})
            if steering.stop:
                break
            if steering.motion is not None:
                points[:] = steering.motion.coordinates
                flow.move(points - reference, steering.motion.velocity)
            else:
                flow.mesh_velocity.vec[:] = 0
            flow.step()
            if seen is not None:
                seen(cycle, flow, points)
    return adaptor.report


def main():
    """The program."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--steps", type=int, default=1_000_000)
    arguments.add_argument("--orders", type=Path, help="a file of orders known beforehand")
    given = arguments.parse_args()

    def seen(cycle, flow, _):
        if cycle % 10 == 0:
            print(f"cycle {cycle}: drag {flow.drag():.6f}", flush=True)

    run(given.steps, orders=json.loads(given.orders.read_text()) if given.orders else None, seen=seen)


if __name__ == "__main__":
    main()
