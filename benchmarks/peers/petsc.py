"""Solves a linear system with PETSc, the peer of the benchmark `volume`.

    mpirun -n 2 /usr/bin/python3 benchmarks/peers/petsc.py SYSTEM SOLVER

SYSTEM holds, in PETSc's binary format, the matrix, the right side and the places of the unknowns; SOLVER is `icc` (CG with block
Jacobi and incomplete Cholesky) or `gamg` (CG with algebraic multigrid and rigid-body modes). The solution is written beside it
as SYSTEM.SOLVER, that of a last solve to a relative residual of 1e-10, so that its own error is not taken for another's. Prints the
seconds of set-up and of a solve to 1e-6, of three the quickest, and its iterations.
"""

import glob
import sys
import time

# Where Debian's python3-petsc4py-real puts it; only its metapackage links it from where Python looks.
sys.path += sorted(glob.glob("/usr/lib/petscdir/petsc*/*-real/lib/python3/dist-packages"))

import petsc4py  # noqa: E402

petsc4py.init(sys.argv[:1])
from petsc4py import PETSc  # noqa: E402

system, solver = sys.argv[1:3]
viewer = PETSc.Viewer().createBinary(system, "r")
matrix = PETSc.Mat().create()
matrix.setBlockSize(3)
matrix.setType("aij" if solver == "gamg" else "sbaij")
matrix.load(viewer)
right_side = PETSc.Vec().create()
right_side.setBlockSize(3)
right_side.load(viewer)
places = PETSc.Vec().create()
places.setBlockSize(3)
places.load(viewer)

matrix.setOption(PETSc.Mat.Option.SPD, True)
if solver == "gamg":
    matrix.setNearNullSpace(PETSc.NullSpace().createRigidBody(places))
PETSc.Options().insertString("-sub_pc_type icc" if solver == "icc" else "")
krylov = PETSc.KSP().create()
krylov.setType("cg")
krylov.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
krylov.setTolerances(rtol=1e-6, max_it=2000)
krylov.getPC().setType("bjacobi" if solver == "icc" else "gamg")
krylov.setOperators(matrix)
krylov.setFromOptions()

barrier = PETSc.COMM_WORLD.tompi4py().Barrier if hasattr(PETSc.COMM_WORLD, "tompi4py") else PETSc.COMM_WORLD.barrier
barrier()
start = time.perf_counter()
krylov.setUp()
krylov.setUpOnBlocks()
set_up = time.perf_counter() - start
solution = right_side.duplicate()
solves = []
for _ in range(3):
    solution.set(0.0)
    barrier()
    start = time.perf_counter()
    krylov.solve(right_side, solution)
    solves.append(time.perf_counter() - start)
    if krylov.getConvergedReason() <= 0:
        sys.exit(f"PETSc did not converge: {krylov.getConvergedReason()}")
iterations = krylov.getIterationNumber()
krylov.setTolerances(rtol=1e-10, max_it=10000)
krylov.solve(right_side, solution)
if krylov.getConvergedReason() <= 0:
    sys.exit(f"PETSc did not converge: {krylov.getConvergedReason()}")
solution.view(PETSc.Viewer().createBinary(f"{system}.{solver}", "w"))
if PETSc.COMM_WORLD.rank == 0:
    print(f"tombolo {set_up} {min(solves)} {iterations}")
