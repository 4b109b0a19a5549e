//! A run for solvers in other languages, on which the C interface and the Catalyst implementation
//! both rest.
//!
//! Such a solver has its arrays by their addresses ([`Array`]), its meshes in the forms of many
//! programs ([`mesh`]), and its ranks by a handle of MPI ([`ranks`]). [`Run`] shows them to the
//! adaptor, and keeps what the adaptor asks for until the solver reads it.

mod array;
mod asked;
mod declared;
mod error;
mod label;
mod memory;
pub mod mesh;
pub mod ranks;
mod run;

pub use array::{Array, NumberType, conduit_type};
pub use asked::Asked;
pub use declared::declare;
pub use error::{Kind, RunError};
pub use run::{Run, Shown};
