//! Incompressible Navier-Stokes on moving tetrahedral meshes: the solver behind every demo of
//! Tombolo.
//!
//! [`Solver`] is the numerics, and knows nothing of steering. The program `flow` reads a case,
//! calls Tombolo's adaptor before each step, and hands the mesh motion that comes back to the
//! solver.
//!
//! # The scheme
//!
//! - Linear tetrahedra for velocity and pressure, in the arbitrary Lagrangian-Eulerian frame
//!   (Donea, Giuliani and Halleux 1982): nodal values travel with the mesh, and the convecting
//!   velocity is `u - w` with the mesh velocity `w`.
//! - Time: the second-order backward difference; the first-order one while the mesh moves, and in
//!   each step that begins with an impulse: the first, the one in which the mesh starts or stops,
//!   and where a parameter changes. The convecting velocity is extrapolated in all steps but those.
//! - Momentum: convection linearised and implicit, SUPG (Brooks and Hughes 1982). One matrix for
//!   the three components, solved by BiCGStab with ILU(0).
//! - Pressure: incremental projection (van Kan 1986; Guermond, Minev and Shen 2006), with
//!   orthogonal subscales for the equal-order pair (Codina 2000, 2001). The matrix depends on the
//!   shape alone; conjugate gradients with multigrid ([`tombolo_deform::linear::Multigrid`]),
//!   semi-definite where there is no outlet.
//! - Outlets: pressure through the traction, with zero viscous traction (in the Laplacian form, `mu
//!   du/dn = 0`); backflow is damped (Bazilevs et al. 2009).
//! - A wall that starts or stops within one step acts by an impulse: the velocity is projected onto
//!   the new boundary values before the step (Gresho and Sani 1998, on impulsive starts). The
//!   impulse is no part of the reported pressure, but for what its projections leave to that of the
//!   step.
//!
//! # What is guaranteed, and what is not
//!
//! - A uniform stream stays uniform to rounding, whatever the mesh does: all terms act on
//!   differences of nodal values.
//! - Mass: where there is an outlet, the flux of the velocity through the whole boundary is 0 to the
//!   tolerance of the pressure solve, in every step, walls that move included. Without one, what the
//!   mesh gains or loses in volume stretches the fluid ([`StepOutcome::stretch`]). No pressure is
//!   prescribed strongly, so that the equation of continuity is tested with every shape function,
//!   those at the outlet included. Within the domain it holds weakly.
//! - The same bits whatever the number of threads. On several ranks the same bits each time; the
//!   preconditioners depend on the parts, so that from one number of ranks to another fields agree
//!   to the tolerances of the solves.
//! - Momentum is not conserved to rounding: the convective form is used.
//! - No turbulence model, and no shock capturing: at cell Reynolds numbers far above one a jet's
//!   edges may overshoot.
#![warn(missing_docs)]
#![expect(
    clippy::needless_range_loop,
    reason = "loops over rows and components index several arrays at once"
)]

mod boundary;
pub mod case;
mod error;
mod fluid;
mod folder;
mod geometry;
pub mod history;
pub mod linear;
mod momentum;
pub mod partition;
pub mod parts;
pub mod program;
mod program_error;
pub mod ranks;
pub mod report;
pub mod saved;
mod solver;
mod topology;

pub use boundary::{Condition, Patch, Place, Value};
pub use error::SolverError;
pub use fluid::Fluid;
pub use solver::{Motion, Settings, Solver, StepOutcome};
