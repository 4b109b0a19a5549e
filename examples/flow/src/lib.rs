//! Incompressible Navier-Stokes on moving tetrahedral meshes.
